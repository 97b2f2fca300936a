#include "rotodom/loop/verification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

#include <Eigen/Eigenvalues>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

double LargestSigmaDeg(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(eigen.eigenvalues()[2]) * kDegFromRad;
}

// The edge from one old place to the view.
struct PlaceEdge {
  EdgeWithMatches connection;
  Rotation old_from_world;
  Rotation view_from_world;
  double sigma_deg = 0.0;                  // standard deviation of the least certain axis
  bool is_certain = false;                 // false: the edge may confirm others only
  std::optional<EdgeWithMatches> blurred;  // estimated with the covariances of blurred corners
  bool is_alike = false;                   // `blurred` is certain and close to `connection`
};

// Matched keypoints of an old place and of the view.
using KeypointPairs = std::vector<std::array<int, 2>>;

class Verifier {
 public:
  Verifier(const Features& view,
           const RotationRates& rates,
           const Camera& camera,
           const VerificationOptions& options,
           const VerificationTools& tools)
      : view_(view), rates_(rates), camera_(camera), options_(options), tools_(tools) {}

  // Estimates the edge from an old place; nullopt where too few matches agree.
  // @param tests_blur  whether the edge is estimated a second time with the covariances of blurred
  //                    corners.
  std::optional<PlaceEdge> Estimate(const Features& old_place,
                                    const Rotation& old_from_world,
                                    const Rotation& predicted_view_from_world,
                                    bool tests_blur) const {
    const Rotation predicted_view_from_old = predicted_view_from_world * old_from_world.Inverse();
    const Matches matches =
        MatchFeatures(old_place, view_, predicted_view_from_old, camera_, tools_.matching);
    KeypointPairs keypoints;
    keypoints.reserve(matches.matches.size());
    for (const Match& match : matches.matches) keypoints.push_back({match.i.value, match.j.value});
    std::optional<EdgeWithMatches> connection =
        Connect(old_place, keypoints, predicted_view_from_old, {});
    if (!connection) return std::nullopt;
    const int inliers = connection->edge.num_inliers;
    const double least = options_.min_inlier_ratio * static_cast<double>(keypoints.size());
    if (inliers < options_.min_inliers || inliers < least) return std::nullopt;
    const double seen_sigma_deg = LargestSigmaDeg(connection->edge.covariance);
    if (seen_sigma_deg > options_.max_witness_sigma_deg) return std::nullopt;
    PlaceEdge place_edge;
    place_edge.is_certain = seen_sigma_deg <= options_.max_sigma_deg;
    place_edge.old_from_world = old_from_world;
    place_edge.view_from_world = connection->edge.j_from_i * old_from_world;
    place_edge.blurred =
        tests_blur && AreBlurred(old_place)
            ? EstimateWithBlur(old_place, keypoints, predicted_view_from_old, *connection)
            : connection;
    if (place_edge.blurred) {
      RelativeRotation& edge = place_edge.blurred->edge;
      const Rotation between = connection->edge.j_from_i * edge.j_from_i.Inverse();
      place_edge.is_alike = LargestSigmaDeg(edge.covariance) <= options_.max_sigma_deg &&
                            between.AngleDeg() <= options_.max_cycle_deg;
      AddShutterError(edge);
    }
    AddShutterError(connection->edge);
    place_edge.sigma_deg = LargestSigmaDeg(connection->edge.covariance);
    place_edge.connection = *std::move(connection);
    return place_edge;
  }

 private:
  std::optional<EdgeWithMatches> Connect(const Features& old_place,
                                         const KeypointPairs& keypoints,
                                         const Rotation& predicted_view_from_old,
                                         const std::vector<MatchNoise>& noise) const {
    return EstimateEdge({old_place, view_, keypoints, noise},
                        predicted_view_from_old,
                        camera_.MeanFocal(),
                        {tools_.relative_rotation, tools_.seed, tools_.num_threads});
  }

  // The edge estimated with the covariances of blurred corners, if it is certain enough to confirm
  // others.
  std::optional<EdgeWithMatches> EstimateWithBlur(const Features& old_place,
                                                  const KeypointPairs& keypoints,
                                                  const Rotation& predicted_view_from_old,
                                                  const EdgeWithMatches& connection) const {
    const Rotation& view_from_old = connection.edge.j_from_i;
    std::optional<EdgeWithMatches> blurred =
        Connect(old_place,
                keypoints,
                predicted_view_from_old,
                BlurredNoise(old_place, keypoints, view_from_old));
    if (!blurred) return std::nullopt;
    if (LargestSigmaDeg(blurred->edge.covariance) > options_.max_witness_sigma_deg) {
      return std::nullopt;
    }
    return blurred;
  }

