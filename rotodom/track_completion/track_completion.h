#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/types/reconstruction.h"

namespace rotslam {

/// Of looking for a map's points in all its images.
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

/// An image that the map was made from.
struct MapView {
  cv::Mat image;  // 8-bit grey
  cv::Mat half;   // the same at half the size
  // With a rolling shutter, how the camera moved: how it turned, and its centre in world units per
  // second.
  AngularMotion motion;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  // How far the camera turned while one row was exposed, rad in camera axes; zero: sharp, or not
  // known.
  Eigen::Vector3d turn_while_exposed = Eigen::Vector3d::Zero();
};
using MapViews = std::map<FrameId, MapView>;

/// @param image  8-bit, grey or colour.
MapView MakeMapView(const cv::Mat& image);

/// Looks for every point of the map in all views that should show it, by aligning the patch around
/// it with that of the view which sees it from the middle of the others. A tracker follows a point
/// from image to image, so that its errors add up and what it has lost stays lost; where the map is
/// good to a few pixels both can be corrected.
/// @param map    the tracks' observations agree with the points.
/// @param views  of frames that have poses, or some of them.
/// @return  the map's tracks, in order, with the observations that were found; those that the track
/// had itself are replaced where the point was found near them, and else kept.
/// Error:   keypoints to about 0.05 px (completion tests), whatever the length of the track.
/// Cost:    about 10 us per point and view.
/// Source:  as direct alignment to a reference does, Forster et al., SVO, ICRA 2014, sec. IV-B.
std::vector<Track> CompleteTracks(const Reconstruction& map,
                                  const MapViews& views,
                                  const Camera& camera,
                                  const CompletionOptions& options,
                                  int num_threads);

}  // namespace rotslam
