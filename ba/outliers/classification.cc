#include "ba/outliers/classification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>

#include "ba/cost/loss.h"
#include "ba/cost/reprojection_cost.h"
#include "rotodom/types/parallel.h"
#include "rotodom/types/triangulation.h"

namespace rotslam {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Two-view hypotheses for a track in which not all observations agree.
constexpr int kMaxTrackHypotheses = 20;
// Gauss-Newton steps of a point, and the share of its cost that is worth another.
constexpr int kMaxSteps = 10;
constexpr double kLeastGain = 1e-4;

PosedRay AsPosedRay(const BundleState& state, const ObservationState& one, double focal_px) {
  const FrameState& frame = state.frames[one.frame];
  return {frame.cam_from_world,
          state.centers[frame.center],
          one.bearing,
          one.observation->sigma_px / focal_px};
}

// Measures tracks against what the frames, standing where they stand, have seen of them.
class Measure {
 public:
  // Matrices turn faster than quaternions, and each frame turns many points.
  explicit Measure(const BundleState& state) : state_(state) {
    R_c_w_.reserve(state.frames.size());
    for (const FrameState& frame : state.frames) R_c_w_.push_back(frame.cam_from_world.Matrix());
  }

  // Reprojection error; nullopt where the camera cannot see the position.
  std::optional<Eigen::Vector2d> ErrorPx(const TrackState& track,
                                         const ObservationState& one,
                                         const Eigen::Vector3d& position) const {
    const Eigen::Vector3d offset =
        track.one_place ? position : position - state_.centers[state_.frames[one.frame].center];
    const std::optional<Eigen::Vector2d> pixel = state_.camera.Project(R_c_w_[one.frame] * offset);
    if (!pixel) return std::nullopt;
    return *pixel - one.observation->keypoint_px;
  }

  // Length of an error, in sigmas.
  double Residual(const ObservationState& one, const Eigen::Vector2d& error_px) const {
    if (!state_.has_motion_blur) return error_px.norm() / one.observation->sigma_px;
    return (ScaleOf(state_, one) * error_px).norm();
  }

  // Of a track where it stands, in sigmas; infinite where the camera cannot see it.
  double Residual(const TrackState& track, const ObservationState& one) const {
    const auto error_px = ErrorPx(track, one, track.position);
    return error_px ? Residual(one, *error_px) : kInfinity;
  }

  const Eigen::Matrix3d& RotationOf(const ObservationState& one) const { return R_c_w_[one.frame]; }

 private:
  const BundleState& state_;
  std::vector<Eigen::Matrix3d> R_c_w_;
};

// Which observations a position explains, and how well it does over all of them.
struct Verdict {
  std::vector<bool> fits;
  int num_fits = 0;
  // Cost over all of them. Of what fits the round's loss, which minimisation lowers too, so that
  // one round after the other comes to rest. Of the others somewhat more than that at their limit,
  // half way to its square: else points give away good observations for a smaller loss of the
  // rest.
  double score = kInfinity;
};

class Classifier {
 public:
  Classifier(const BundleState& state, const BundleRound& round, const BundleOptions& options)
      : state_(state),
        measure_(state),
        max_error_px_(round.max_error_px),
        max_residual_(round.max_residual),
        loss_(MakeLoss(round)),
        min_angle_rad_(options.min_angle_deg * kRadFromDeg),
        min_track_observations_(options.min_track_observations) {}

  // Marks the observations that the track's position, or else a better one downhill from it,
  // explains; anywhere, those that the best of all positions does.
  void Classify(bool anywhere, TrackState& track) const {
    Best best;
    if (!anywhere && track.has_position) Offer(track, track.position, best);
    if (best.num_misfits > 0) {
      // A step can have thrown a point behind all cameras.
      const bool is_lost = track.kind != TrackKind::kOut && best.verdict.num_fits == 0;
      if (anywhere || is_lost) Search(track, best);
      Settle(track, best);
    }
    track.has_position = best.position.has_value();
    if (best.position) track.position = *best.position;
    best.verdict.fits.resize(track.observations.size(), false);
    Accept(track, best.verdict.fits);
  }

