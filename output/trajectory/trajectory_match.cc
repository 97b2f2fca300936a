#include "output/trajectory/trajectory_match.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Dense>

#include "rotodom/types/median.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// Below this, noise decides between readings.
constexpr double kMinDisagreementDeg = 0.3;
// How many times better another reading must fit before it is believed.
constexpr double kClearlyBetter = 5.0;
// Relative rotations are taken over as many poses as turn by this.
constexpr double kEnoughRotationDeg = 5.0;
constexpr std::size_t kMaxSamples = 2000;

// How a file's poses may be meant.
struct Reading {
  bool truth_order = false;  // the other order of the quaternion
  bool estimate_order = false;
  bool truth_inverse = false;  // world->camera
  bool estimate_inverse = false;
};

// q_w first taken for q_w last, undone; the reverse turns the other way.
Rotation InOtherOrder(const Rotation& world_from_cam, bool was_read_w_last) {
  const Eigen::Vector4d q = world_from_cam.Quaternion().coeffs();
  return was_read_w_last ? Rotation(Eigen::Quaterniond(q[0], q[1], q[2], q[3]))
                         : Rotation(Eigen::Quaterniond(q[2], q[3], q[0], q[1]));
}

StampedPose Read(const StampedPose& pose, bool order, bool was_read_w_last, bool inverse) {
  StampedPose read = pose;
  if (order) read.world_from_cam = InOtherOrder(read.world_from_cam, was_read_w_last);
  if (inverse) {
    read.world_from_cam = read.world_from_cam.Inverse();
    read.center_in_world = -(read.world_from_cam * pose.center_in_world);
  }
  return read;
}

bool IsReadWithWLast(const TrajectoryFile& file) { return file.form != "EuRoC"; }

std::vector<PosePair> ReadPairs(const std::vector<PosePair>& pairs,
                                const Reading& reading,
                                bool truth_w_last,
                                bool estimate_w_last) {
  std::vector<PosePair> read;
  read.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    read.push_back(
        {Read(pair.ground_truth, reading.truth_order, truth_w_last, reading.truth_inverse),
         Read(pair.estimate, reading.estimate_order, estimate_w_last, reading.estimate_inverse)});
  }
  return read;
}

struct RelativePair {
  Rotation truth;
  Rotation estimate;
};

std::vector<RelativePair> RelativePairs(const std::vector<PosePair>& pairs, std::size_t step) {
  std::vector<RelativePair> relative;
  if (pairs.size() <= step) return relative;
  const std::size_t count = pairs.size() - step;
  const std::size_t stride = count / kMaxSamples + 1;
  for (std::size_t k = 0; k < count; k += stride) {
    const PosePair& a = pairs[k];
    const PosePair& b = pairs[k + step];
    relative.push_back({a.ground_truth.world_from_cam.Inverse() * b.ground_truth.world_from_cam,
                        a.estimate.world_from_cam.Inverse() * b.estimate.world_from_cam});
  }
  return relative;
}

double MedianTurnDeg(const std::vector<PosePair>& pairs, std::size_t step) {
  std::vector<double> angles;
  for (const RelativePair& pair : RelativePairs(pairs, step))
    angles.push_back(pair.truth.AngleDeg());
  return Median(std::move(angles));
}

// The fewest poses over which the camera turns enough, or those over which it turns most.
std::size_t StepWithRotation(const std::vector<PosePair>& pairs) {
  std::size_t best = 1;
  double largest_deg = -1.0;
  for (std::size_t step = 1; step <= std::max<std::size_t>(1, pairs.size() / 2); step *= 2) {
    const double turn_deg = MedianTurnDeg(pairs, step);
    if (turn_deg > largest_deg) {
      largest_deg = turn_deg;
      best = step;
    }
    if (turn_deg >= kEnoughRotationDeg) break;
  }
  return best;
}

double ResidualDeg(const std::vector<PosePair>& pairs, std::size_t step) {
  std::vector<double> errors;
  for (const RelativePair& pair : RelativePairs(pairs, step)) {
    errors.push_back((pair.truth.Inverse() * pair.estimate).AngleDeg());
  }
  return Median(std::move(errors));
}

