#include "apps/slam/lens_estimation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "apps/slam/build_map.h"
#include "apps/slam/orientation_collector.h"
#include "rotodom/self_calibration/find_lens.h"
#include "rotodom/self_calibration/through_lens.h"

namespace rotslam {
namespace {

// Enough motion to determine a lens, at a bounded time.
constexpr int kMaxFrames = 600;

// Rounds end when one changes the focal length by less than this share: orientations that are off
// by as much are within what bundle adjustment corrects.
constexpr double kTolerance = 0.02;
constexpr int kMaxRounds = 3;

// A fisheye must leave residuals of so much of those of a pinhole.
constexpr double kClearlyLess = 0.9;

// Features of a frame: a lens has a dozen parameters and needs fewer than a map.
constexpr int kMaxFeatures = 700;

// Frames that tell a lens well enough to start a run from: so many at least, and so many that turns
// carry the picture so far, as a share of its longer side.
constexpr std::size_t kFewestFrames = 150;
constexpr double kEnoughTurn = 0.5;
// Observations of each frame in their adjustment.
constexpr int kObservationsToStart = 120;

// Tells whoever observes the run of the frames of an estimate, and ends them once they tell enough.
class FramesObserver final : public SlamObserver {
 public:
  // @param focal_px  of the lens that the frames are tracked through; it need not be right, since
  //                  pixels are compared.
  // @param side_px   longer side of the images.
  FramesObserver(SlamObserver& observer, LensPurpose purpose, double focal_px, double side_px)
      : observer_(observer),
        ends_early_(purpose == LensPurpose::kStart),
        enough_rad_(kEnoughTurn * side_px / focal_px) {}

  void OnBegin(SlamStage stage, int num_steps) override { observer_.OnBegin(stage, num_steps); }
  void OnFrame(const FrameProgress& progress) override {
    observer_.OnFrame(progress);
    const RotationMap& rotations = progress.odometry.cam_from_world;
    // Tracking has started again.
    if (rotations.size() == 1) largest_turn_rad_ = 0.0;
    num_frames_ = rotations.size();
    if (!ends_early_ || rotations.empty()) return;
    const Rotation& newest = rotations.rbegin()->second;
    for (const auto& [frame, rotation] : rotations) {
      largest_turn_rad_ = std::max(largest_turn_rad_, (newest * rotation.Inverse()).Log().norm());
    }
  }
  void OnReadoutFound(const ReadoutEstimate& readout) override {
    observer_.OnReadoutFound(readout);
  }
  void OnStaticContent(const StaticContent& content) override {
    observer_.OnStaticContent(content);
  }
  void OnEnd(SlamStage stage, const Orientations& orientations) override {
    observer_.OnEnd(stage, orientations);
  }
  bool ShouldStop() override {
    is_asked_ = observer_.ShouldStop();
    return is_asked_ ||
           (ends_early_ && num_frames_ >= kFewestFrames && largest_turn_rad_ >= enough_rad_);
  }

  // Whether the run is to be ended, not the estimate's frames alone.
  bool is_asked() const { return is_asked_; }

