#include "apps/cli/export/undistort.h"

#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

bool IsInImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= camera.width - 1.0 &&
         pixel.y() <= camera.height - 1.0;
}

// Where `from` shows what `to` has at a pixel.
std::optional<Eigen::Vector2d> SourceOf(const Camera& from,
                                        const Camera& to,
                                        const Eigen::Vector2d& pixel) {
  const auto bearing = to.Unproject(pixel);
  return bearing ? from.Project(*bearing) : std::nullopt;
}

// Where `to` shows what `from` has at a pixel; nullopt outside of its image.
std::optional<Eigen::Vector2d> TargetOf(const Camera& from,
                                        const Camera& to,
                                        const Eigen::Vector2d& pixel) {
  const auto target = SourceOf(to, from, pixel);
  return target && IsInImage(to, *target) ? target : std::nullopt;
}

// Whether `from` has a pixel for all of the border of `to`.
bool FillsBorder(const Camera& from, const Camera& to) {
  constexpr int kSteps = 64;
  const double right = to.width - 1.0;
  const double bottom = to.height - 1.0;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = right * k / kSteps;
    const double y = bottom * k / kSteps;
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(x, 0.0),
                                         Eigen::Vector2d(x, bottom),
                                         Eigen::Vector2d(0.0, y),
                                         Eigen::Vector2d(right, y)}) {
      const auto source = SourceOf(from, to, pixel);
      if (!source || !IsInImage(from, *source)) return false;
    }
  }
  return true;
}

}  // namespace

Camera UndistortedCamera(const Camera& camera) {
  constexpr double kLeast = 0.1;
  constexpr double kMost = 10.0;
  Camera result = camera;
  result.model = CameraModel::kPinhole;
  result.distortion = {};
  const auto zoomed = [&](double zoom) {
    Camera to = result;
    to.fx *= zoom;
    to.fy *= zoom;
    return to;
  };
  double too_wide = kLeast;
  double narrow = kMost;
  if (!FillsBorder(camera, zoomed(narrow))) {
    throw std::runtime_error("--undistort: no image without distortion fits into this lens's");
  }
  while (narrow / too_wide > 1.0 + 1e-6) {
    const double middle = std::sqrt(narrow * too_wide);
    (FillsBorder(camera, zoomed(middle)) ? narrow : too_wide) = middle;
  }
  return zoomed(narrow);
}

std::map<FrameId, Camera> UndistortedCameras(const std::map<FrameId, Camera>& cameras,
                                             const Camera& from,
                                             const Camera& to) {
  std::map<FrameId, Camera> result;
  for (const auto& [frame, camera] : cameras) {
    Camera& undistorted = result[frame] = to;
    undistorted.fx *= camera.fx / from.fx;
    undistorted.fy *= camera.fy / from.fy;
    undistorted.cx = camera.cx;
    undistorted.cy = camera.cy;
  }
  return result;
}

ImageUndistorter::ImageUndistorter(const Camera& from, const Camera& to)
    : columns_(to.height, to.width, CV_32F), rows_(to.height, to.width, CV_32F) {
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      const auto source = SourceOf(from, to, Eigen::Vector2d(x, y));
      columns_.at<float>(y, x) = source ? static_cast<float>(source->x()) : -1.0F;
      rows_.at<float>(y, x) = source ? static_cast<float>(source->y()) : -1.0F;
    }
  }
}

cv::Mat ImageUndistorter::operator()(const cv::Mat& image) const {
  cv::Mat result;
  cv::remap(image, result, columns_, rows_, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return result;
}

void UndistortMap(const Camera& to, RunMap& map) {
  const Camera from = std::exchange(map.camera, to);
  for (MapFrame& frame : map.frames) {
    frame.image = std::filesystem::path(frame.image).replace_extension(".png").string();
  }
  std::vector<MapTrack> tracks;
  tracks.reserve(map.tracks.size());
  for (const MapTrack& entry : map.tracks) {
    MapTrack moved;
    moved.track.id = entry.track.id;
    moved.track.rgb = entry.track.rgb;
    moved.point_in_world = entry.point_in_world;
    for (std::size_t k = 0; k < entry.fits.size(); ++k) {
      Observation seen = entry.track.observations[k];
      const auto pixel = TargetOf(from, to, seen.keypoint_px);
      if (!pixel) continue;
      seen.keypoint_px = *pixel;
      moved.track.observations.push_back(seen);
      moved.fits.push_back(entry.fits[k]);
      moved.levels.push_back(entry.levels[k]);
    }
    if (!moved.fits.empty()) tracks.push_back(std::move(moved));
  }
  map.tracks = std::move(tracks);
}

void UndistortMatches(const Camera& from, const Camera& to, ViewGraphMatches& matches) {
  constexpr float kFarOutside = -1e6F;
  for (auto& [frame, keypoints_px] : matches.keypoints_px) {
    for (Eigen::Vector2f& keypoint_px : keypoints_px) {
      const auto pixel = TargetOf(from, to, keypoint_px.cast<double>());
      keypoint_px =
          pixel ? Eigen::Vector2f(pixel->cast<float>()) : Eigen::Vector2f(kFarOutside, kFarOutside);
    }
  }
}

}  // namespace rotslam
