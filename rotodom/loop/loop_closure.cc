#include "rotodom/loop/loop_closure.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "rotodom/features/view.h"
#include "rotodom/rolling_shutter/rolling_shutter.h"
#include "rotodom/types/options.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// By point: index of the nearest of `others`, -1 when none is within 1.5 px.
std::vector<int> FindNearest(const std::vector<Eigen::Vector2d>& points_px,
                             const std::vector<Eigen::Vector2d>& others_px) {
  constexpr double kReachPx = 1.5;
  std::vector<int> by_x(others_px.size());
  std::iota(by_x.begin(), by_x.end(), 0);
  std::sort(by_x.begin(), by_x.end(), [&](int a, int b) {
    return std::pair(others_px[a].x(), a) < std::pair(others_px[b].x(), b);
  });
  std::vector<int> nearest(points_px.size(), -1);
  for (std::size_t n = 0; n < points_px.size(); ++n) {
    const Eigen::Vector2d& point_px = points_px[n];
    double least = kReachPx * kReachPx;
    auto other = std::lower_bound(
        by_x.begin(), by_x.end(), point_px.x() - kReachPx, [&](int index, double x) {
          return others_px[index].x() < x;
        });
    for (; other != by_x.end() && others_px[*other].x() <= point_px.x() + kReachPx; ++other) {
      const double squared = (others_px[*other] - point_px).squaredNorm();
      if (squared > least) continue;
      least = squared;
      nearest[n] = *other;
    }
  }
  return nearest;
}

// Converts matches of corners to matches of the features at the same positions.
std::vector<std::array<int, 2>> MatchesOfFeatures(const std::vector<std::array<int, 2>>& corners,
                                                  const std::vector<int>& features_i,
                                                  const std::vector<int>& features_j) {
  std::vector<std::array<int, 2>> matches;
  for (const auto& [i, j] : corners) {
    if (features_i[i] >= 0 && features_j[j] >= 0) matches.push_back({features_i[i], features_j[j]});
  }
  return matches;
}

// With a rolling shutter, a frame during which the rotation's acceleration changes is distorted in
// a way that is not known; beyond this, at the image's border, a steadier one becomes the place.
// Half of what an edge may be uncertain by (VerificationOptions::max_sigma_deg).
constexpr double kMaxShutterErrorDeg = 0.1;
// A place sees the same scene as another when they have this many points in common, as many as a
// relative rotation needs (RelativeRotationOptions::min_inliers).
constexpr int kMinCommonPoints = 15;
// Places around a candidate that are asked as well: each costs one more matching of descriptors.
constexpr int kMaxNeighbours = 4;

// Throws std::invalid_argument when an option is out of range.
const LoopOptions& Checked(const LoopOptions& options) {
  if (const auto problem = options.Problem()) throw std::invalid_argument("loop: " + *problem);
  return options;
}

}  // namespace

std::optional<std::string> LoopOptions::Problem() const {
  if (!(place_overlap > 0.0 && place_overlap <= 1.0)) {
    return OutOfRange("place_overlap", place_overlap, "above 0 and at most 1");
  }
  if (!(min_correction_deg >= 0.0)) {
    return OutOfRange("min_correction_deg", min_correction_deg, "zero or more");
  }
  if (handover_frames < 0) return OutOfRange("handover_frames", handover_frames, "zero or more");
  if (max_candidates < 1) return OutOfRange("max_candidates", max_candidates, "at least 1");
  if (auto problem = ProblemIn("candidates", candidates)) return problem;
  return ProblemIn("verification", verification);
}

LoopClosure::LoopClosure(const Camera& camera,
                         const LoopOptions& options,
                         const FeatureOptions& features,
                         const VerificationTools& tools,
                         std::shared_ptr<const Vocabulary> vocabulary)
    : camera_(camera),
      options_(Checked(options)),
      feature_options_(features),
      tools_(tools),
      vocabulary_(std::move(vocabulary)),
      finder_(vocabulary_->num_words(), options.candidates),
      unconfirmed_(options.verification) {}

LoopReport LoopClosure::AddFrame(const FrameEstimate& estimate,
                                 const MaskedImage& image,
                                 const RotationMap& cam_from_world,
                                 const DisjointSets& pieces) {
  timestamps_s_[estimate.frame] = estimate.timestamp_s;
  LoopReport report = Finish(cam_from_world, pieces);
  if (IsNewPlace(estimate)) BeginDescription(estimate, image);
  return report;
}

