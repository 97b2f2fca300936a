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

#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/median.h"
#include "rotodom/view_graph/shared_points.h"

namespace rotslam {
namespace {

constexpr int kLeastPoints = 40;
constexpr int kMostPoints = 300;
// Frames between those of a pair; less where edges do not reach as far.
constexpr int kMaxGap = 3;
// Natural logarithms of ratios of focal lengths: of a pair, below which it shows no zoom; without
// one, real cameras show up to 0.0075.
constexpr double kMinLogRatio = 0.006;
// The same in the mean of a zoom's pairs.
constexpr double kMinMeanLogRatio = 0.01;
// Of a pair; lenses are slower.
constexpr double kMaxLogRatio = 0.3;
// Of all pairs: farther than any lens reaches.
constexpr double kMaxLogRatioOfAll = 2.5;
// Deviations from zero of a pair, and of a zoom.
constexpr double kMinSigmas = 3.0;
constexpr double kMinSigmasOfAll = 6.0;
// Deviation of a pair's ratio beyond which it says nothing, and the least that is believed.
constexpr double kMaxLogSigma = 0.02;
constexpr double kLeastLogSigma = 0.001;
// Deviation per radian by which the camera rotates within a pair: what a calibration leaves of the
// lens, blur and rolling shutters look like zooms where the picture moves far (TUM fr1_rpy).
constexpr double kLogSigmaPerRad = 0.05;

// A point's places on the planes z = 1 of three frames, as a camera without zoom would have them
// but for the last one, where the zoom from j to k is left in.
struct Triple {
  Eigen::Vector2d in_i;
  Eigen::Vector2d in_j;
  Eigen::Vector2d in_k;
};

struct ThreeViews {
  const Features& i;
  const Features& j;
  const Features& k;
  // Natural logarithms of the focal lengths of i and j over the calibrated one.
  double log_focal_i = 0.0;
  double log_focal_j = 0.0;
};

std::optional<Eigen::Vector2d> OnPlane(const Eigen::Vector2d& keypoint_px,
                                       double log_focal,
                                       const Camera& camera) {
  constexpr double kLeastDepth = 0.2;  // z of a unit bearing: no farther than 78 deg from the axis
  const auto bearing = camera.Unproject(keypoint_px);
  if (!bearing || bearing->z() < kLeastDepth) return std::nullopt;
  return bearing->hnormalized() * std::exp(-log_focal);
}

std::vector<Triple> TriplesOf(const ThreeViews& views, const Camera& camera) {
  const auto i_to_j = FindCommonPoints(views.i, views.j);
  const auto j_to_k = FindCommonPoints(views.j, views.k);
  std::vector<int> from_j(views.j.keypoints_px.size(), -1);  // positions in i
  for (const auto& [in_i, in_j] : i_to_j) from_j[in_j] = in_i;
  std::vector<std::array<int, 3>> common;
  for (const auto& [in_j, in_k] : j_to_k) {
    if (from_j[in_j] >= 0) common.push_back({from_j[in_j], in_j, in_k});
  }
  std::vector<Triple> triples;
  const std::size_t step = 1 + common.size() / kMostPoints;
  for (std::size_t n = 0; n < common.size(); n += step) {
    const auto& [in_i, in_j, in_k] = common[n];
    const auto i = OnPlane(views.i.keypoints_px[in_i], views.log_focal_i, camera);
    const auto j = OnPlane(views.j.keypoints_px[in_j], views.log_focal_j, camera);
    const auto k = OnPlane(views.k.keypoints_px[in_k], views.log_focal_j, camera);
    if (i && j && k) triples.push_back({*i, *j, *k});
  }
  return triples;
}

// A relative pose up to scale.
struct DirectedPose {
  Rotation j_from_i;
  Eigen::Vector3d direction;  // of the translation, unit; zero: none
};

std::optional<DirectedPose> EstimatePose(const std::vector<BearingPair>& pairs,
                                         const Rotation& start,
                                         const Camera& camera,
                                         const RelativeRotationOptions& options) {
  constexpr std::uint64_t kSeed = 1;
  const auto estimate =
      EstimateRelativeRotation({pairs}, start, camera.MeanFocal(), options, kSeed);
  if (!estimate) return std::nullopt;
  return DirectedPose{estimate->j_from_i, estimate->translation_direction};
}

// A scene point in camera j, in units of the way from i to j, and its place in frame k.
struct PlacedPoint {
  Eigen::Vector3d in_cam_j;
  Eigen::Vector2d in_k;
};

// Points with little parallax between i and j have no depth and are left out.
std::vector<PlacedPoint> PlacePoints(const std::vector<Triple>& triples,
                                     const DirectedPose& pose,
                                     double min_parallax) {
  constexpr double kLeastOfMedian = 0.3;
  std::vector<double> parallaxes;
  parallaxes.reserve(triples.size());
  for (const Triple& triple : triples) {
    const Eigen::Vector3d ray_i = pose.j_from_i * triple.in_i.homogeneous().normalized();
    parallaxes.push_back(ray_i.cross(triple.in_j.homogeneous().normalized()).norm());
  }
  const double least = std::max(min_parallax, kLeastOfMedian * Median(parallaxes));
  std::vector<PlacedPoint> points;
  for (std::size_t n = 0; n < triples.size(); ++n) {
    if (parallaxes[n] < least) continue;
    // depth * ray_j = (depth in i) * ray_i + direction, in camera j
    const Eigen::Vector3d ray_j = triples[n].in_j.homogeneous();
    const Eigen::Vector3d ray_i = pose.j_from_i * triples[n].in_i.homogeneous();
    const Eigen::Vector3d normal = ray_i.cross(ray_j);
    const double depth = ray_i.cross(pose.direction).dot(normal) / normal.squaredNorm();
    if (depth > 0.0) points.push_back({depth * ray_j, triples[n].in_k});
  }
  return points;
}

// Camera k against camera j, and the ratio of their focal lengths.
struct ZoomedPose {
  Rotation k_from_j;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double log_ratio = 0.0;
};

// The translation of camera k by linear least squares, the rest of the pose as it is.
Eigen::Vector3d TranslationBy(const std::vector<PlacedPoint>& points, const Rotation& k_from_j) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const PlacedPoint& point : points) {
    // The point's ray in k passes it: both components of what is perpendicular to it are zero.
    const Eigen::Vector3d ray = point.in_k.homogeneous().normalized();
    const Eigen::Matrix3d across =
        (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / point.in_cam_j.squaredNorm();
    normal += across;
    right -= across * (k_from_j * point.in_cam_j);
  }
  return normal.ldlt().solve(right);
}

// The ratio of the focal lengths of a pair's frames.
struct LogRatio {
  double value = 0.0;  // natural logarithm
  double sigma = std::numeric_limits<double>::infinity();
  bool may_be_a_wall = false;  // that fills the picture and comes nearer

