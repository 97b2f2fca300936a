#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/masks/mask.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Options of the search for a map's points in all its images.
struct CompletionOptions {
  // Off: tracks stay as the tracker has made them.
  bool enabled = true;
  // How far from where the map says a point may be found. More finds points again that drift has
  // carried away, and more of what only looks alike.
  double reach_px = 8.0;
  // Normalised correlation of the two patches. High: an observation too few costs little, a wrong
  // one is worth many.
  double min_correlation = 0.9;
  // A point is sought in so many of the views that are nearest to the one it is known by.
  int max_views = 200;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("enabled", enabled);
    visit("reach_px", reach_px);
    visit("min_correlation", min_correlation);
    visit("max_views", max_views);
  }
};

/// The image of a frame of the map.
struct MapView {
  cv::Mat image;  // 8-bit grey
  cv::Mat half;   // the same at half the size
  Mask mask;      // where no point is looked for
  // With a rolling shutter, the motion of the camera during the frame: rotation, and velocity of
  // the centre in world units per second.
  AngularMotion motion;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  // Rotation of the camera during the exposure of one row, rad in camera axes; zero where images
  // are sharp or the exposure time is not known.
  Eigen::Vector3d rotation_while_exposed = Eigen::Vector3d::Zero();
};
using MapViews = std::map<FrameId, MapView>;

/// @param image  8-bit, grey or colour.
MapView MakeMapView(const MaskedImage& image);

/// Searches every point of the map in all views that should see it, by aligning the patch around it
/// with that of a reference view, which sees the point from the middle of the others. A tracker
/// works from image to image, so that its errors add up and lost points stay lost. Where the map is
/// accurate to a few pixels, both can be corrected.
/// @param map    the tracks hold inliers only.
/// @param views  of frames with poses, or some of them.
/// @return  the map's tracks in the same order with the observations found. An observation of the
///          tracker is replaced where the point was found near it, and else kept.
/// Error:   keypoints to about 0.05 px (completion tests), whatever the length of the track.
/// Cost:    about 10 us per point and view.
/// Source:  Forster et al., SVO, ICRA 2014, sec. IV-B, for the alignment to a reference patch.
std::vector<Track> CompleteTracks(const Reconstruction& map,
                                  const MapViews& views,
                                  const Camera& camera,
                                  const CompletionOptions& options,
                                  int num_threads);

}  // namespace rotslam
