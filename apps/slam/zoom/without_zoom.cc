#include "apps/slam/zoom/without_zoom.h"

#include <cmath>

#include <opencv2/imgproc.hpp>

#include "rotodom/self_calibration/through_lens.h"

namespace rotslam {
namespace {

void Scale(const Camera& camera, double scale, Features& features) {
  for (Eigen::Vector2d& keypoint_px : features.keypoints_px) {
    keypoint_px = Zoomed(keypoint_px, camera, scale);
  }
  for (Eigen::Matrix2f& covariance : features.covariances_px) {
    covariance *= static_cast<float>(scale * scale);
  }
  features.shared_error_px *= scale;
}

}  // namespace

void TakeZoomOut(const Camera& camera,
                 const FocalScales& scales,
                 std::map<FrameId, Features>& features) {
  for (const auto& [frame, scale] : scales) {
    const auto found = features.find(frame);
    if (found != features.end()) Scale(camera, 1.0 / scale, found->second);
  }
}

OdometryResult WithoutZoom(const OdometryResult& filmed,
                           const Camera& camera,
                           const FocalScales& scales,
                           const OdometryOptions& options,
                           std::uint64_t seed,
                           int num_threads) {
  OdometryResult without = filmed;
  TakeZoomOut(camera, scales, without.features);
  return ThroughLens(without, camera, options, seed, num_threads);
}

MaskedImage WithoutZoom(const MaskedImage& filmed, const Camera& camera, double scale) {
  const double back = 1.0 / scale;
  const cv::Matx23d to_camera(
      back, 0.0, (1.0 - back) * camera.cx, 0.0, back, (1.0 - back) * camera.cy);
  cv::Mat image = filmed.image;
  // The image becomes smaller: it is smoothed first, against aliasing.
  if (scale > 1.0) {
    cv::GaussianBlur(image, image, {0, 0}, 0.5 * std::sqrt(scale * scale - 1.0));
  }
  MaskedImage result = cv::Mat();
  cv::warpAffine(image, result.image, to_camera, image.size(), cv::INTER_LINEAR);
  cv::Mat used =
      filmed.mask.IsEmpty() ? cv::Mat(image.size(), CV_8U, cv::Scalar(255)) : filmed.mask.ToImage();
  cv::warpAffine(used, used, to_camera, image.size(), cv::INTER_NEAREST);
  result.mask = Mask(used);
  return result;
}

}  // namespace rotslam