  bool IsKnown() const { return std::isfinite(sigma); }
  bool ShowsZoom() const {
    return IsKnown() && std::abs(value) > std::max(kMinLogRatio, kMinSigmas * sigma);
  }
};

// Resects camera k together with its focal length: Gauss-Newton with Geman-McClure's weights.
// @param pixel  on the plane z = 1.
LogRatio Resect(const std::vector<PlacedPoint>& points, const Rotation& k_from_j, double pixel) {
  constexpr int kIterations = 12;
  constexpr double kSmallUpdate = 1e-5;  // far below what the points tell
  constexpr double kLargeNoisePx = 1.0;
  using Normal = Eigen::Matrix<double, 7, 7>;  // rotation, translation, logarithm of the ratio
  using Update = Eigen::Matrix<double, 7, 1>;
  ZoomedPose pose = {k_from_j, TranslationBy(points, k_from_j)};
  double noise = 0.0;
  Normal normal = Normal::Zero();
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double scale = std::exp(pose.log_ratio);
    std::vector<double> distances;
    distances.reserve(points.size());
    for (const PlacedPoint& point : points) {
      const Eigen::Vector3d in_cam_k = pose.k_from_j * point.in_cam_j + pose.translation;
      distances.push_back((point.in_k - scale * in_cam_k.hnormalized()).norm());
    }
    // The median of a distance in the plane is 1.18 of the deviation along an axis.
    noise = std::max(Median(distances) / 1.18, 0.05 * pixel);
    normal = Normal::Zero();
    Update right = Update::Zero();
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Eigen::Vector3d rotated = pose.k_from_j * points[n].in_cam_j;
      const Eigen::Vector3d in_cam_k = rotated + pose.translation;
      if (!(in_cam_k.z() > 0.0)) continue;
      const Eigen::Vector2d place = scale * in_cam_k.hnormalized();
      const double square = distances[n] * distances[n] / (9.0 * noise * noise);
      const double weight = 1.0 / ((1.0 + square) * (1.0 + square));
      Eigen::Matrix<double, 2, 3> by_point;
      by_point << scale, 0.0, -place.x(), 0.0, scale, -place.y();
      by_point /= in_cam_k.z();
      Eigen::Matrix<double, 2, 7> jacobian;
      for (int axis = 0; axis < 3; ++axis) {
        jacobian.col(axis) = by_point * Eigen::Vector3d::Unit(axis).cross(rotated);
      }
      jacobian.middleCols<3>(3) = by_point;
      jacobian.col(6) = place;
      normal += weight * jacobian.transpose() * jacobian;
      right += weight * jacobian.transpose() * (points[n].in_k - place);
    }
    const Eigen::LDLT<Normal> factors(normal + 1e-12 * normal.trace() * Normal::Identity());
    const Update update = factors.solve(right);
    pose.k_from_j = Rotation::Exp(update.head<3>()) * pose.k_from_j;
    pose.translation += update.segment<3>(3);
    pose.log_ratio += update[6];
    if (!(std::abs(pose.log_ratio) < kMaxLogRatioOfAll)) return {};
    if (update.norm() < kSmallUpdate) break;
  }
  const double variance = normal.ldlt().solve(Update::Unit(6))[6];
  const double sigma = noise * std::sqrt(std::max(variance, 0.0));
  if (!(sigma < kMaxLogSigma) || noise > kLargeNoisePx * pixel) return {};
  return {pose.log_ratio, std::hypot(sigma, kLeastLogSigma)};
}

