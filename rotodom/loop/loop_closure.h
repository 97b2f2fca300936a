#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/loop/candidates.h"
#include "rotodom/loop/verification.h"
#include "rotodom/loop/vocabulary.h"
#include "rotodom/loop/waiting_edges.h"
#include "rotodom/odometry.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

/// Of loop closure: the candidates, their verification, and what the loops do to the averaging.
struct LoopOptions {
  // Look for places seen before; what is remembered then grows with the sequence.
  bool use_loops = true;
  // A frame that shares less than this part of its points with the last place is the next one.
  // More places find more loops and take more time and memory.
  double place_overlap = 0.5;
  // A loop that turns the present orientation by less than this waits for the next one, or for the
  // end, before all orientations are averaged.
  double min_correction_deg = 0.2;
  // They are averaged beside the stream and taken over this many frames after the loop: long enough
  // for some thousand frames at the pace of a camera. 0: at once, the stream waits. It also waits
  // where there is one thread.
  int handover_frames = 5;
  // Candidates that are verified for one place.
  int max_candidates = 3;
  CandidateOptions candidates;
  VerificationOptions verification;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("use_loops", use_loops);
    visit("place_overlap", place_overlap);
    visit("handover_frames", handover_frames);
    visit("max_candidates", max_candidates);
    visit("candidates", candidates);
    visit("verification", verification);
  }
};

/// A place that looked like an older one, and what geometry said.
struct LoopCheck {
  FrameId frame;
  FrameId match;
  double score = 0.0;
  int num_inliers = 0;
  // Of the rotation around the loop: measured edge against the orientations before it.
  double angle_deg = 0.0;
  WayAround way;
  bool accepted = false;
  int num_edges = 0;  // that it has brought; none where nobody knows how the views are turned
};

/// What became of one frame.
struct LoopReport {
  std::vector<LoopCheck> checks;
  // Accepted ones, the most certain one first: from older places to it, or to an older one that
  // its own confirm.
  std::vector<EdgeWithMatches> connections;
  std::vector<EdgeWithMatches> waiting;  // from older places to it, for others to confirm
  // With older places that are the same, but nobody knows how they are turned.
  std::vector<EdgeMatches> matches;
};

/// Where the time goes, seconds since the start.
struct LoopSeconds {
  double description = 0.0;
  double candidates = 0.0;  // words included
  double verification = 0.0;
};

/// Finds out when the camera is back: remembers frames that see something new as places, in visual
/// words, looks for older places that look like a new one, and verifies them by matching and
/// relative rotation.
/// Memory: described corners of every place, 180 KB at 2,000 corners, and PlaceDatabase's.
class LoopClosure {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  LoopClosure(const Camera& camera,
              const LoopOptions& options,
              const OdometryOptions& odometry,
              std::shared_ptr<const Vocabulary> vocabulary,
              std::uint64_t seed,
              int num_threads);

  /// Takes what the odometry said of the next frame, and says what became of the frame before it:
  /// only now is the rate of its rotation known, which a rolling shutter needs.
  /// @param image           the frame's.
  /// @param cam_from_world  present orientations of all frames so far.
  /// @param pieces          by frame: inside one, orientations are linked by edges.
  LoopReport AddFrame(const FrameEstimate& estimate,
                      const cv::Mat& image,
                      const RotationMap& cam_from_world,
                      const DisjointSets& pieces);

  /// After the last frame: what became of that.
  LoopReport Finish(const RotationMap& cam_from_world, const DisjointSets& pieces);

  /// Described corners of the newest frame, if that is to be a place; else null.
  const Features* NewestCorners() const { return pending_ ? &pending_->place.corners : nullptr; }

  /// Takes a frame again from what AddFrame said, without the image and without looking for loops.
  /// @param corners  what NewestCorners() was then.
  /// @param report   of the frame before.
  void Replay(const FrameEstimate& estimate,
              std::optional<Features> corners,
              const LoopReport& report,
              const RotationMap& cam_from_world);

  /// Described corners of all places, which are forgotten.
  std::map<FrameId, Features> TakePlaces();

  int num_places() const { return static_cast<int>(places_.size()); }
  const LoopSeconds& seconds() const { return seconds_; }

 private:
  // A frame as it is remembered. Points that were followed here have descriptors of where they
  // came from; corners found anew are found again when the camera comes back.
  struct Place {
    Features corners;             // described
    std::vector<TrackId> tracks;  // that the frame shows
    // By corner: the frame's feature there, -1 for none.
    std::vector<int> features;
  };
  // The newest one, as long as the rotation after it is not known.
  struct PendingPlace {
    Place place;
    std::vector<Eigen::Vector2d> features_px;  // the frame's
  };

  bool IsNewPlace(const FrameEstimate& estimate) const;
  PendingPlace Describe(const FrameEstimate& estimate, const cv::Mat& image);
  // The pending place, now that the rotation after it is known; nullopt where there is none or its
  // corners are not known well enough.
  std::optional<Place> TakePending(const RotationMap& cam_from_world);
  LoopReport VerifyBest(const Place& place,
                        const std::vector<LoopCandidate>& candidates,
                        const RotationMap& cam_from_world,
                        const DisjointSets& pieces);
  void UpdateKeyframes(Place place, const LoopReport& report);
  // Moves the corners to where a global shutter would have seen them; false when that is not known
  // well enough.
  bool CorrectRollingShutter(const RotationMap& cam_from_world, Features& corners) const;
  std::vector<FrameId> NeighboursOf(const Place& place) const;
  // From now on it is one itself.
  std::vector<LoopCandidate> FindCandidates(const Place& place);
  // What was compared with the candidate; its edges name the place's features.
  LoopEvidence Verify(const Place& place,
                      const LoopCandidate& candidate,
                      const RotationMap& cam_from_world,
                      const DisjointSets& pieces);

  Camera camera_;
  LoopOptions options_;
  FeatureOptions feature_options_;
  VerificationTools tools_;
  std::shared_ptr<const Vocabulary> vocabulary_;
  CandidateFinder finder_;
  WaitingEdges waiting_;
  std::map<FrameId, Place> places_;
  std::optional<PendingPlace> pending_;
  std::map<FrameId, double> timestamps_s_;
  LoopSeconds seconds_;
};

}  // namespace rotslam
