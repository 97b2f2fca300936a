#include "rotodom/view_graph/zoom_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/median.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {
namespace {

constexpr int kLeastPoints = 60;
constexpr int kMostPoints = 300;
// Frames between those of a pair; less where edges do not reach as far.
constexpr int kMaxGap = 3;
// Natural logarithm of the ratio of focal lengths below which a pair shows no zoom.
constexpr double kMinLogRatio = 0.01;
// Of several pairs together.
constexpr double kMinLogRatioOfAll = 0.08;
constexpr double kMinSigmas = 5.0;

// A point's bearing in frame i, and its place on the plane z = 1 of frame j.
struct PointPair {
  Eigen::Vector3d bearing_i;
  Eigen::Vector2d in_j;
};

Eigen::Vector3d BearingWithout(const Eigen::Vector2d& in_j, double log_ratio) {
  return (in_j * std::exp(-log_ratio)).homogeneous().normalized();
}

std::vector<PointPair> PairsOf(const std::vector<SharedPoint>& points, const Camera& camera) {
  constexpr double kLeastDepth = 0.2;  // z of a unit bearing: no farther than 78 deg from the axis
  std::vector<PointPair> pairs;
  const std::size_t step = 1 + points.size() / kMostPoints;
  for (std::size_t k = 0; k < points.size(); k += step) {
    const auto& [i_px, j_px] = points[k];
    const auto i = camera.Unproject(i_px);
    const auto j = camera.Unproject(j_px);
    if (i && j && j->z() > kLeastDepth) pairs.push_back({*i, j->hnormalized()});
  }
  return pairs;
}

// Median share by which points move away from the principal point, beyond what rotation moves.
double ExpansionOf(const std::vector<PointPair>& pairs, const Rotation& j_from_i) {
  constexpr double kLeastRadius = 0.1;
  std::vector<double> shares;
  for (const PointPair& pair : pairs) {
    const Eigen::Vector3d rotated = j_from_i * pair.bearing_i;
    if (!(rotated.z() > 0.0)) continue;
    const Eigen::Vector2d from = rotated.hnormalized();
    if (from.norm() < kLeastRadius) continue;
    shares.push_back((pair.in_j - from).dot(from) / from.squaredNorm());
  }
  return Median(std::move(shares));
}

// A relative pose of two views of different focal lengths.
struct ZoomedPose {
  Rotation j_from_i;
  Eigen::Vector3d direction;  // of the translation, unit
  double log_ratio = 0.0;
};

using Update = Eigen::Matrix<double, 6, 1>;  // rotation (3), direction (2), logarithm of the ratio

ZoomedPose Moved(const ZoomedPose& pose, const Update& update) {
  const Eigen::Matrix<double, 3, 2> basis = TangentBasis(pose.direction);
  return {Rotation::Exp(update.head<3>()) * pose.j_from_i,
          (pose.direction + basis * update.segment<2>(3)).normalized(),
          pose.log_ratio + update[5]};
}

// Computes the residuals of a pose: sines of the angles between bearings and their epipolar planes.
class Residual {
 public:
  explicit Residual(const ZoomedPose& pose)
      : R_j_i_(pose.j_from_i.Matrix()),
        direction_(pose.direction),
        scale_(std::exp(-pose.log_ratio)) {}

  double Of(const PointPair& pair) const {
    const Eigen::Vector3d normal = direction_.cross(R_j_i_ * pair.bearing_i);
    const Eigen::Vector3d in_j = (scale_ * pair.in_j).homogeneous();
    return in_j.dot(normal) / (in_j.norm() * std::max(normal.norm(), 1e-6));
  }

