#include "apps/slam/masks/frame_masks.h"

#include <algorithm>
#include <stdexcept>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/features/features.h"
#include "rotodom/sequence/image_file.h"
#include "rotodom/sequence/image_list.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Stems that are numbers count as such: "000012" is "12".
std::string KeyOf(const std::string& stem) {
  const bool is_number =
      !stem.empty() &&
      std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return c >= '0' && c <= '9'; });
  if (!is_number) return stem;
  return stem.substr(std::min(stem.find_first_not_of('0'), stem.size() - 1));
}

bool IsLossy(const fs::path& file) {
  const std::string extension = LowerExtension(file);
  return extension == ".jpg" || extension == ".jpeg";
}

void WriteImage(const fs::path& file, const cv::Mat& image) {
  bool is_written = false;
  try {
    is_written = cv::imwrite(file.string(), image);
  } catch (const cv::Exception&) {
    // Said below.
  }
  if (!is_written) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace

Mask ReadMask(const fs::path& file, const cv::Size& size) {
  const auto [pixels, problem] = ReadImageFile(file);
  if (pixels.empty()) throw std::runtime_error(file.string() + ": " + problem);
  if (size.area() > 0 && pixels.size() != size) {
    throw std::runtime_error(file.string() + ": the mask is " + SizeText(pixels.size()) +
                             ", the images are " + SizeText(size));
  }
  cv::Mat used = pixels;
  if (used.channels() == 3) {
    // A colour is not black where any channel is not.
    std::vector<cv::Mat> channels;
    cv::split(pixels, channels);
    used = cv::max(cv::max(channels[0], channels[1]), channels[2]);
  }
  Mask mask(cv::Mat(used >= (IsLossy(file) ? 128 : 1)));
  if (mask.Share() == 1.0) {
    throw std::runtime_error(file.string() +
                             ": the mask is black everywhere; black is ignored, white is used");
  }
  return mask;
}

void FrameMasks::AddFolder(const fs::path& folder,
                           const std::vector<std::string>& names,
                           const cv::Size& size) {
  Files files;
  if (!IsFolder(folder)) throw std::runtime_error(folder.string() + ": is no folder of masks");
  for (const fs::path& file : ImagesIn(folder)) {
    files.emplace(KeyOf(file.stem().string()), file);
    files[file.filename().string()] = file;
  }
  if (files.empty()) throw std::runtime_error(folder.string() + ": holds no images");
  folder_ = folder;
  size_ = size;
  files_ = std::make_shared<const Files>(std::move(files));
  for (const std::string& name : names) FileOf(name);
}

fs::path FrameMasks::FileOf(const std::string& name) const {
  const fs::path path(name);
  const std::string file_name = path.filename().string();
  const std::string stem = IsImageName(path) ? path.stem().string() : file_name;
  for (const std::string& key : {file_name + ".png", file_name, KeyOf(stem)}) {
    const auto found = files_->find(key);
    if (found != files_->end()) return found->second;
  }
  throw std::runtime_error(folder_.string() + ": holds no mask for frame " + name +
                           "; it should be called " + file_name + ".png");
}

FrameMasks FrameMasks::Reduced(const WorkingSize& working) const {
  FrameMasks reduced = *this;
  reduced.common_ = working.Reduced(common_);
  reduced.working_ = working;
  return reduced;
}

Mask FrameMasks::Of(const std::string& name) const {
  if (folder_.empty()) return common_;
  // A frame that shows nothing but what is ignored is no error.
  const fs::path file = FileOf(name);
  const auto [pixels, problem] = ReadImageFile(file);
  if (pixels.empty()) throw std::runtime_error(file.string() + ": " + problem);
  if (cv::countNonZero(ToGrey(pixels)) == 0 && pixels.size() == size_) {
    const cv::Size size = working_.IsReduced() ? working_.size() : size_;
    return Mask(cv::Mat(cv::Mat::zeros(size, CV_8U)));
  }
  return Union(common_, working_.Reduced(ReadMask(file, size_)));
}

void WriteMask(const fs::path& file, const Mask& mask) { WriteImage(file, mask.ToImage()); }

std::vector<fs::path> WriteMasks(const FrameMasks& masks,
                                 const std::vector<std::string>& names,
                                 const fs::path& folder,
                                 const std::function<cv::Mat(const cv::Mat& mask)>& change) {
  std::vector<fs::path> files;
  if (masks.IsEmpty()) return files;
  for (const std::string& name : names) {
    const Mask mask = masks.Of(name);
    cv::Mat image = mask.IsEmpty() ? cv::Mat(masks.size(), CV_8U, cv::Scalar(255)) : mask.ToImage();
    if (change) image = change(image);
    files.emplace_back(name + ".png");
    fs::create_directories((folder / files.back()).parent_path());
    WriteImage(folder / files.back(), image);
  }
  return files;
}

}  // namespace rotslam