  void AddShutterError(RelativeRotation& edge) const {
    if (camera_.readout_s == 0.0) return;
    const double sigma = options_.shutter_sigma_deg * kRadFromDeg;
    edge.covariance += sigma * sigma * Eigen::Matrix3d::Identity();
  }

  // Whether rotation blurs the corners of either image enough to matter.
  bool AreBlurred(const Features& old_place) const {
    constexpr double kLeastBlur = 0.3;  // an ellipse 1.04 times as long as wide
    const auto view_rate = rates_.find(view_.frame);
    const auto old_rate = rates_.find(old_place.frame);
    if (view_rate == rates_.end() || old_rate == rates_.end()) return false;
    const double rate = std::max(view_rate->second.norm(), old_rate->second.norm());
    return options_.blur_s_per_px * camera_.MeanFocal() * rate > kLeastBlur;
  }

  // Covariances of the matches, in units of the variance of a sharp corner.
  std::vector<MatchNoise> BlurredNoise(const Features& old_place,
                                       const KeypointPairs& keypoints,
                                       const Rotation& view_from_old) const {
    const auto covariance_px = [&](const Features& features, int index) {
      const Eigen::Vector2d blur = BlurVectorOf(
          camera_, features.bearings[index], rates_.at(features.frame), options_.blur_s_per_px);
      return Eigen::Matrix2d(Eigen::Matrix2d::Identity() + blur * blur.transpose());
    };
    const Eigen::Matrix3d R_view_old = view_from_old.Matrix();
    std::vector<MatchNoise> noise;
    noise.reserve(keypoints.size());
    for (const auto& [of_old, of_view] : keypoints) {
      noise.push_back({DifferenceCovariance(old_place.bearings[of_old],
                                            covariance_px(old_place, of_old),
                                            view_.bearings[of_view],
                                            covariance_px(view_, of_view),
                                            R_view_old,
                                            TangentBasis(view_.bearings[of_view])),
                       0.0});
    }
    return noise;
  }

  const Features& view_;
  const RotationRates& rates_;
  const Camera& camera_;
  const VerificationOptions& options_;
  const VerificationTools& tools_;
};

// Orientation of the view by the edge estimated with blurred corners.
Rotation ViewByBlurred(const PlaceEdge& place_edge) {
  return place_edge.blurred->edge.j_from_i * place_edge.old_from_world;
}

// Largest rotation around a short cycle: `angle_deg`, or `sigmas` standard deviations of its edges
// where that is more, plus `rotation_error` times the rotation between the old places.
struct CycleBound {
  double angle_deg = 0.0;
  double sigmas = 0.0;
  double rotation_error = 0.0;
};

// Whether the cycle of the view and two old places closes.
bool DoAgree(const PlaceEdge& one, const PlaceEdge& other, const CycleBound& bound) {
  const Rotation around = other.view_from_world * one.view_from_world.Inverse();
  const Rotation other_from_one =
      other.connection.edge.j_from_i.Inverse() * one.connection.edge.j_from_i;
  const double angle_deg =
      std::max(bound.angle_deg, bound.sigmas * std::hypot(one.sigma_deg, other.sigma_deg));
  return around.AngleDeg() <= angle_deg + bound.rotation_error * other_from_one.AngleDeg();
}

// Indices of the edges that agree with one certain edge: the one with the most inliers in
// agreement. The first index is that edge.
std::vector<int> LargestAgreeingSet(const std::vector<PlaceEdge>& place_edges,
                                    const CycleBound& bound) {
  const auto inliers = [&](int index) { return place_edges[index].connection.edge.num_inliers; };
  const int count = static_cast<int>(place_edges.size());
  std::vector<int> largest;
  int most_inliers = 0;
  for (int center = 0; center < count; ++center) {
    if (!place_edges[center].is_certain) continue;
    std::vector<int> agreeing = {center};
    int num_inliers = inliers(center);
    for (int other = 0; other < count; ++other) {
      if (other == center || !DoAgree(place_edges[center], place_edges[other], bound)) continue;
      agreeing.push_back(other);
      num_inliers += inliers(other);
    }
    if (num_inliers <= most_inliers) continue;
    most_inliers = num_inliers;
    largest = std::move(agreeing);
  }
  return largest;
}