  // The same with the position as it is.
  void Recheck(TrackState& track) const {
    if (track.kind == TrackKind::kOut) return;
    Accept(track, Judge(track, track.position).fits);
  }

  // Takes the observations marked in `fits` if together they make a point.
  void Accept(TrackState& track, const std::vector<bool>& fits) const {
    int count = 0;
    for (std::size_t k = 0; k < fits.size(); ++k) {
      ObservationState& one = track.observations[k];
      one.used = fits[k] && !state_.frames[one.frame].weak;
      count += one.used ? 1 : 0;
    }
    const bool enough = count >= min_track_observations_ && (track.one_place || IsDeep(track));
    track.kind = !enough           ? TrackKind::kOut
                 : track.one_place ? TrackKind::kDirection
                                   : TrackKind::kPoint;
    if (enough) return;
    for (ObservationState& one : track.observations) one.used = false;
  }

 private:
  // The cheapest position so far.
  struct Best {
    std::optional<Eigen::Vector3d> position;
    Verdict verdict;
    int num_misfits = std::numeric_limits<int>::max();
  };

  void Offer(const TrackState& track,
             const std::optional<Eigen::Vector3d>& position,
             Best& best) const {
    if (!position || !position->allFinite()) return;
    Verdict verdict = Judge(track, *position, best.verdict.score);
    if (best.position && !(verdict.score < best.verdict.score)) return;
    best.position = position;
    best.num_misfits = static_cast<int>(track.observations.size()) - verdict.num_fits;
    best.verdict = std::move(verdict);
  }

  // From all observations, from pairs, and from those that fit.
  void Search(const TrackState& track, Best& best) const {
    const int num_observations = static_cast<int>(track.observations.size());
    Offer(track, Locate(track, std::vector<bool>(num_observations, true)), best);
    if (best.num_misfits == 0 || (max_error_px_ == 0.0 && best.position)) return;
    for (const auto& [a, b] : Pairs(num_observations)) {
      std::vector<bool> chosen(num_observations, false);
      chosen[a] = chosen[b] = true;
      Offer(track, Locate(track, chosen), best);
      if (best.num_misfits == 0) break;
    }
    if (best.verdict.num_fits >= 2) Offer(track, Locate(track, best.verdict.fits), best);
  }

  // On to the smallest cost. Cameras would otherwise be moved by, and observations judged at,
  // points that minimisation takes elsewhere.
  void Settle(const TrackState& track, Best& best) const {
    if (track.one_place) return;
    for (int k = 0; k < kMaxSteps && best.position; ++k) {
      const double before = best.verdict.score;
      Offer(track, Step(track, *best.position, best.verdict.fits), best);
      if (!(best.verdict.score < (1.0 - kLeastGain) * before)) return;
    }
  }

  // Of the residual, in sigmas.
  double LimitOf(const ObservationState& one) const {
    const double limit = max_residual_ > 0.0 ? max_residual_ : max_error_px_;
    if (limit == 0.0) return std::numeric_limits<double>::max();
    return limit * std::max(1.0, 1.0 / one.observation->sigma_px);
  }

  bool IsNear(const ObservationState& one, const Eigen::Vector2d& error_px) const {
    return max_error_px_ == 0.0 ||
           error_px.norm() <= max_error_px_ * std::max(1.0, one.observation->sigma_px);
  }