 private:
  SlamObserver& observer_;
  bool ends_early_;
  double enough_rad_;
  double largest_turn_rad_ = 0.0;
  std::size_t num_frames_ = 0;
  bool is_asked_ = false;
};

// Options without the stages that do not contribute to the lens.
SlamOptions OptionsOfRounds(SlamOptions options, LensPurpose purpose) {
  options.loop.use_loops = false;
  options.rotodom.features.max_features =
      std::min(options.rotodom.features.max_features, kMaxFeatures);
  // Through a wrong lens another readout seems to fit.
  options.readout.enabled = false;
  options.krot.use_bracket = options.krot.start == KrotStart::kBisection;
  options.relocalisation.enabled = false;
  options.ba.find_covariance = false;
  // The run makes the last adjustments.
  if (purpose == LensPurpose::kStart) {
    options.ba.preparing_observations = 0;
    options.ba.max_final_rounds = 1;
    // Of few observations steps cost little, and from a rough lens it takes many of them.
    for (BundleRound* round : {&options.ba.coarse, &options.ba.fine}) {
      round->max_iterations = 150;
      round->function_tolerance = 1e-7;
    }
  }
  return options;
}

// The lens that the pairs of views tell; nullopt: none.
std::optional<Camera> LensOfPairs(const Orientations& orientations,
                                  const LensGuess& guess,
                                  const SlamOptions& options) {
  const Camera& camera = guess.camera;
  LensPairsOptions fit_options;
  fit_options.relative_rotation = options.rotodom.relative_rotation;
  fit_options.num_threads = options.num_threads;
  const auto found = FindLens(ChooseLensPairs(orientations.features, orientations.cam_from_world),
                              {camera.width, camera.height},
                              guess.knows_focal ? std::optional(camera.MeanFocal()) : std::nullopt,
                              fit_options);
  if (!found) return std::nullopt;
  return found->fit.camera;
}

// The pinhole with radial distortion that shows nearly what a fisheye does; nullopt where the view
// is too wide for a pinhole, or where the lens is none.
std::optional<Camera> PinholeLike(const Camera& fisheye) {
  if (fisheye.model != CameraModel::kEquidistant) return std::nullopt;
  // Farther from the axis distances in the picture grow without end.
  const double max_tangent = std::tan(70.0 * kRadFromDeg);
  constexpr int kSamples = 40;
  constexpr int kLeastSamples = 30;  // that a pinhole can show
  const Eigen::Vector2d center(fisheye.cx, fisheye.cy);
  const Eigen::Vector2d to_corner(
      fisheye.cx > 0.5 * fisheye.width ? -fisheye.cx : fisheye.width - fisheye.cx,
      fisheye.cy > 0.5 * fisheye.height ? -fisheye.cy : fisheye.height - fisheye.cy);
  // radius = f t + f k1 t^3 + f k2 t^5 of the tangent t.
  Eigen::Matrix<double, kSamples, 3> A = Eigen::Matrix<double, kSamples, 3>::Zero();
  Eigen::Matrix<double, kSamples, 1> radii = Eigen::Matrix<double, kSamples, 1>::Zero();
  for (int n = 0; n < kSamples; ++n) {
    const Eigen::Vector2d offset = (n + 1.0) / kSamples * to_corner;
    const auto bearing = fisheye.Unproject(center + offset);
    const bool is_ahead = bearing && bearing->z() > 0.0;
    const double t = is_ahead ? bearing->head<2>().norm() / bearing->z() : 2.0 * max_tangent;
    if (t > max_tangent) {
      if (n < kLeastSamples) return std::nullopt;
      break;
    }
    A.row(n) << t, t * t * t, t * t * t * t * t;
    radii[n] = offset.norm();
  }
  const Eigen::Vector3d terms = (A.transpose() * A).ldlt().solve(A.transpose() * radii);
  Camera pinhole = UncalibratedCamera({fisheye.width, fisheye.height}, terms[0]);
  pinhole.model = CameraModel::kRadtan;
  pinhole.cx = fisheye.cx;
  pinhole.cy = fisheye.cy;
  pinhole.distortion[0] = terms[1] / terms[0];
  pinhole.distortion[1] = terms[2] / terms[0];
  if (pinhole.Problem()) return std::nullopt;
  return pinhole;
}

// Orientations as they are through another lens.
Orientations SeenThrough(const Camera& camera,
                         const Orientations& orientations,
                         const SlamOptions& options) {
  Orientations seen = orientations;
  static_cast<OdometryResult&>(seen) =
      ThroughLens(orientations, camera, options.rotodom, options.seed, options.num_threads);
  seen.camera = camera;
  return seen;
}

// Median residual of the largest component, px; infinite where there is no map.
double ResidualOf(const MapResult& map) {
  const auto largest = std::max_element(
      map.bundles.begin(), map.bundles.end(), [](const BundleSummary& a, const BundleSummary& b) {
        return a.num_observations < b.num_observations;
      });
  return largest == map.bundles.end() ? std::numeric_limits<double>::infinity()
                                      : largest->after.median_px;
}

}  // namespace

double GuessFocalLength(const cv::Size& image_size) {
  return 1.2 * std::max(image_size.width, image_size.height);
}

Camera UncalibratedCamera(const cv::Size& image_size, double focal_px) {
  Camera camera;
  camera.width = image_size.width;
  camera.height = image_size.height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * (image_size.width - 1);
  camera.cy = 0.5 * (image_size.height - 1);
  return camera;
}

Camera PlainLens(const Camera& estimate) {
  Camera plain = UncalibratedCamera({estimate.width, estimate.height}, estimate.MeanFocal());
  plain.model = estimate.model;
  return plain;
}

void FreeLens(const Camera& expected, LensOptions& lens) {
  lens.refine_focal = true;
  lens.refine_principal_point = true;
  lens.refine_distortion = true;
  lens.refine_higher_terms = true;
  // Half of it: EstimateLens starts within a tenth.
  lens.focal_sigma = 0.5;
  // Lenses differ by so much. Only the tangential coefficients are held nearly at zero: along a
  // drive the principal point trades with them.
  lens.principal_sigma = 0.03;
  lens.distortion_sigma = 0.1;
  lens.tangential_share = 0.005;
  lens.min_tangential_gain = 0.002;
  lens.weighs_by_residuals = true;
  lens.expected = expected;
  lens.min_gain = 0.0;
}

LensEstimate EstimateLens(FrameSource& frames,
                          const LensGuess& guess,
                          const SlamOptions& options,
                          SlamObserver& observer,
                          const OrientationInputs& inputs,
                          LensPurpose purpose) {
  LensEstimate estimate;
  estimate.camera = guess.camera;
  SlamOptions options_of_rounds = OptionsOfRounds(options, purpose);
  OrientationInputs known;
  known.masks = inputs.masks;
  known.find_static_content = inputs.find_static_content;
  known.static_content = inputs.static_content;
  known.check_lens = false;
  observer.OnLensRound(0, guess.camera);
  FirstFrames beginning(frames, kMaxFrames);
  FramesObserver frames_observer(observer,
                                 purpose,
                                 guess.camera.MeanFocal(),
                                 std::max(guess.camera.width, guess.camera.height));
  const Orientations tracked =
      FindOrientations(beginning, guess.camera, options_of_rounds, known, frames_observer);
  frames.Rewind();
  estimate.interrupted = tracked.interrupted && frames_observer.is_asked();
  if (estimate.interrupted || tracked.CameraStands()) return estimate;
  estimate.static_content = tracked.static_content;
  int round = 0;
  const auto adjusted_from = [&](const Camera& camera) {
    observer.OnLensRound(++round, camera);
    FreeLens(PlainLens(camera), options_of_rounds.ba.lens);
    return BuildKeyframeMap(SeenThrough(camera, tracked, options),
                            options_of_rounds,
                            observer,
                            purpose == LensPurpose::kStart ? kObservationsToStart : 0);
  };
  if (const auto by_pairs = LensOfPairs(tracked, guess, options)) {
    estimate.camera = *by_pairs;
    estimate.is_found = true;
  }
  const std::optional<Camera> pinhole = PinholeLike(estimate.camera);
  while (round < kMaxRounds) {
    double before_px = estimate.camera.MeanFocal();
    MapResult map = adjusted_from(estimate.camera);
    if (round == 1 && pinhole) {
      MapResult through_pinhole = adjusted_from(*pinhole);
      if (std::isfinite(ResidualOf(through_pinhole)) && !through_pinhole.camera.Problem() &&
          !(ResidualOf(map) < kClearlyLess * ResidualOf(through_pinhole))) {
        before_px = pinhole->MeanFocal();
        map = std::move(through_pinhole);
      }
    }
    if (map.camera == estimate.camera || map.camera.Problem()) break;
    estimate.camera = map.camera;
    estimate.sigmas = map.lens_sigmas;
    estimate.is_found = true;
    if (std::abs(map.camera.MeanFocal() / before_px - 1.0) <= kTolerance) break;
  }
  return estimate;
}

}  // namespace rotslam