// A pair of frames that tells how far away points are, before a zoom or as late as it has to be.
// A frame k is resected by them.
struct Anchor {
  const RelativeRotation* edge = nullptr;  // from i to j
  const Features* i = nullptr;
  const Features* j = nullptr;
  // Natural logarithms of the focal lengths of i and j over the calibrated one.
  double log_focal_i = 0.0;
  double log_focal_j = 0.0;
  Rotation newest_from_j;  // to the frame before k
};

Anchor AnchorOf(const RelativeRotation& edge,
                const std::map<FrameId, Features>& features,
                double log_focal_i,
                double log_focal_j) {
  return {&edge, &features.at(edge.i), &features.at(edge.j), log_focal_i, log_focal_j, Rotation()};
}

int GapOf(const RelativeRotation& edge) { return edge.j.value - edge.i.value; }

// @param edge       to frame k from the one before it.
// @param log_focal  of the frame before k.
// Six parameters: three views as two callers know them, the camera and the options.
LogRatio ByAnchor(const Anchor& anchor,
                  const Features& k,
                  const RelativeRotation& edge,
                  double log_focal,
                  const Camera& camera,
                  const RelativeRotationOptions& options) {
  // By the very first frames, which are close together, depths are too uncertain.
  if (2 * GapOf(*anchor.edge) < GapOf(edge)) return {};
  const ThreeViews views = {*anchor.i, *anchor.j, k, anchor.log_focal_i, anchor.log_focal_j};
  const std::vector<Triple> triples = TriplesOf(views, camera);
  if (std::ssize(triples) < kLeastPoints) return {};
  DirectedPose pose = {anchor.edge->j_from_i, anchor.edge->translation_direction};
  // The odometry knows of no zoom.
  if (anchor.log_focal_i != 0.0 || anchor.log_focal_j != 0.0) {
    std::vector<BearingPair> pairs;
    pairs.reserve(triples.size());
    for (const Triple& triple : triples) {
      pairs.push_back(
          {triple.in_i.homogeneous().normalized(), triple.in_j.homogeneous().normalized()});
    }
    const auto estimate = EstimatePose(pairs, pose.j_from_i, camera, options);
    if (!estimate) return {};
    pose = *estimate;
  }
  if (pose.direction.isZero()) return {};
  constexpr double kMinParallaxPx = 1.0;
  const double pixel = 1.0 / camera.MeanFocal();
  const std::vector<PlacedPoint> points = PlacePoints(triples, pose, kMinParallaxPx * pixel);
  if (std::ssize(points) < kLeastPoints) return {};
  LogRatio log_ratio = Resect(points, edge.j_from_i * anchor.newest_from_j, pixel);
  log_ratio.value -= log_focal - anchor.log_focal_j;
  log_ratio.sigma = std::hypot(log_ratio.sigma, kLogSigmaPerRad * edge.j_from_i.Angle());
  return std::abs(log_ratio.value) < kMaxLogRatio ? log_ratio : LogRatio{};
}