Rotation WeightedAlignment(const std::vector<Eigen::Vector3d>& to,
                           const std::vector<Eigen::Vector3d>& from,
                           const Eigen::VectorXd& weights) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < to.size(); ++k) {
    sum += weights[static_cast<Eigen::Index>(k)] * to[k] * from[k].transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs.z() = -1.0;
  return Rotation::FromMatrix(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose());
}

// Cauchy's, the scale being twice the median error.
Eigen::VectorXd RobustWeights(const std::vector<Eigen::Vector3d>& to,
                              const std::vector<Eigen::Vector3d>& from,
                              const Rotation& rotation) {
  std::vector<double> errors;
  errors.reserve(to.size());
  for (std::size_t k = 0; k < to.size(); ++k) errors.push_back((to[k] - rotation * from[k]).norm());
  const double scale = std::max(2.0 * Median(errors), 1e-9);
  const Eigen::Map<const Eigen::ArrayXd> all(errors.data(), static_cast<Eigen::Index>(to.size()));
  return (1.0 + (all / scale).square()).inverse().matrix();
}

bool AreNumbers(const TrajectoryFile& file) {
  if (!file.has_times) return true;
  const Trajectory& poses = file.poses;
  const double first = poses.front().timestamp_s;
  if (first != 0.0 && first != 1.0) return false;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    if (poses[k].timestamp_s != first + static_cast<double>(k)) return false;
  }
  return true;
}

std::string Times(const Trajectory& poses) {
  return FormatNumber("%.3f", poses.front().timestamp_s) + " to " +
         FormatNumber("%.3f", poses.back().timestamp_s) + " s";
}

bool Overlap(const Trajectory& a, const Trajectory& b) {
  return a.front().timestamp_s <= b.back().timestamp_s &&
         b.front().timestamp_s <= a.back().timestamp_s;
}

[[noreturn]] void FailToPair(const NamedTrajectory& truth,
                             const NamedTrajectory& estimate,
                             const Trajectory& shifted,
                             std::size_t num_pairs,
                             const MatchOptions& options) {
  const Trajectory& poses = truth.file.poses;
  const std::string count =
      "only " + std::to_string(num_pairs) + " of " + std::to_string(shifted.size()) + " poses ";
  // The file in front is the one in doubt.
  std::string reason =
      options.is_estimate_known
          ? truth.name + ": " + count + "of " + estimate.name + " have ground truth in it: "
          : estimate.name + ": " + count + "have ground truth in " + truth.name + ": ";
  const bool truth_is_numbered = AreNumbers(truth.file);
  const bool estimate_is_numbered = AreNumbers(estimate.file);
  if (truth_is_numbered != estimate_is_numbered) {
    const NamedTrajectory& numbered = truth_is_numbered ? truth : estimate;
    reason += numbered.name + " has numbers of poses in place of times, " +
              std::to_string(numbered.file.poses.size()) + " against " +
              std::to_string((truth_is_numbered ? shifted : poses).size()) +
              ": give the times of its poses with --times FILE, one a line";
  } else if (!Overlap(poses, shifted)) {
    const double apart_s = poses.front().timestamp_s - shifted.front().timestamp_s;
    reason += "the times do not overlap, truth " + Times(poses) + ", estimate " + Times(shifted) +
              ", starts " + FormatNumber("%.3f", std::abs(apart_s)) + " s apart: --time-offset " +
              FormatNumber("%.9g", apart_s) + " would move the estimate there";
  } else {
    reason +=
        "do the timestamps agree? KITTI files take theirs from --times; --max-gap interpolates "
        "gaps in the ground truth";
  }
  throw std::runtime_error(reason);
}

// Poses with numbers in place of times take the times of the others, one by one.
bool TakeTimesInOrder(Trajectory& numbered, const Trajectory& timed) {
  if (numbered.size() != timed.size()) return false;
  for (std::size_t k = 0; k < timed.size(); ++k) numbered[k].timestamp_s = timed[k].timestamp_s;
  return true;
}