  // Where the score comes to more than `score_limit`, it and the rest are of the first observations
  // only.
  Verdict Judge(const TrackState& track,
                const Eigen::Vector3d& position,
                double score_limit = kInfinity) const {
    Verdict verdict;
    verdict.fits.reserve(track.observations.size());
    verdict.score = 0.0;
    for (const ObservationState& one : track.observations) {
      if (verdict.score > score_limit) break;
      const auto error_px = measure_.ErrorPx(track, one, position);
      const double limit = LimitOf(one);
      const double residual = error_px ? measure_.Residual(one, *error_px) : kInfinity;
      const bool fits = residual <= limit && IsNear(one, *error_px);
      verdict.fits.push_back(fits);
      verdict.num_fits += fits ? 1 : 0;
      const double sigmas = fits ? residual : limit;
      const double square = sigmas * sigmas;
      const double loss = Loss(square)[0];
      verdict.score += fits ? loss : 0.5 * (loss + square);
    }
    return verdict;
  }

  // The loss of a squared residual in sigmas, and its first two derivatives.
  std::array<double, 3> Loss(double square) const {
    if (!loss_) return {square, 1.0, 0.0};
    std::array<double, 3> loss;
    loss_->Evaluate(square, loss.data());
    return loss;
  }

  std::optional<Eigen::Vector3d> Locate(const TrackState& track,
                                        const std::vector<bool>& chosen) const {
    if (track.one_place) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t k = 0; k < chosen.size(); ++k) {
        if (!chosen[k]) continue;
        const Observation& observation = *track.observations[k].observation;
        sum += state_.frames[track.observations[k].frame].cam_from_world.Inverse() *
               track.observations[k].bearing / (observation.sigma_px * observation.sigma_px);
      }
      if (!(sum.norm() > 0.0)) return std::nullopt;
      return sum.normalized();
    }
    std::vector<PosedRay> rays;
    rays.reserve(chosen.size());
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      if (chosen[k]) {
        rays.push_back(AsPosedRay(state_, track.observations[k], state_.camera.MeanFocal()));
      }
    }
    if (rays.size() < 2) return std::nullopt;
    return Triangulate(rays, min_angle_rad_);
  }

  // A Gauss-Newton step towards the smallest cost of the chosen observations.
  std::optional<Eigen::Vector3d> Step(const TrackState& track,
                                      const Eigen::Vector3d& position,
                                      const std::vector<bool>& chosen) const {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      if (!chosen[k]) continue;
      const ObservationState& one = track.observations[k];
      ReprojectionJacobian J;
      const std::optional<Eigen::Vector2d> pixel =
          Reproject(state_.camera,
                    measure_.RotationOf(one),
                    state_.centers[state_.frames[one.frame].center],
                    position,
                    &J);
      if (!pixel) continue;
      const Eigen::Matrix2d scale = ScaleOf(state_, one);
      const Eigen::Vector2d residual = scale * (*pixel - one.observation->keypoint_px);
      const double weight = Loss(residual.squaredNorm())[1];
      const Eigen::Matrix<double, 2, 3> J_point = scale * J.by_point;
      H.noalias() += weight * J_point.transpose() * J_point;
      g.noalias() += weight * J_point.transpose() * residual;
    }
    const Eigen::LDLT<Eigen::Matrix3d> factor(H);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nullopt;
    return position - factor.solve(g);
  }

  // Pairs of observations, widest apart first.
  static std::vector<std::pair<int, int>> Pairs(int num_observations) {
    std::vector<std::pair<int, int>> pairs;
    for (int gap = num_observations - 1; gap > 0; --gap) {
      for (int a = 0; a + gap < num_observations; ++a) {
        pairs.emplace_back(a, a + gap);
        if (static_cast<int>(pairs.size()) == kMaxTrackHypotheses) return pairs;
      }
    }
    return pairs;
  }

  // Whether two of the used rays meet at the smallest angle allowed.
  bool IsDeep(const TrackState& track) const {
    // Chords instead of angles, of which one comparison with the first ray settles most tracks.
    const double least = 2.0 * std::sin(0.5 * min_angle_rad_);
    std::vector<Eigen::Vector3d> rays;
    rays.reserve(track.observations.size());
    double largest_from_first = 0.0;
    for (const ObservationState& one : track.observations) {
      if (!one.used) continue;
      rays.push_back(
          (track.position - state_.centers[state_.frames[one.frame].center]).normalized());
      largest_from_first = std::max(largest_from_first, (rays.back() - rays.front()).norm());
    }
    // Two rays are no farther apart than both are from the first one, together.
    if (largest_from_first >= least) return true;
    if (2.0 * largest_from_first < least) return false;
    for (std::size_t b = rays.size(); b-- > 0;) {
      for (std::size_t a = 0; a < b; ++a) {
        if ((rays[a] - rays[b]).squaredNorm() >= least * least) return true;
      }
    }
    return false;
  }

  const BundleState& state_;
  Measure measure_;
  double max_error_px_;  // zero: whatever projects fits
  double max_residual_;  // zero: as the former, in sigmas
  std::unique_ptr<ceres::LossFunction> loss_;
  double min_angle_rad_;
  int min_track_observations_;
};