// A point's bearing in frame j and its place in frame k.
struct PointPair {
  Eigen::Vector3d bearing_j;
  Eigen::Vector2d in_k;
};

std::vector<PointPair> PairsOf(const Features& view_j,
                               const Features& view_k,
                               double log_focal,
                               const Camera& camera) {
  std::vector<PointPair> pairs;
  const std::vector<SharedPoint> points = SharedPoints(view_j, view_k);
  const std::size_t step = 1 + points.size() / kMostPoints;
  for (std::size_t n = 0; n < points.size(); n += step) {
    const auto j = OnPlane(points[n].i_px, log_focal, camera);
    const auto k = OnPlane(points[n].j_px, log_focal, camera);
    if (j && k) pairs.push_back({j->homogeneous().normalized(), *k});
  }
  return pairs;
}

Eigen::Vector3d BearingWithout(const Eigen::Vector2d& in_k, double log_ratio) {
  return (in_k * std::exp(-log_ratio)).homogeneous().normalized();
}

// Median share by which points move away from the principal point, beyond what rotation moves.
double ExpansionOf(const std::vector<PointPair>& pairs, const Rotation& k_from_j) {
  constexpr double kLeastRadius = 0.1;
  std::vector<double> shares;
  for (const PointPair& pair : pairs) {
    const Eigen::Vector3d rotated = k_from_j * pair.bearing_j;
    if (!(rotated.z() > 0.0)) continue;
    const Eigen::Vector2d from = rotated.hnormalized();
    if (from.norm() < kLeastRadius) continue;
    shares.push_back((pair.in_k - from).dot(from) / from.squaredNorm());
  }
  return Median(std::move(shares));
}

// Of a camera that only rotates, or comes nearer to a wall: once the expansion is taken out,
// rotation explains the points. Six parameters: two views with their edge, the camera and the
// options.
LogRatio ByExpansion(const Features& view_j,
                     const Features& view_k,
                     double log_focal,
                     const RelativeRotation& edge,
                     const Camera& camera,
                     const RelativeRotationOptions& options) {
  const std::vector<PointPair> pairs = PairsOf(view_j, view_k, log_focal, camera);
  if (std::ssize(pairs) < kLeastPoints) return {};
  const double expansion = std::log1p(std::max(-0.5, ExpansionOf(pairs, edge.j_from_i)));
  if (std::abs(expansion) < kMinLogRatio) {
    return edge.rotation_only ? LogRatio{0.0, kMinLogRatio} : LogRatio{};
  }
  if (std::abs(expansion) > kMaxLogRatio) return {};
  std::vector<BearingPair> bearings;
  bearings.reserve(pairs.size());
  for (const PointPair& pair : pairs) {
    bearings.push_back({pair.bearing_j, BearingWithout(pair.in_k, expansion)});
  }
  const auto pose = EstimatePose(bearings, edge.j_from_i, camera, options);
  if (!pose) return {};
  constexpr double kMostOfThem = 0.9;
  constexpr double kTolerancePx = 1.5;
  const double tolerance = kTolerancePx / camera.MeanFocal();
  const auto num_rotated =
      std::count_if(bearings.begin(), bearings.end(), [&](const BearingPair& pair) {
        return (pair.bearing_j - pose->j_from_i * pair.bearing_i).norm() < tolerance;
      });
  if (static_cast<double>(num_rotated) < kMostOfThem * static_cast<double>(bearings.size())) {
    return {};
  }
  return {expansion, kLeastLogSigma, true};
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

// A pair of frames that follows the pair before it.
struct ZoomStep {
  const RelativeRotation* edge;
  LogRatio log_ratio;
  double log_focal = 0.0;  // at its beginning
};

// The last step of the zoom that begins with step `first`; single steps in doubt do not end it.
int LastOfZoom(const std::vector<ZoomStep>& steps, int first) {
  const LogRatio& begin = steps[first].log_ratio;
  int last = first;
  if (!begin.ShowsZoom()) return last;
  constexpr int kMostInDoubt = 2;  // one after the other
  for (int k = first + 1; k < std::ssize(steps) && k - last <= kMostInDoubt + 1; ++k) {
    const LogRatio& here = steps[k].log_ratio;
    if (!here.ShowsZoom()) continue;
    if (here.value * begin.value < 0.0) break;
    last = k;
  }
  return last;
}

// The zoom of the steps `first` to `last`; nullopt: they are none.
std::optional<Zoom> ZoomOf(const std::vector<ZoomStep>& steps, int first, int last) {
  constexpr int kLeastSteps = 2;  // a single one is a pair that went wrong
  double sum = 0.0;
  double variance = 0.0;
  int num_known = 0;
  int num_walls = 0;
  for (int k = first; k <= last; ++k) {
    const LogRatio& here = steps[k].log_ratio;
    if (!here.IsKnown()) continue;
    sum += here.value;
    variance += here.sigma * here.sigma;
    num_walls += here.may_be_a_wall;
    ++num_known;
  }
  if (num_known < kLeastSteps) return std::nullopt;
  const double mean = sum / num_known;
  const double log_factor = mean * (last - first + 1);  // those in doubt as the others
  if (std::abs(mean) < kMinMeanLogRatio || std::abs(log_factor) < kLeastLogZoom ||
      std::abs(sum) < kMinSigmasOfAll * std::sqrt(variance)) {
    return std::nullopt;
  }
  // A camera that only rotates before and after approaches no wall in between.
  const bool rests_before = first == 0 || steps[first - 1].edge->rotation_only;
  const bool rests_after = last + 1 == std::ssize(steps) || steps[last + 1].edge->rotation_only;
  if (2 * num_walls > num_known && !(rests_before && rests_after)) return std::nullopt;
  return Zoom{steps[first].edge->i, steps[last].edge->j, std::exp(log_factor)};
}

}  // namespace