struct PositionFit {
  double error = 1.0;  // as a share of the path
  double path = 0.0;
};

PositionFit FitOfPositions(const std::vector<PosePair>& pairs) {
  std::vector<PosePair> some;
  const std::size_t stride = pairs.size() / 300 + 1;
  for (std::size_t k = 0; k < pairs.size(); k += stride) some.push_back(pairs[k]);
  const TrajectoryMetrics metrics = ComputeMetrics(some.size() < 3 ? pairs : some, {});
  if (!metrics.ate_m || !(metrics.path_length_m > 0.0)) return {1.0, metrics.path_length_m};
  return {*metrics.ate_m / metrics.path_length_m, metrics.path_length_m};
}

// A path of camera centres is shorter than that of a world's origin seen from a camera that turns.
bool PositionsFitBetter(const std::vector<PosePair>& a, const std::vector<PosePair>& b) {
  constexpr double kClearlyNearer = 3.0;
  const PositionFit fit_a = FitOfPositions(a);
  const PositionFit fit_b = FitOfPositions(b);
  if (kClearlyNearer * fit_a.error < fit_b.error) return true;
  if (kClearlyNearer * fit_b.error < fit_a.error) return false;
  return fit_a.path < fit_b.path;
}

// One file is read in another way at a time: both the other way round would be the same as another
// choice of axes and world.
std::vector<Reading> OtherReadings(const TrajectoryFile& truth,
                                   const TrajectoryFile& estimate,
                                   const MatchOptions& options) {
  std::vector<Reading> readings = {{false, false, true, false}};
  if (!options.is_estimate_known) readings.push_back({false, false, false, true});
  if (truth.is_order_assumed) {
    readings.push_back({true, false, false, false});
    readings.push_back({true, false, true, false});
  }
  if (estimate.is_order_assumed) {
    readings.push_back({false, true, false, false});
    readings.push_back({false, true, false, true});
  }
  return readings;
}

struct Candidate {
  Reading reading;
  std::vector<PosePair> pairs;
  double residual_deg = 0.0;
};

std::string Describe(const Reading& reading,
                     const NamedTrajectory& truth,
                     const NamedTrajectory& estimate) {
  std::string text;
  const auto add = [&](const NamedTrajectory& named, bool order, bool inverse) {
    if (!order && !inverse) return;
    if (!text.empty()) text += ", ";
    text += named.name + " is taken for ";
    if (inverse) text += "world->camera";
    if (order && inverse) text += " with ";
    if (order) text += IsReadWithWLast(named.file) ? "qw first" : "qw last";
  };
  add(truth, reading.truth_order, reading.truth_inverse);
  add(estimate, reading.estimate_order, reading.estimate_inverse);
  return text;
}

std::string AxesText(const Rotation& rotation) {
  const Eigen::Vector3d v = rotation.Log();
  const Eigen::Vector3d axis = v.norm() > 0.0 ? Eigen::Vector3d(v.normalized()) : v;
  return FormatNumber("%.2f", rotation.AngleDeg()) + " deg about (" +
         FormatNumber("%.3f", axis.x()) + ", " + FormatNumber("%.3f", axis.y()) + ", " +
         FormatNumber("%.3f", axis.z()) + ")";
}

class TrajectoryMatcher {
 public:
  TrajectoryMatcher(const NamedTrajectory& truth,
                    const NamedTrajectory& estimate,
                    const MatchOptions& options)
      : truth_(truth),
        estimate_(estimate),
        options_(options),
        truth_w_last_(IsReadWithWLast(truth.file)),
        estimate_w_last_(IsReadWithWLast(estimate.file)) {}

