#include "rotodom/features/binary_descriptor.h"

#include <cstring>
#include <stdexcept>

namespace rotslam {

std::vector<BinaryDescriptor> ToBinaryDescriptors(const cv::Mat& rows) {
  if (rows.empty()) return {};
  if (rows.type() != CV_8U || rows.cols != kDescriptorBytes) {
    throw std::invalid_argument("ToBinaryDescriptors: descriptors must be rows of 32 bytes");
  }
  std::vector<BinaryDescriptor> descriptors(static_cast<std::size_t>(rows.rows));
  for (int row = 0; row < rows.rows; ++row) {
    std::memcpy(descriptors[row].data(), rows.ptr(row), kDescriptorBytes);
  }
  return descriptors;
}

}  // namespace rotslam