LoopReport LoopClosure::Finish(const RotationMap& cam_from_world, const DisjointSets& pieces) {
  std::optional<Place> place = TakePending(cam_from_world);
  if (!place) return {};
  LoopReport report = VerifyBest(*place, FindCandidates(*place), cam_from_world, pieces);
  UpdateKeyframes(*std::move(place), report);
  return report;
}

void LoopClosure::Replay(const FrameEstimate& estimate,
                         std::optional<Features> corners,
                         const LoopReport& report,
                         const RotationMap& cam_from_world) {
  timestamps_s_[estimate.frame] = estimate.timestamp_s;
  if (std::optional<Place> place = TakePending(cam_from_world)) {
    FindCandidates(*place);
    UpdateKeyframes(*std::move(place), report);
  }
  if (!corners) return;
  pending_ = {{*std::move(corners), estimate.features.tracks, {}}, estimate.features.keypoints_px};
}

const Features* LoopClosure::NewestCorners() {
  EndDescription();
  return pending_ ? &pending_->place.corners : nullptr;
}

std::optional<LoopClosure::Place> LoopClosure::TakePending(const RotationMap& cam_from_world) {
  EndDescription();
  if (!pending_) return std::nullopt;
  PendingPlace pending = *std::move(pending_);
  pending_.reset();
  if (!CorrectRollingShutter(cam_from_world, pending.place.corners)) return std::nullopt;
  pending.place.features = FindNearest(pending.place.corners.keypoints_px, pending.features_px);
  return std::move(pending.place);
}

LoopReport LoopClosure::VerifyBest(const Place& place,
                                   const std::vector<LoopCandidate>& candidates,
                                   const RotationMap& cam_from_world,
                                   const DisjointSets& pieces) {
  LoopReport report;
  const auto pieces_differ = [&](const RelativeRotation& edge) {
    return pieces.Find(edge.i.value) != pieces.Find(edge.j.value);
  };
  const std::size_t count =
      std::min(candidates.size(), static_cast<std::size_t>(options_.max_candidates));
  for (std::size_t k = 0; k < count && report.connections.empty(); ++k) {
    LoopEvidence evidence = Verify(place, candidates[k], cam_from_world, pieces);
    if (!evidence.accepted && !evidence.connections.empty() &&
        pieces_differ(evidence.connections.front().edge)) {
      EdgeWithMatches best = std::move(evidence.connections.front());
      evidence.connections = unconfirmed_.Confirmed(best, cam_from_world, pieces);
      evidence.accepted = !evidence.connections.empty();
      if (!evidence.accepted) report.unconfirmed.push_back(std::move(best));
    }
    if (evidence.accepted) {
      report.connections = std::move(evidence.connections);
      for (EdgeWithMatches& unproven : evidence.unproven) {
        report.matches.push_back(std::move(unproven.matches));
      }
    }
    report.checks.push_back({place.corners.frame,
                             evidence.match,
                             candidates[k].score,
                             evidence.num_inliers,
                             evidence.angle_deg,
                             evidence.scaled,
                             evidence.accepted,
                             static_cast<int>(report.connections.size())});
  }
  return report;
}

void LoopClosure::UpdateKeyframes(Place place, const LoopReport& report) {
  const FrameId frame = place.corners.frame;
  for (const EdgeWithMatches& connection : report.connections) {
    finder_.Join(connection.edge.i, connection.edge.j);
  }
  for (const EdgeMatches& matches : report.matches) finder_.Join(matches.frame_i, matches.frame_j);
  unconfirmed_.Remove(report.connections);
  for (const EdgeWithMatches& connection : report.unconfirmed) unconfirmed_.Add(connection);
  places_.emplace(frame, std::move(place));
}

std::map<FrameId, Features> LoopClosure::TakePlaces() {
  std::map<FrameId, Features> corners;
  for (auto& [frame, place] : places_) corners.emplace(frame, std::move(place.corners));
  places_.clear();
  return corners;
}

bool LoopClosure::IsNewPlace(const FrameEstimate& estimate) const {
  const Features& features = estimate.features;
  if (features.size() < options_.verification.min_inliers) return false;
  if (places_.empty()) return true;
  const std::vector<TrackId>& last = std::prev(places_.end())->second.tracks;
  return CountCommonTracks(last, features.tracks) < options_.place_overlap * features.size();
}