  MatchedTrajectories Match() {
    PairInTime();
    step_ = StepWithRotation(matched_.pairs);
    turn_deg_ = MedianTurnDeg(matched_.pairs, step_);
    as_is_deg_ = ResidualDeg(matched_.pairs, step_);
    if (as_is_deg_ < kMinDisagreementDeg && !options_.align_axes) return std::move(matched_);
    const std::optional<Candidate> best = BestReading();
    const std::optional<AxesFit> axes = FitAxes(matched_.pairs, step_);
    if (best && axes) {
      TakeReading(*best);
    } else if (best) {
      Note("relative rotations differ by " + AsIsText() + " and fit if " + TextOf(best->reading) +
           ", but they have one axis alone, which cannot tell that from other axes of the camera: "
           "nothing is changed");
    } else if (axes) {
      CompareAxes(*axes);
    } else if (options_.align_axes) {
      throw std::runtime_error(
          truth_.name +
          ": its rotations have one axis alone, from which --align-axes cannot "
          "find the rotation between the axes; leave it out");
    }
    return std::move(matched_);
  }

 private:
  void Note(const std::string& note) { matched_.notes.push_back(note); }
  void Associate() {
    matched_.pairs = AssociatePoses(matched_.ground_truth, matched_.estimate, options_.metrics);
  }
  std::string TextOf(const Reading& reading) const { return Describe(reading, truth_, estimate_); }
  std::string AsIsText() const {
    return FormatNumber("%.3g", as_is_deg_) + " deg as the files stand (median over " +
           std::to_string(step_) + (step_ == 1 ? " pose)" : " poses)");
  }
  bool IsFarBetter(double residual_deg) const {
    return kClearlyBetter * residual_deg < as_is_deg_ && kClearlyBetter * residual_deg < turn_deg_;
  }
  std::vector<PosePair> ReadAs(const Reading& reading) const {
    return ReadPairs(matched_.pairs, reading, truth_w_last_, estimate_w_last_);
  }

  // Pairs the poses by their times or, where one file has none, in their order.
  void PairInTime() {
    matched_.ground_truth = truth_.file.poses;
    matched_.estimate = estimate_.file.poses;
    for (const NamedTrajectory* named : {&truth_, &estimate_}) {
      for (const std::string& note : named->file.notes) Note(named->name + ": " + note);
    }
    for (StampedPose& pose : matched_.estimate) pose.timestamp_s += options_.time_offset_s;
    Associate();
    const bool truth_is_numbered = AreNumbers(truth_.file);
    if (matched_.pairs.size() < 3 && truth_is_numbered != AreNumbers(estimate_.file)) {
      const bool has_taken = truth_is_numbered || options_.is_estimate_known
                                 ? TakeTimesInOrder(matched_.ground_truth, matched_.estimate)
                                 : TakeTimesInOrder(matched_.estimate, matched_.ground_truth);
      if (has_taken) {
        Note((truth_is_numbered ? truth_ : estimate_).name + " has no times; both have " +
             std::to_string(matched_.estimate.size()) + " poses, which are paired in their order");
        Associate();
      }
    }
    if (matched_.pairs.size() < 3) {
      FailToPair(truth_, estimate_, matched_.estimate, matched_.pairs.size(), options_);
    }
  }