std::vector<Zoom> FindZooms(const Camera& camera,
                            const std::map<FrameId, Features>& features,
                            const ViewGraph& graph,
                            const RelativeRotationOptions& options) {
  std::vector<ZoomStep> steps;
  double log_focal = 0.0;        // at the end of the last step
  std::optional<Anchor> anchor;  // of the step to come
  bool rests = false;            // the camera rotates at most, whatever its lens does
  for (const auto& [frame, of_frame] : features) {
    const RelativeRotation* edge = EdgeTo(frame, graph);
    // Steps follow one another: the next one begins where the last one ended, or later.
    if (edge == nullptr || (!steps.empty() && edge->i < steps.back().edge->j)) continue;
    const auto of_first = features.find(edge->i);
    if (of_first == features.end()) continue;
    const bool follows = !steps.empty() && steps.back().edge->j == edge->i;
    if (!follows) anchor.reset();
    LogRatio log_ratio;
    if (anchor) log_ratio = ByAnchor(*anchor, of_frame, *edge, log_focal, camera, options);
    // Its points may be out of view by now.
    const bool is_last = !anchor || anchor->edge == steps.back().edge;
    if (!log_ratio.IsKnown() && follows && !is_last) {
      anchor = AnchorOf(*steps.back().edge, features, steps.back().log_focal, log_focal);
      log_ratio = ByAnchor(*anchor, of_frame, *edge, log_focal, camera, options);
    }
    if (!log_ratio.IsKnown()) {
      log_ratio = ByExpansion(of_first->second, of_frame, log_focal, *edge, camera, options);
    }
    steps.push_back({edge, log_ratio, log_focal});
    rests = edge->rotation_only || (rests && log_ratio.may_be_a_wall);
    const bool is_zooming = log_ratio.ShowsZoom() && (rests || !log_ratio.may_be_a_wall);
    if (is_zooming) log_focal += log_ratio.value;
    if (anchor && (is_zooming || !log_ratio.IsKnown())) {
      anchor->newest_from_j = edge->j_from_i * anchor->newest_from_j;
    } else {
      anchor = AnchorOf(*edge, features, steps.back().log_focal, log_focal);
    }
  }

  std::vector<Zoom> zooms;
  for (int first = 0; first < std::ssize(steps);) {
    const int last = LastOfZoom(steps, first);
    if (const auto zoom = ZoomOf(steps, first, last)) zooms.push_back(*zoom);
    first = last + 1;
  }
  return zooms;
}

}  // namespace rotslam
