#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace rotslam {

/// A small video stream of noise-free pictures, encoded by FFmpeg's own encoders.
struct TestStream {
  std::string codec = "mpeg4";  // "" for a stream of sound
  std::vector<cv::Mat> pictures;
  // Of each picture, in time_base_s; empty: 0, 1, 2 ...
  std::vector<std::int64_t> times;
  double fps = 10.0;  // of time 1
  int num_b_frames = 0;
  int key_frame_distance = 100;
  int pixel_width = 1;  // of sample aspect ratio
  int pixel_height = 1;
};

bool HasEncoder(const std::string& codec);

/// Writes a file with these streams; its name says the container.
/// @param tags  of the file: MP4 and QuickTime files hold any keys.
void WriteTestVideo(const std::filesystem::path& file,
                    const std::vector<TestStream>& streams,
                    const std::map<std::string, std::string>& tags = {});

/// Frame k is of a grey of 20 k + 10.
std::vector<cv::Mat> GreyPictures(int count, const cv::Size& size = {64, 48});

/// Red and green above, blue and white below.
cv::Mat FourColours(const cv::Size& size = {64, 48});

/// The colours of the four corners, in the order of reading: "rgbw".
std::string CornersOf(const cv::Mat& image);

/// Puts a display matrix into the track header of the MP4 or QuickTime file.
void PatchDisplayMatrix(const std::filesystem::path& file, const std::vector<std::int32_t>& matrix);

}  // namespace rotslam
