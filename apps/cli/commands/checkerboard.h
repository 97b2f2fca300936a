#pragma once

#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"

namespace rotslam {

/// A printed checkerboard, counted by its inner corners.
struct Checkerboard {
  int columns = 9;
  int rows = 6;
  double square_m = 0.025;  // edge of a square; the camera's numbers do not depend on it
};

/// Corners of one image, row by row, px.
using BoardCorners = std::vector<cv::Point2f>;

/// Options of a calibration with boards.
struct BoardCalibrationOptions {
  // Fewer boards cannot tell the lens from the boards' poses.
  int min_boards = 5;
  // So many at most are used, spread evenly over those found: more add time, not accuracy.
  int max_boards = 60;
  // Boards that fit worse than so many times the median board are blurred or misread: dropped.
  double max_error_ratio = 3.0;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("min_boards", min_boards);
    visit("max_boards", max_boards);
    visit("max_error_ratio", max_error_ratio);
  }
};

/// A camera from boards, and how far to believe it.
struct BoardCalibration {
  Camera camera;               // radtan, k3 zero: boards seldom reach where it counts
  int num_boards = 0;          // used
  double error_px = 0.0;       // root mean square distance of corners from where they should be
  double focal_sigma = 0.0;    // standard deviation of fx and fy as a share, the larger one
  double covered_share = 0.0;  // of the image, cut into 10 x 10 cells, that saw a corner
};

/// The corners of the board, to a fraction of a pixel; nullopt where it is not seen whole.
/// @param image  8-bit, one or three channels (BGR).
/// Cost:    0.1 to 1 s.
std::optional<BoardCorners> FindBoard(const cv::Mat& image, const Checkerboard& board);

/// Intrinsics and distortion (k1 k2 p1 p2) that explain the corners best.
/// @return  nullopt when there are fewer boards than options.min_boards. Throws
///          std::invalid_argument when options.Problem().
/// Error:   focal length within 0.5 % on rendered boards (calibrate tests).
/// Source:  Zhang, A Flexible New Technique for Camera Calibration, PAMI 2000; OpenCV's
///          calibrateCamera.
std::optional<BoardCalibration> CalibrateWithBoards(const std::vector<BoardCorners>& boards,
                                                    const Checkerboard& board,
                                                    const cv::Size& image_size,
                                                    const BoardCalibrationOptions& options);

}  // namespace rotslam