// Whether an edge may enter the graph: estimated with blurred corners, it agrees with the first
// estimate or with another place's edge estimated that way.
bool IsProven(const std::vector<PlaceEdge>& place_edges,
              const std::vector<int>& agreeing,
              int index,
              double max_angle_deg) {
  const PlaceEdge& place_edge = place_edges[index];
  if (!place_edge.is_certain || !place_edge.blurred) return false;
  if (place_edge.is_alike) return true;
  return std::any_of(agreeing.begin(), agreeing.end(), [&](int other) {
    if (other == index || !place_edges[other].blurred) return false;
    const Rotation around = ViewByBlurred(place_edge) * ViewByBlurred(place_edges[other]).Inverse();
    return around.AngleDeg() <= max_angle_deg;
  });
}

// The edges from the old places. Neighbours can only confirm the edge of the most similar place:
// without that edge there are none.
std::vector<PlaceEdge> EstimatePlaceEdges(const PlaceComparison& places, const Verifier& verifier) {
  const Rotation& present_view_from_world = places.cam_from_world.at(places.view.frame);
  std::vector<PlaceEdge> place_edges;
  for (const Features* old_place : places.old_places) {
    const Rotation& old_from_world = places.cam_from_world.at(old_place->frame);
    auto place_edge =
        verifier.Estimate(*old_place, old_from_world, present_view_from_world, places.are_linked);
    if (place_edge) place_edges.push_back(*std::move(place_edge));
    if (place_edges.empty()) break;
  }
  return place_edges;
}

// Sorts the agreeing edges: certain ones first, then proven ones, then by their covariance.
// @return  by edge, whether it is proven.
std::vector<bool> SortByProof(const std::vector<PlaceEdge>& place_edges,
                              double max_cycle_deg,
                              std::vector<int>& agreeing) {
  std::vector<bool> is_proven(place_edges.size(), false);
  for (const int index : agreeing) {
    is_proven[index] = IsProven(place_edges, agreeing, index, max_cycle_deg);
  }
  const auto rank = [&](int index) {
    const PlaceEdge& place_edge = place_edges[index];
    return std::tuple(
        !place_edge.is_certain, !is_proven[index], place_edge.connection.edge.covariance.trace());
  };
  std::stable_sort(
      agreeing.begin(), agreeing.end(), [&](int a, int b) { return rank(a) < rank(b); });
  return is_proven;
}

}  // namespace

std::optional<std::string> VerificationOptions::Problem() const {
  if (min_inliers < 1) return OutOfRange("min_inliers", min_inliers, "at least 1");
  if (!(min_inlier_ratio >= 0.0 && min_inlier_ratio < 1.0)) {
    return OutOfRange("min_inlier_ratio", min_inlier_ratio, "0 or more and below 1");
  }
  if (!(max_sigma_deg > 0.0)) return OutOfRange("max_sigma_deg", max_sigma_deg, "above 0");
  if (!(max_witness_sigma_deg >= max_sigma_deg)) {
    return OutOfRange("max_witness_sigma_deg", max_witness_sigma_deg, "at least max_sigma_deg");
  }
  if (!(blur_s_per_px >= 0.0)) return OutOfRange("blur_s_per_px", blur_s_per_px, "zero or more");
  if (!(shutter_sigma_deg >= 0.0)) {
    return OutOfRange("shutter_sigma_deg", shutter_sigma_deg, "zero or more");
  }
  if (min_edges < 1) return OutOfRange("min_edges", min_edges, "at least 1");
  if (!(min_witness_deg >= 0.0)) {
    return OutOfRange("min_witness_deg", min_witness_deg, "zero or more");
  }
  if (sure_inliers < 0) return OutOfRange("sure_inliers", sure_inliers, "zero or more");
  if (!(max_cycle_deg > 0.0)) return OutOfRange("max_cycle_deg", max_cycle_deg, "above 0");
  if (!(max_cycle_sigmas >= 0.0)) {
    return OutOfRange("max_cycle_sigmas", max_cycle_sigmas, "zero or more");
  }
  if (!(max_drift_deg > 0.0)) return OutOfRange("max_drift_deg", max_drift_deg, "above 0");
  if (!(max_drift_deg_per_sqrt_frame >= 0.0)) {
    return OutOfRange("max_drift_deg_per_sqrt_frame", max_drift_deg_per_sqrt_frame, "zero or more");
  }
  if (!(max_turn_error >= 0.0 && max_turn_error < 1.0)) {
    return OutOfRange("max_turn_error", max_turn_error, "0 or more and below 1");
  }
  return std::nullopt;
}

