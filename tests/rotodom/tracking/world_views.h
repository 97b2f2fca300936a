#pragma once

#include <algorithm>
#include <vector>

#include "rotodom/features/view.h"
#include "tests/rotodom/features/textured_world.h"

namespace rotslam {

inline FeatureOptions FewFeatures() {
  FeatureOptions options;
  options.max_features = 500;
  return options;
}

inline Rotation TurnDeg(double x_deg, double y_deg, double z_deg) {
  return Rotation::Exp(kRadFromDeg * Eigen::Vector3d(x_deg, y_deg, z_deg));
}

/// A view of `image` with corners of its own, as points first_track, first_track + 1, ...
inline View MakeView(const cv::Mat& image, FrameId frame, double timestamp_s, int first_track) {
  View view;
  view.timestamp_s = timestamp_s;
  view.features.frame = frame;
  view.pyramid = BuildPyramid(image, FewFeatures());
  DetectFeatures(view.pyramid, SmallCamera(), FewFeatures(), 1, view.features);
  for (int n = 0; n < view.features.size(); ++n) {
    view.features.tracks.push_back(TrackId{first_track + n});
  }
  view.flow_px_per_s.assign(view.features.size(), Eigen::Vector2d::Zero());
  view.is_lost.assign(view.features.size(), false);
  return view;
}

/// A view of `image` that shows the points of `from` where the true rotation puts them, of those
/// whose position in `from` is a multiple of `every`.
inline View CarryOver(const View& from,
                      const Rotation& view_from_from,
                      const cv::Mat& image,
                      FrameId frame,
                      double timestamp_s,
                      int every = 1) {
  constexpr double kBorderPx = 12.0;
  View view;
  view.timestamp_s = timestamp_s;
  view.features.frame = frame;
  view.pyramid = BuildPyramid(image, FewFeatures());
  for (int n = 0; n < from.features.size(); n += every) {
    const Eigen::Vector3d bearing = view_from_from * from.features.bearings[n];
    const auto px = SmallCamera().Project(bearing);
    if (!px || px->x() < kBorderPx || px->y() < kBorderPx || px->x() > image.cols - kBorderPx ||
        px->y() > image.rows - kBorderPx) {
      continue;
    }
    view.features.keypoints_px.push_back(*px);
    view.features.bearings.push_back(bearing);
    view.features.levels.push_back(from.features.levels[n]);
    view.features.rgb.push_back(from.features.rgb[n]);
    view.features.tracks.push_back(from.features.tracks[n]);
  }
  view.flow_px_per_s.assign(view.features.size(), Eigen::Vector2d::Zero());
  view.is_lost.assign(view.features.size(), false);
  return view;
}

inline double Quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values.empty()
             ? 0.0
             : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace rotslam
