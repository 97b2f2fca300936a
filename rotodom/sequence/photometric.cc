#include "rotodom/sequence/photometric.h"

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "rotodom/camera/section.h"
#include "rotodom/sequence/image_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// The numbers of pcalib.txt: the light of each tone, in a unit of its own.
std::vector<double> ReadInverseResponse(const fs::path& file) {
  std::istringstream words(ReadText(file));
  std::vector<double> light;
  for (double value = 0.0; words >> value;) light.push_back(value);
  if (light.size() != 256) {
    FailAt(file,
           1,
           "has " + std::to_string(light.size()) +
               " numbers; expected is the light of each of the 256 tones");
  }
  for (std::size_t k = 1; k < light.size(); ++k) {
    if (light[k] > light[k - 1]) continue;
    FailAt(file,
           1,
           "the light of tone " + std::to_string(k) + " is not above that of tone " +
               std::to_string(k - 1));
  }
  return light;
}

// 1 / V, largest V = 1; 1 where V says nothing.
cv::Mat ReadGain(const fs::path& file, const cv::Size& image_size) {
  const DecodedImage decoded = DecodeImageFile(file);
  if (decoded.image.empty()) FailAt(file, 0, decoded.problem);
  if (decoded.image.size() != image_size) {
    FailAt(file,
           0,
           "is " + std::to_string(decoded.image.cols) + "x" + std::to_string(decoded.image.rows) +
               ", the images are " + std::to_string(image_size.width) + "x" +
               std::to_string(image_size.height));
  }
  cv::Mat first_channel;
  cv::extractChannel(decoded.image, first_channel, 0);
  cv::Mat vignette;
  first_channel.convertTo(vignette, CV_32F);
  double largest = 0.0;
  cv::minMaxLoc(vignette, nullptr, &largest);
  if (!(largest > 0.0)) FailAt(file, 0, "is black all over");
  cv::Mat gain(image_size, CV_32F, cv::Scalar(1.0));
  for (int y = 0; y < gain.rows; ++y) {
    for (int x = 0; x < gain.cols; ++x) {
      const float value = vignette.at<float>(y, x);
      if (value > 0.0F) gain.at<float>(y, x) = static_cast<float>(largest) / value;
    }
  }
  return gain;
}

}  // namespace

PhotometricCorrection::PhotometricCorrection(const PhotometricFiles& files,
                                             const cv::Size& image_size)
    : gain_(ReadGain(files.vignette.value(), image_size)) {
  std::vector<double> light(256);
  for (std::size_t k = 0; k < light.size(); ++k) light[k] = static_cast<double>(k);
  if (files.inverse_response) light = ReadInverseResponse(*files.inverse_response);
  const double darkest = light.front();
  const double scale = (kLevels - 1) / (light.back() - darkest);
  for (std::size_t k = 0; k < light.size(); ++k) {
    light_[k] = static_cast<float>((light[k] - darkest) * scale);
  }
  std::size_t tone = 0;
  for (std::size_t level = 0; level < tone_.size(); ++level) {
    // The nearest tone: those of neighbours meet halfway.
    while (tone < 255 && static_cast<float>(level) > 0.5F * (light_[tone] + light_[tone + 1])) {
      ++tone;
    }
    tone_[level] = static_cast<unsigned char>(tone);
  }
}

void PhotometricCorrection::Apply(cv::Mat& image) const {
  const int channels = image.channels();
  for (int y = 0; y < image.rows; ++y) {
    auto* pixel = image.ptr<std::uint8_t>(y);
    const auto* gain = gain_.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      for (int c = 0; c < channels; ++c, ++pixel) {
        const float level = light_[*pixel] * gain[x] + 0.5F;
        *pixel = tone_[static_cast<std::size_t>(std::min(level, kLevels - 1.0F))];
      }
    }
  }
}

}  // namespace rotslam