ScaledLoop ScaleRotations(const RotationMap& cam_from_world,
                          const RelativeRotation& loop,
                          double max_turn_error) {
  // Smallest derivative of the rotation around the loop by the scale, rad, about half a turn: with
  // less rotation the scale is not observable.
  constexpr double kLeastTurn = 3.0;
  constexpr double kSmallStep = 1e-3;  // of the scale, for the numerical derivative
  constexpr int kRounds = 4;  // of Gauss-Newton; the rotation is nearly linear in the scale
  std::vector<Eigen::Vector3d> turns;
  const auto last = cam_from_world.find(loop.j);
  for (auto frame = cam_from_world.find(loop.i); frame != last; ++frame) {
    turns.push_back((std::next(frame)->second * frame->second.Inverse()).Log());
  }
  const auto around = [&](double scale) {
    Rotation j_from_i;
    for (const Eigen::Vector3d& turn : turns) j_from_i = Rotation::Exp(scale * turn) * j_from_i;
    return loop.j_from_i * j_from_i.Inverse();
  };
  double scale = 1.0;
  Rotation rest = around(scale);
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::Vector3d slope = (around(scale + kSmallStep) * rest.Inverse()).Log() / kSmallStep;
    if (slope.norm() < kLeastTurn) break;
    const double step = -slope.dot(rest.Log()) / slope.squaredNorm();
    const double next = std::clamp(scale + step, 1.0 - max_turn_error, 1.0 + max_turn_error);
    const Rotation next_rest = around(next);
    if (next_rest.Angle() >= rest.Angle()) break;
    scale = next;
    rest = next_rest;
  }
  return {scale, rest.AngleDeg()};
}

LoopEvidence VerifyLoop(const PlaceComparison& places,
                        const Camera& camera,
                        const VerificationOptions& options,
                        const VerificationTools& tools) {
  LoopEvidence evidence;
  evidence.match = places.old_places.front()->frame;
  std::vector<PlaceEdge> place_edges =
      EstimatePlaceEdges(places, Verifier(places.view, places.rates, camera, options, tools));
  const auto scale_rotations = [&](const RelativeRotation& edge) {
    return places.are_linked ? ScaleRotations(places.cam_from_world, edge, options.max_turn_error)
                             : ScaledLoop();
  };
  const auto certain =
      std::find_if(place_edges.begin(), place_edges.end(), [](const PlaceEdge& place_edge) {
        return place_edge.is_certain;
      });
  if (certain == place_edges.end()) return evidence;
  // The scale error of the rotations is that of the first certain edge; it is nearly the same for
  // the next places.
  const double rotation_error =
      std::abs(scale_rotations(certain->connection.edge).turn_scale - 1.0);
  std::vector<int> agreeing = LargestAgreeingSet(
      place_edges, {options.max_cycle_deg, options.max_cycle_sigmas, rotation_error});
  const std::vector<bool> is_proven = SortByProof(place_edges, options.max_cycle_deg, agreeing);
  const PlaceEdge& best = place_edges[agreeing.front()];
  const RelativeRotation& edge =
      (is_proven[agreeing.front()] ? *best.blurred : best.connection).edge;
  evidence.match = edge.i;
  evidence.num_inliers = edge.num_inliers;
  const Rotation view_from_world = edge.j_from_i * places.cam_from_world.at(edge.i);
  const Rotation& present_view_from_world = places.cam_from_world.at(places.view.frame);
  evidence.angle_deg = (view_from_world * present_view_from_world.Inverse()).AngleDeg();
  evidence.scaled = scale_rotations(edge);
  const int num_frames = places.view.frame.value - evidence.match.value;
  const double drift_deg = options.max_drift_deg + options.max_drift_deg_per_sqrt_frame *
                                                       std::sqrt(static_cast<double>(num_frames));
  int num_inliers = 0;
  for (const int index : agreeing) num_inliers += place_edges[index].connection.edge.num_inliers;
  evidence.accepted = static_cast<int>(agreeing.size()) >= options.min_edges &&
                      (num_inliers >= options.sure_inliers || places.num_consistent > 1) &&
                      (!places.are_linked || evidence.scaled.angle_deg <= drift_deg);
  for (const int index : agreeing) {
    if (!place_edges[index].is_certain) break;
    if (is_proven[index]) {
      evidence.connections.push_back(*std::move(place_edges[index].blurred));
    } else {
      evidence.unproven.push_back(std::move(place_edges[index].connection));
    }
  }
  return evidence;
}

}  // namespace rotslam