 private:
  Eigen::Matrix3d R_j_i_;
  Eigen::Vector3d direction_;
  double scale_;
};

struct ZoomFit {
  ZoomedPose pose;
  double noise = 0.0;      // robust standard deviation of the residuals
  double log_sigma = 0.0;  // of log_ratio
  double cost = std::numeric_limits<double>::infinity();  // in squares of `unit`
};

// What the points tell about the ratio beyond what they need for the pose; the inverse square of
// its deviation in units of the noise.
double InformationOnRatio(const Eigen::Matrix<double, 6, 6>& normal) {
  constexpr double kLeast = 1e-12;
  const Eigen::Matrix<double, 5, 1> mixed = normal.topRightCorner<5, 1>();
  const Eigen::Matrix<double, 5, 1> of_pose =
      normal.topLeftCorner<5, 5>().completeOrthogonalDecomposition().solve(mixed);
  return std::max(kLeast, normal(5, 5) - mixed.dot(of_pose));
}

// Gauss-Newton with Geman-McClure's weights.
// @param unit         residual at which the weights fall off.
// @param frees_ratio  false: the ratio stays.
ZoomFit Refine(const std::vector<PointPair>& pairs,
               ZoomedPose pose,
               double unit,
               bool frees_ratio) {
  constexpr int kIterations = 8;
  constexpr double kStep = 1e-6;
  constexpr double kDamping = 1e-6;
  constexpr double kSmallUpdate = 1e-5;  // far below what the points tell
  const int size = frees_ratio ? 6 : 5;
  ZoomFit fit;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Update right = Update::Zero();
    double cost = 0.0;
    std::vector<double> magnitudes;
    magnitudes.reserve(pairs.size());
    const Residual here(pose);
    std::vector<Residual> moved;
    moved.reserve(size);
    for (int k = 0; k < size; ++k) moved.emplace_back(Moved(pose, kStep * Update::Unit(k)));
    for (const PointPair& pair : pairs) {
      const double residual = here.Of(pair);
      const double square = residual * residual / (unit * unit);
      const double weight = 1.0 / ((1.0 + square) * (1.0 + square));
      Update jacobian = Update::Zero();
      for (int k = 0; k < size; ++k) jacobian[k] = (moved[k].Of(pair) - residual) / kStep;
      normal += weight * jacobian * jacobian.transpose();
      right -= weight * residual * jacobian;
      cost += square / (1.0 + square);
      magnitudes.push_back(std::abs(residual));
    }
    fit.pose = pose;
    fit.cost = cost;
    fit.noise = kSigmasPerMedianDeviation * Median(std::move(magnitudes));
    const Eigen::MatrixXd used = normal.topLeftCorner(size, size);
    if (frees_ratio) fit.log_sigma = fit.noise / std::sqrt(InformationOnRatio(normal));
    const Eigen::LDLT<Eigen::MatrixXd> factors(used + kDamping * used.trace() *
                                                          Eigen::MatrixXd::Identity(size, size));
    Update update = Update::Zero();
    update.head(size) = factors.solve(right.head(size));
    if (update.norm() < kSmallUpdate) break;
    pose = Moved(pose, update);
  }
  return fit;
}

std::optional<RelativeRotationEstimate> EstimateWithout(double log_ratio,
                                                        const std::vector<PointPair>& pairs,
                                                        const RelativeRotation& edge,
                                                        const Camera& camera,
                                                        const RelativeRotationOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  std::vector<BearingPair> bearings;
  bearings.reserve(pairs.size());
  for (const PointPair& pair : pairs) {
    bearings.push_back({pair.bearing_i, BearingWithout(pair.in_j, log_ratio)});
  }
  return EstimateRelativeRotation({bearings}, edge.j_from_i, camera.MeanFocal(), options, kSeed);
}

// How many points a rotation explains once the expansion is taken out.
int NumRotated(const std::vector<PointPair>& pairs,
               const Rotation& j_from_i,
               double log_ratio,
               double tolerance) {
  return static_cast<int>(std::count_if(pairs.begin(), pairs.end(), [&](const PointPair& pair) {
    const Eigen::Vector3d off = BearingWithout(pair.in_j, log_ratio) - j_from_i * pair.bearing_i;
    return off.norm() < tolerance;
  }));
}

// The ratio of the focal lengths of an edge's frames.
struct LogRatio {
  double value = 0.0;          // natural logarithm; 0 in doubt
  bool may_be_a_wall = false;  // that fills the picture and comes nearer
};

