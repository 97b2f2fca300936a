#include "apps/cli/commands/checkerboard.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

std::vector<cv::Point3f> PointsOf(const Checkerboard& board) {
  std::vector<cv::Point3f> points;
  points.reserve(static_cast<std::size_t>(board.columns) * board.rows);
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      points.emplace_back(static_cast<float>(column * board.square_m),
                          static_cast<float>(row * board.square_m),
                          0.0F);
    }
  }
  return points;
}

std::vector<BoardCorners> SpreadEvenly(const std::vector<BoardCorners>& boards, int max_boards) {
  const std::size_t count = std::min(boards.size(), static_cast<std::size_t>(max_boards));
  std::vector<BoardCorners> chosen;
  chosen.reserve(count);
  for (std::size_t k = 0; k < count; ++k) chosen.push_back(boards[k * boards.size() / count]);
  return chosen;
}

double CoveredShare(const std::vector<BoardCorners>& boards, const cv::Size& size) {
  constexpr int kCells = 10;
  std::set<std::pair<int, int>> seen;
  for (const BoardCorners& corners : boards) {
    for (const cv::Point2f& corner : corners) {
      seen.emplace(static_cast<int>(corner.x * kCells / static_cast<float>(size.width)),
                   static_cast<int>(corner.y * kCells / static_cast<float>(size.height)));
    }
  }
  return static_cast<double>(seen.size()) / (kCells * kCells);
}

struct Fit {
  BoardCalibration calibration;
  std::vector<double> board_errors_px;
};

Fit FitCamera(const std::vector<BoardCorners>& boards,
              const Checkerboard& board,
              const cv::Size& size) {
  const std::vector<std::vector<cv::Point3f>> points(boards.size(), PointsOf(board));
  cv::Mat matrix;
  cv::Mat distortion;
  cv::Mat sigmas;
  cv::Mat errors_px;
  Fit fit;
  fit.calibration.error_px = cv::calibrateCamera(points,
                                                 boards,
                                                 size,
                                                 matrix,
                                                 distortion,
                                                 cv::noArray(),
                                                 cv::noArray(),
                                                 sigmas,
                                                 cv::noArray(),
                                                 errors_px,
                                                 cv::CALIB_FIX_K3);
  Camera& camera = fit.calibration.camera;
  camera.model = CameraModel::kRadtan;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = matrix.at<double>(0, 0);
  camera.fy = matrix.at<double>(1, 1);
  camera.cx = matrix.at<double>(0, 2);
  camera.cy = matrix.at<double>(1, 2);
  for (int k = 0; k < 4; ++k) camera.distortion[k] = distortion.at<double>(k);
  fit.calibration.num_boards = static_cast<int>(boards.size());
  fit.calibration.focal_sigma =
      std::max(sigmas.at<double>(0) / camera.fx, sigmas.at<double>(1) / camera.fy);
  fit.calibration.covered_share = CoveredShare(boards, size);
  fit.board_errors_px.assign(errors_px.begin<double>(), errors_px.end<double>());
  return fit;
}

// The boards that fit about as well as most do.
std::vector<BoardCorners> WithoutMisfits(const std::vector<BoardCorners>& boards,
                                         const std::vector<double>& errors_px,
                                         double max_ratio) {
  std::vector<double> sorted = errors_px;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  std::vector<BoardCorners> kept;
  kept.reserve(boards.size());
  for (std::size_t k = 0; k < boards.size(); ++k) {
    if (errors_px[k] <= max_ratio * *middle) kept.push_back(boards[k]);
  }
  return kept;
}

}  // namespace

std::optional<std::string> BoardCalibrationOptions::Problem() const {
  if (!(min_boards >= 3)) return OutOfRange("min_boards", min_boards, "three or more");
  if (!(max_boards >= min_boards))
    return OutOfRange("max_boards", max_boards, "min_boards or more");
  if (!(max_error_ratio > 1.0)) return OutOfRange("max_error_ratio", max_error_ratio, "above one");
  return std::nullopt;
}

std::optional<BoardCorners> FindBoard(const cv::Mat& image, const Checkerboard& board) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  BoardCorners corners;
  const bool is_found = cv::findChessboardCornersSB(
      grey,
      cv::Size(board.columns, board.rows),
      corners,
      cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
  if (!is_found) return std::nullopt;
  return corners;
}

std::optional<BoardCalibration> CalibrateWithBoards(const std::vector<BoardCorners>& boards,
                                                    const Checkerboard& board,
                                                    const cv::Size& image_size,
                                                    const BoardCalibrationOptions& options) {
  if (const auto problem = options.Problem()) throw std::invalid_argument(*problem);
  if (static_cast<int>(boards.size()) < options.min_boards) return std::nullopt;
  const std::vector<BoardCorners> chosen = SpreadEvenly(boards, options.max_boards);
  Fit fit = FitCamera(chosen, board, image_size);
  const std::vector<BoardCorners> kept =
      WithoutMisfits(chosen, fit.board_errors_px, options.max_error_ratio);
  const bool has_misfits = kept.size() < chosen.size();
  if (has_misfits && static_cast<int>(kept.size()) >= options.min_boards) {
    fit = FitCamera(kept, board, image_size);
  }
  return fit.calibration;
}

}  // namespace rotslam