void LoopClosure::BeginDescription(const FrameEstimate& estimate, const MaskedImage& image) {
  PendingPlace pending;
  pending.place.corners.frame = estimate.frame;
  pending.place.tracks = estimate.features.tracks;
  pending.features_px = estimate.features.keypoints_px;
  // The caller may use the image's memory again.
  auto describe = [this,
                   pending = std::move(pending),
                   grey = ToGrey(image.image).clone(),
                   mask = image.mask]() mutable {
    DescribedPlace described;
    {
      const Stopwatch stopwatch(described.seconds);
      Features& corners = pending.place.corners;
      const ImagePyramid pyramid = BuildPyramid(grey, feature_options_, mask);
      DetectFeatures(pyramid, camera_, feature_options_, tools_.num_threads, corners);
      DescribeFeatures(pyramid, tools_.num_threads, corners);
      corners.rgb = {};
    }
    described.pending = std::move(pending);
    return described;
  };
  const auto launch = tools_.num_threads > 1 ? std::launch::async : std::launch::deferred;
  description_ = std::async(launch, std::move(describe));
}

void LoopClosure::EndDescription() {
  if (!description_.valid()) return;
  DescribedPlace described = description_.get();
  seconds_.description += described.seconds;
  pending_ = std::move(described.pending);
}

bool LoopClosure::CorrectRollingShutter(const RotationMap& cam_from_world,
                                        Features& corners) const {
  if (camera_.readout_s == 0.0) return true;
  const auto here = cam_from_world.find(corners.frame);
  if (here == cam_from_world.begin() || std::next(here) == cam_from_world.end()) return false;
  const auto time_s = [&](FrameId frame) { return timestamps_s_.at(frame); };
  const auto [motion, error_rad] =
      EstimateMotionAt(corners.frame, cam_from_world, time_s, camera_.readout_s);
  if (error_rad * kDegFromRad > kMaxShutterErrorDeg) return false;
  MoveToMidFrame(camera_, motion, corners);
  return true;
}

std::vector<FrameId> LoopClosure::NeighboursOf(const Place& place) const {
  std::vector<std::pair<int, FrameId>> common;
  for (auto older = places_.rbegin(); older != places_.rend(); ++older) {
    const int count = CountCommonTracks(older->second.tracks, place.tracks);
    // A lost track does not reappear, so older places have fewer common tracks.
    if (count < kMinCommonPoints) break;
    common.emplace_back(count, older->first);
  }
  std::stable_sort(
      common.begin(), common.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<FrameId> neighbours;
  neighbours.reserve(common.size());
  for (const auto& [count, frame] : common) neighbours.push_back(frame);
  return neighbours;
}

std::vector<LoopCandidate> LoopClosure::FindCandidates(const Place& place) {
  const Stopwatch stopwatch(seconds_.candidates);
  const ImageWords words =
      vocabulary_->Transform(ToBinaryDescriptors(place.corners.descriptors), 0);
  return finder_.AddPlace(place.corners.frame, words.bag, NeighboursOf(place));
}

LoopEvidence LoopClosure::Verify(const Place& place,
                                 const LoopCandidate& candidate,
                                 const RotationMap& cam_from_world,
                                 const DisjointSets& pieces) {
  const Stopwatch stopwatch(seconds_.verification);
  const FrameId frame = place.corners.frame;
  std::vector<const Features*> old_places = {&places_.at(candidate.frame).corners};
  for (const FrameId neighbour : finder_.NeighboursOf(candidate.frame)) {
    if (static_cast<int>(old_places.size()) > kMaxNeighbours) break;
    if (neighbour != frame) old_places.push_back(&places_.at(neighbour).corners);
  }
  RotationRates rates;
  const auto time_s = [&](FrameId of) { return timestamps_s_.at(of); };
  const auto add_rate = [&](FrameId of) {
    if (const auto rate = RateOf(of, cam_from_world, time_s)) rates[of] = *rate;
  };
  add_rate(frame);
  for (const Features* old_place : old_places) add_rate(old_place->frame);
  const bool are_linked = pieces.Find(candidate.frame.value) == pieces.Find(frame.value);
  LoopEvidence evidence = VerifyLoop(
      {place.corners, old_places, cam_from_world, rates, candidate.num_consistent, are_linked},
      camera_,
      options_.verification,
      tools_);
  for (auto* connections : {&evidence.connections, &evidence.unproven}) {
    for (EdgeWithMatches& connection : *connections) {
      connection.matches.pairs = MatchesOfFeatures(
          connection.matches.pairs, places_.at(connection.edge.i).features, place.features);
    }
  }
  return evidence;
}

}  // namespace rotslam