LogRatio LogRatioOf(const RelativeRotation& edge,
                    const std::vector<PointPair>& pairs,
                    const Camera& camera,
                    const RelativeRotationOptions& options) {
  const double expansion = std::log1p(std::max(-0.5, ExpansionOf(pairs, edge.j_from_i)));
  if (std::abs(expansion) < kMinLogRatio) return {};
  constexpr double kUnitPx = 1.5;
  const double unit = kUnitPx / camera.MeanFocal();
  const auto is_settled = [](const ZoomFit& fit) {
    return std::isfinite(fit.cost) && kMinSigmas * fit.log_sigma < kMinLogRatio &&
           std::abs(fit.pose.log_ratio) < kMinLogRatio;
  };
  // Most edges are right, and their focal lengths the same: some of the points tell.
  constexpr std::size_t kStep = 3;
  std::vector<PointPair> some;
  for (std::size_t k = 0; k < pairs.size(); k += kStep) some.push_back(pairs[k]);
  if (!edge.translation_direction.isZero() &&
      is_settled(Refine(some, {edge.j_from_i, edge.translation_direction, 0.0}, unit, true))) {
    return {};
  }
  const auto plain = EstimateWithout(0.0, pairs, edge, camera, options);
  ZoomFit best;
  ZoomFit from_plain;
  const auto refine = [&](const std::optional<RelativeRotationEstimate>& estimate,
                          double log_ratio) {
    if (!estimate || estimate->translation_direction.isZero()) return;
    const ZoomedPose start = {estimate->j_from_i, estimate->translation_direction, log_ratio};
    const ZoomFit fit = Refine(pairs, start, unit, true);
    if (log_ratio == 0.0) from_plain = fit;
    // A zoom is part of the expansion; the rest comes from moving ahead or back.
    constexpr double kMaxPart = 1.5;
    const double part = fit.pose.log_ratio / expansion;
    if (part > 0.0 && part < kMaxPart && fit.cost < best.cost) best = fit;
  };
  refine(plain, 0.0);
  if (is_settled(from_plain)) return {};

  const auto without = EstimateWithout(expansion, pairs, edge, camera, options);
  if (!without) return {};
  constexpr double kAsMany = 0.9;
  constexpr double kTolerancePx = 1.0;
  const double num_plain = plain ? static_cast<double>(plain->inliers.size()) : 0.0;
  const double tolerance = kTolerancePx / camera.MeanFocal();
  if (NumRotated(pairs, without->j_from_i, expansion, tolerance) >= kAsMany * num_plain) {
    return {expansion, true};
  }
  refine(EstimateWithout(0.5 * expansion, pairs, edge, camera, options), 0.5 * expansion);
  refine(without, expansion);
  const double log_ratio = best.pose.log_ratio;
  if (std::abs(log_ratio) < std::max(kMinLogRatio, kMinSigmas * best.log_sigma)) return {};
  // The points must need it, too, in squares of their noise.
  if (!plain || plain->translation_direction.isZero()) return LogRatio{log_ratio};
  const ZoomedPose start = {plain->j_from_i, plain->translation_direction, 0.0};
  const ZoomFit fixed = Refine(pairs, start, unit, false);
  const double gain = (fixed.cost - best.cost) * unit * unit / (best.noise * best.noise + 1e-18);
  return gain > kMinSigmas * kMinSigmas ? LogRatio{log_ratio} : LogRatio{};
}

// The edge to `frame` from kMaxGap frames before it, or the next ones; null: none.
const RelativeRotation* EdgeTo(FrameId frame, const ViewGraph& graph) {
  const RelativeRotation* earliest = nullptr;
  for (const int position : graph.EdgesOf(frame)) {
    const RelativeRotation& edge = graph.edges()[position];
    if (edge.j != frame || frame.value - edge.i.value > kMaxGap) continue;
    if (earliest == nullptr || edge.i < earliest->i) earliest = &edge;
  }
  return earliest;
}

}  // namespace

std::vector<Zoom> FindZooms(const Camera& camera,
                            const std::map<FrameId, Features>& features,
                            const ViewGraph& graph,
                            const RelativeRotationOptions& options) {
  struct Step {
    const RelativeRotation* edge;
    LogRatio log_ratio;
  };
  std::vector<Step> steps;
  Camera zoomed = camera;
  for (const auto& [frame, of_frame] : features) {
    const RelativeRotation* edge = EdgeTo(frame, graph);
    // Steps follow one another: the next one begins where the last one ended, or later.
    if (edge == nullptr || (!steps.empty() && edge->i < steps.back().edge->j)) continue;
    const auto of_first = features.find(edge->i);
    if (of_first == features.end()) continue;
    const auto pairs = PairsOf(SharedPoints(of_first->second, of_frame), zoomed);
    LogRatio log_ratio;
    if (std::ssize(pairs) >= kLeastPoints) log_ratio = LogRatioOf(*edge, pairs, zoomed, options);
    steps.push_back({edge, log_ratio});
    zoomed.fx *= std::exp(log_ratio.value);
    zoomed.fy *= std::exp(log_ratio.value);
  }

  std::vector<Zoom> zooms;
  for (auto first = steps.begin(); first != steps.end();) {
    const auto goes_on = [&](const Step& step) {
      return step.log_ratio.value * first->log_ratio.value > 0.0;
    };
    const auto end = std::find_if_not(std::next(first), steps.end(), goes_on);
    double log_factor = 0.0;
    bool may_be_a_wall = false;
    for (auto step = first; step != end; ++step) {
      log_factor += step->log_ratio.value;
      may_be_a_wall = may_be_a_wall || step->log_ratio.may_be_a_wall;
    }
    // A camera that only rotates before and after approaches no wall in between.
    const bool rests_before = first == steps.begin() || std::prev(first)->edge->rotation_only;
    const bool rests_after = end == steps.end() || end->edge->rotation_only;
    // Lenses take longer than one step; a single one is a pair that went wrong.
    const bool lasts = std::distance(first, end) > 1;
    const bool is_zoom = lasts && (!may_be_a_wall || (rests_before && rests_after));
    if (is_zoom && std::abs(log_factor) > kMinLogRatioOfAll) {
      zooms.push_back({first->edge->i, std::prev(end)->edge->j, std::exp(log_factor)});
    }
    first = end;
  }
  return zooms;
}

}  // namespace rotslam