  // The other reading that fits best; nullopt where none is far better than the files as they
  // stand.
  std::optional<Candidate> BestReading() const {
    std::vector<Candidate> candidates;
    for (const Reading& reading : OtherReadings(truth_.file, estimate_.file, options_)) {
      Candidate candidate{reading, ReadAs(reading), 0.0};
      candidate.residual_deg = ResidualDeg(candidate.pairs, step_);
      if (IsFarBetter(candidate.residual_deg)) candidates.push_back(std::move(candidate));
    }
    if (candidates.empty()) return std::nullopt;
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.residual_deg < b.residual_deg;
    });
    // Readings that fit alike are the inverse of one file or the other; the positions choose.
    while (candidates.back().residual_deg > 2.0 * candidates.front().residual_deg + 0.05) {
      candidates.pop_back();
    }
    return *std::min_element(
        candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
          return PositionsFitBetter(a.pairs, b.pairs);
        });
  }

  void TakeReading(const Candidate& best) {
    const Reading& reading = best.reading;
    const std::string residual =
        FormatNumber("%.3g", best.residual_deg) + " deg instead of " + AsIsText();
    if (options_.as_is) {
      Note("relative rotations fit far better if " + TextOf(reading) + ": " + residual);
      return;
    }
    Note(TextOf(reading) + ": relative rotations then differ by " + residual +
         "; --as-is leaves it");
    for (StampedPose& pose : matched_.ground_truth) {
      pose = Read(pose, reading.truth_order, truth_w_last_, reading.truth_inverse);
    }
    for (StampedPose& pose : matched_.estimate) {
      pose = Read(pose, reading.estimate_order, estimate_w_last_, reading.estimate_inverse);
    }
    Associate();
  }

  // Takes a constant rotation between the axes out, or tells of it.
  void CompareAxes(const AxesFit& axes) {
    const Rotation& X = axes.truth_axes_from_estimate_axes;
    const std::string turned =
        "the estimate's axes are those of the truth turned by " + AxesText(X);
    if (options_.align_axes) {
      for (StampedPose& pose : matched_.ground_truth) pose.world_from_cam = pose.world_from_cam * X;
      Associate();
      Note(turned + ", which is taken out");
      return;
    }
    if (IsFarBetter(axes.residual_deg)) {
      Note(turned + ": relative rotations differ by " + AsIsText() + ", by " +
           FormatNumber("%.3g", axes.residual_deg) + " deg without it; --align-axes takes it out");
      return;
    }
    // The inverse of one of them with other axes, or qw in the other place.
    for (const Reading& reading : OtherReadings(truth_.file, estimate_.file, options_)) {
      const auto fit = FitAxes(ReadAs(reading), step_);
      if (!fit || !IsFarBetter(fit->residual_deg)) continue;
      Note("relative rotations differ by " + AsIsText() + ", by " +
           FormatNumber("%.3g", fit->residual_deg) + " deg if " + TextOf(reading) +
           " and its axes are turned by " + AxesText(fit->truth_axes_from_estimate_axes) +
           ": expected are camera->world poses with qx qy qz qw");
      return;
    }
  }

  const NamedTrajectory& truth_;
  const NamedTrajectory& estimate_;
  const MatchOptions& options_;
  const bool truth_w_last_;
  const bool estimate_w_last_;
  MatchedTrajectories matched_;
  std::size_t step_ = 1;    // poses between which relative rotations are taken
  double turn_deg_ = 0.0;   // median of these rotations
  double as_is_deg_ = 0.0;  // median of their differences, as the files stand
};

}  // namespace

std::optional<AxesFit> FitAxes(const std::vector<PosePair>& pairs, std::size_t step) {
  // Where a rotation vector's sign flips.
  constexpr double kLargestAngle = 3.0;
  constexpr double kSmallestSpread = 1e-3;
  constexpr int kNumIterations = 20;
  const std::vector<RelativePair> relative = RelativePairs(pairs, step);
  std::vector<Eigen::Vector3d> to;
  std::vector<Eigen::Vector3d> from;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const RelativePair& pair : relative) {
    if (pair.truth.Angle() > kLargestAngle || pair.estimate.Angle() > kLargestAngle) continue;
    to.push_back(pair.truth.Log());
    from.push_back(pair.estimate.Log());
    spread += to.back() * to.back().transpose();
  }
  if (to.size() < 3) return std::nullopt;
  const Eigen::Vector3d eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  if (!(eigenvalues[1] > kSmallestSpread * eigenvalues[2])) return std::nullopt;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(to.size()));
  AxesFit fit;
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    fit.truth_axes_from_estimate_axes = WeightedAlignment(to, from, weights);
    weights = RobustWeights(to, from, fit.truth_axes_from_estimate_axes);
  }
  std::vector<double> angles;
  angles.reserve(relative.size());
  const Rotation& X = fit.truth_axes_from_estimate_axes;
  for (const RelativePair& pair : relative) {
    angles.push_back(((pair.truth * X).Inverse() * (X * pair.estimate)).AngleDeg());
  }
  fit.residual_deg = Median(angles);
  return fit;
}

MatchedTrajectories MatchTrajectories(const NamedTrajectory& truth,
                                      const NamedTrajectory& estimate,
                                      const MatchOptions& options) {
  return TrajectoryMatcher(truth, estimate, options).Match();
}

}  // namespace rotslam
