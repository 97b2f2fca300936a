#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "apps/slam/working_size/working_size.h"
#include "rotodom/masks/mask.h"

namespace rotslam {

/// Reads a mask: an image in which black (0) is ignored and every other value is used, as COLMAP
/// has it. In JPEG files, whose black is not exact, all below 128 counts as black.
/// @param size  of the frames; 0 by 0: any.
/// Throws std::runtime_error in one line, "path: reason": not there, no image, another size, or
/// nothing but black.
Mask ReadMask(const std::filesystem::path& file, const cv::Size& size);

/// The masks of a sequence: one for all frames, one for each, or both. Copies are cheap.
class FrameMasks {
 public:
  /// Nothing is masked.
  FrameMasks() = default;

  /// Masks the same pixels of every frame, beside what is masked already. Throws
  /// std::invalid_argument where the sizes differ.
  void AddToAll(const Mask& mask) { common_ = Union(common_, mask); }

  /// One image per frame, found by the frame's name: `NAME.png` (COLMAP: `0001.jpg.png`), `NAME`,
  /// or an image with NAME's stem; numbers may have other leading zeros. The files are read when
  /// Of() needs them. Throws std::runtime_error, "path: reason", where there is no such folder, it
  /// holds no image, or it lacks the mask of one of `names`.
  void AddFolder(const std::filesystem::path& folder,
                 const std::vector<std::string>& names,
                 const cv::Size& size);

  /// The masks of frames that are reduced to the size they are worked with.
  FrameMasks Reduced(const WorkingSize& working) const;

  /// The mask of the frame of this name. Throws as ReadMask, and where the folder has none.
  Mask Of(const std::string& name) const;

  /// Of all frames; empty where nothing is.
  const Mask& common() const { return common_; }
  /// Empty: there is no mask per frame.
  const std::filesystem::path& folder() const { return folder_; }
  bool IsEmpty() const { return common_.IsEmpty() && folder_.empty(); }
  /// Of the frames; 0 by 0 where nothing is masked.
  cv::Size size() const { return common_.IsEmpty() ? size_ : common_.size(); }

 private:
  using Files = std::map<std::string, std::filesystem::path>;

  std::filesystem::path FileOf(const std::string& name) const;

  Mask common_;
  std::filesystem::path folder_;
  cv::Size size_;                       // of the files in it
  WorkingSize working_;                 // that their masks are reduced to
  std::shared_ptr<const Files> files_;  // by name, and by stem without leading zeros
};

/// Writes the masks of frames as PNG files: `folder`/NAME.png, the form of COLMAP's mask_path.
/// @param names  of the frames, as image files; subfolders are made.
/// @param change  what to do to each mask, as an image, before it is written; null: nothing.
/// @return  the files, relative to `folder`, in the order of `names`; none where nothing is masked.
/// Throws std::runtime_error where a file cannot be written, and as FrameMasks::Of.
std::vector<std::filesystem::path> WriteMasks(
    const FrameMasks& masks,
    const std::vector<std::string>& names,
    const std::filesystem::path& folder,
    const std::function<cv::Mat(const cv::Mat& mask)>& change = nullptr);

/// Writes a mask that is not empty as a PNG file. Throws std::runtime_error where it cannot be
/// written.
void WriteMask(const std::filesystem::path& file, const Mask& mask);

}  // namespace rotslam
