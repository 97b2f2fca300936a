#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/types/rotation.h"

namespace rotslam {

/// Size and blending of a panorama.
struct StitchOptions {
  // Width of the whole sphere in pixels; 0: as fine as the images are, at most kMaxWidth.
  int width = 0;
  // Keep the whole sphere instead of cutting off what no image shows.
  bool full = false;
  // Take out what the exposure changed from image to image.
  bool compensate_exposure = true;
  // An image counts by its distance from its border to this power. One blends widely, which blurs
  // what does not fit; more lets each place be shown by few images.
  double sharpness = 4.0;
  int num_threads = 1;

  static constexpr int kMaxWidth = 8192;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("width", width);
    visit("full", full);
    visit("compensate_exposure", compensate_exposure);
    visit("sharpness", sharpness);
  }
};

/// A picture of the sphere, and which part of it that is.
struct Panorama {
  cv::Mat image;  // 8-bit BGR, longitude to the right, latitude upwards, equirectangular
  // Of the left upper corner and of the whole image, deg; longitude 0 is where the first view
  // looks, unless cutting moved it.
  double left_deg = -180.0;
  double top_deg = 90.0;
  double width_deg = 360.0;
  double height_deg = 180.0;
};

/// Takes a view: its number and its picture, 8-bit grey or BGR of the camera's size.
using ViewVisitor = std::function<void(int, const cv::Mat&)>;

/// Shows every view that has a picture to the visitor, in any order.
using ViewReader = std::function<void(const ViewVisitor&)>;

/// Puts views from one place onto a sphere.
///
/// The horizon is the plane that the views' horizontal axes have in common, or for views that do
/// not pan the first view's own. Brightness: one factor per view, least squares over the cells of
/// a coarse grid that several views show. Colours are means, weighted by the distance from the
/// view's border.
/// @param world_from_cam  of every view, at least one.
/// @param read_views      is called once, or twice where exposure is compensated for.
/// Cost:    linear in the pixels of all views.
/// Throws std::invalid_argument where options.Problem() or no view has an image.
Panorama Stitch(const Camera& camera,
                const std::vector<Rotation>& world_from_cam,
                const ViewReader& read_views,
                const StitchOptions& options);

}  // namespace rotslam