// Takes frames out that are left with too few observations, then tracks that lose theirs, until
// nothing changes.
void RemoveWeakFrames(const Classifier& classifier, int min_observations, BundleState& state) {
  for (bool changed = true; changed;) {
    std::vector<int> count(state.frames.size(), 0);
    for (const TrackState& track : state.tracks) {
      for (const ObservationState& one : track.observations) count[one.frame] += one.used ? 1 : 0;
    }
    changed = false;
    for (std::size_t k = 0; k < state.frames.size(); ++k) {
      FrameState& frame = state.frames[k];
      if (frame.fixed || frame.weak || count[k] >= min_observations) continue;
      frame.weak = true;
      changed = true;
    }
    if (!changed) return;
    for (TrackState& track : state.tracks) {
      if (track.kind == TrackKind::kOut) continue;
      std::vector<bool> fits;
      for (const ObservationState& one : track.observations) fits.push_back(one.used);
      classifier.Accept(track, fits);
    }
  }
}

// Calls visit(track, one) for what points and directions are made of.
template <class Visit>
void ForEachUsedObservation(const BundleState& state, const Visit& visit) {
  for (const TrackState& track : state.tracks) {
    if (track.kind == TrackKind::kOut) continue;
    for (const ObservationState& one : track.observations) {
      if (one.used) visit(track, one);
    }
  }
}

}  // namespace

void ClassifyAll(const BundleRound& round,
                 Placement placement,
                 const BundleOptions& options,
                 BundleState& state) {
  const Classifier classifier(state, round, options);
  if (placement != Placement::kStays) {
    for (FrameState& frame : state.frames) frame.weak = false;
  }
  ParallelFor(static_cast<int>(state.tracks.size()), options.num_threads, [&](int k) {
    TrackState& track = state.tracks[k];
    if (placement == Placement::kStays) {
      classifier.Recheck(track);
    } else {
      classifier.Classify(placement == Placement::kAnywhere ||
                              (placement == Placement::kWhereKnown && !track.has_position),
                          track);
    }
  });
  RemoveWeakFrames(classifier, kMinFrameObservations, state);
}

double ResidualSpread(const BundleState& state) {
  const Measure measure(state);
  std::vector<double> residuals;
  ForEachUsedObservation(state, [&](const TrackState& track, const ObservationState& one) {
    residuals.push_back(measure.Residual(track, one));
  });
  if (residuals.empty()) return 0.0;
  std::size_t num_free = 0;
  for (const TrackState& track : state.tracks) {
    if (track.kind != TrackKind::kOut) num_free += track.kind == TrackKind::kPoint ? 3 : 2;
  }
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  // Two observations or more to a track: a quarter of the measurements or more.
  const auto measured = static_cast<double>(2 * residuals.size());
  return *middle * std::sqrt(measured / (measured - static_cast<double>(num_free)));
}

bool ShowsMotionBlur(const BundleState& state) {
  // In nats for each observation. TUM fr1_rpy and parts of it 0.024 to 0.10, the 7-Scenes kitchen
  // and KITTI 00 0.002, where nothing is gained, sharp renderings -0.06 to 0.006.
  constexpr double kLeastEvidence = 0.015;
  // Shorter ones say nothing.
  constexpr double kLeastBlur = 0.05;
  constexpr int kMinObservations = 200;
  const Measure measure(state);
  int count = 0;
  double plain_sum = 0.0;
  double sharp_sum = 0.0;
  double sum_of_logs = 0.0;
  ForEachUsedObservation(state, [&](const TrackState& track, const ObservationState& one) {
    const Eigen::Vector2d blur = one.observation->blur.cast<double>();
    const double length = blur.norm();
    if (!(length > kLeastBlur)) return;
    const auto error_px = measure.ErrorPx(track, one, track.position);
    if (!error_px) return;
    const Eigen::Vector2d residual = *error_px / one.observation->sigma_px;
    const double along = std::abs(residual.dot(blur)) / length;
    const double across = std::abs(residual.x() * blur.y() - residual.y() * blur.x()) / length;
    const double longer = std::hypot(1.0, length);
    ++count;
    plain_sum += along + across;
    sharp_sum += along / longer + across;
    sum_of_logs += std::log(longer);
  });
  if (count < kMinObservations || !(plain_sum > 0.0)) return false;
  // Two coordinates each, of the mean that is most likely.
  return -sum_of_logs / count - 2.0 * std::log(sharp_sum / plain_sum) > kLeastEvidence;
}

BundleSupport SupportWithin(const BundleRound& round,
                            const BundleOptions& options,
                            BundleState state) {
  ClassifyAll(round, Placement::kNearby, options, state);
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(round);
  const Measure measure(state);
  std::vector<bool> frame_sees(state.frames.size(), false);
  BundleSupport support;
  ForEachUsedObservation(state, [&](const TrackState& track, const ObservationState& one) {
    if (track.kind != TrackKind::kPoint) return;
    ++support.num_observations;
    frame_sees[one.frame] = true;
    const double sigmas = measure.Residual(track, one);
    double rho[3] = {sigmas * sigmas, 1.0, 0.0};
    if (loss) loss->Evaluate(sigmas * sigmas, rho);
    support.cost += 0.5 * rho[0];
  });
  support.num_points = static_cast<int>(
      std::count_if(state.tracks.begin(), state.tracks.end(), [](const TrackState& track) {
        return track.kind == TrackKind::kPoint;
      }));
  support.num_frames = static_cast<int>(std::count(frame_sees.begin(), frame_sees.end(), true));
  return support;
}

ResidualStatistics Statistics(const BundleState& state) {
  const Measure measure(state);
  std::vector<double> errors_px;
  ForEachUsedObservation(state, [&](const TrackState& track, const ObservationState& one) {
    if (track.kind != TrackKind::kPoint) return;
    const auto error_px = measure.ErrorPx(track, one, track.position);
    errors_px.push_back(error_px ? error_px->norm() : kInfinity);
  });
  ResidualStatistics statistics;
  statistics.num_observations = static_cast<int>(errors_px.size());
  if (errors_px.empty()) return statistics;
  std::sort(errors_px.begin(), errors_px.end());
  double sum = 0.0;
  double squares = 0.0;
  for (const double error_px : errors_px) {
    sum += error_px;
    squares += error_px * error_px;
  }
  const double count = static_cast<double>(errors_px.size());
  statistics.mean_px = sum / count;
  statistics.rms_px = std::sqrt(squares / count);
  statistics.median_px = errors_px[errors_px.size() / 2];
  statistics.p90_px = errors_px[errors_px.size() * 9 / 10];
  return statistics;
}

}  // namespace rotslam
