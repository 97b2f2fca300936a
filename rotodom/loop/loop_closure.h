#pragma once

#include <cstdint>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/loop/candidates.h"
#include "rotodom/loop/unconfirmed_edges.h"
#include "rotodom/loop/verification.h"
#include "rotodom/loop/vocabulary.h"
#include "rotodom/odometry.h"
#include "rotodom/types/disjoint_sets.h"

namespace rotslam {

/// Options of loop closure: candidates, their verification, and averaging after loops.
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

/// A loop candidate and its verification.
struct LoopCheck {
  FrameId frame;
  FrameId match;
  double score = 0.0;
  int num_inliers = 0;
  // Rotation around the loop: angle between the measured edge and the orientations before it.
  double angle_deg = 0.0;
  ScaledLoop scaled;
  bool accepted = false;
  int num_edges = 0;  // added to the graph; 0 where the relative rotation is not reliable
};

/// The result of loop closure for one frame.
struct LoopReport {
  std::vector<LoopCheck> checks;
  // Accepted edges, the most certain one first: from older places to the frame, or earlier edges
  // that these confirm.
  std::vector<EdgeWithMatches> connections;
  std::vector<EdgeWithMatches> unconfirmed;  // from older places to it, until others confirm them
  // Matches with older places that are the same, but without a reliable relative rotation.
  std::vector<EdgeMatches> matches;
};

/// Time spent so far, s.
struct LoopSeconds {
  double description = 0.0;
  double candidates = 0.0;  // words included
  double verification = 0.0;
};

/// Detects loops: stores frames with new content as places in visual words, finds older places that
/// are similar to a new one, and verifies them by matching and relative rotation.
/// Memory: described corners of every place, 180 KB at 2,000 corners, and PlaceDatabase's.
class LoopClosure {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  LoopClosure(const Camera& camera,
              const LoopOptions& options,
              const FeatureOptions& features,
              const VerificationTools& tools,
              std::shared_ptr<const Vocabulary> vocabulary);

  /// Adds the odometry's estimate of the next frame, and returns the result for the frame before
  /// it: only now is its angular velocity known, which a rolling shutter needs.
  /// @param image           the frame's.
  /// @param cam_from_world  present orientations of all frames so far.
  /// @param pieces          connected components of the view-graph, by frame.
  LoopReport AddFrame(const FrameEstimate& estimate,
                      const MaskedImage& image,
                      const RotationMap& cam_from_world,
                      const DisjointSets& pieces);

  /// Call after the last frame; returns its result.
  LoopReport Finish(const RotationMap& cam_from_world, const DisjointSets& pieces);

  /// Described corners of the newest frame, if it becomes a place; else null.
  const Features* NewestCorners();

  /// Replays a frame from the results of AddFrame, without the image and without searching for
  /// loops.
  /// @param corners  NewestCorners() at that time.
  /// @param report   the result for the frame before.
  void Replay(const FrameEstimate& estimate,
              std::optional<Features> corners,
              const LoopReport& report,
              const RotationMap& cam_from_world);

  /// Moves out the described corners of all places.
  std::map<FrameId, Features> TakePlaces();

  int num_places() const { return static_cast<int>(places_.size()); }
  const LoopSeconds& seconds() const { return seconds_; }

 private:
  // A stored frame. Its corners are detected anew: tracked points have the descriptors of their
  // first frame, while corners are detected again when the camera returns.
  struct Place {
    Features corners;             // described
    std::vector<TrackId> tracks;  // points that the frame sees
    // By corner: index of the frame's feature at the same position, -1 for none.
    std::vector<int> features;
  };
  // The newest place, until the rotation after it is known.
  struct PendingPlace {
    Place place;
    std::vector<Eigen::Vector2d> features_px;  // keypoints of the frame
  };

  // A pending place while its corners are found, and the time that this takes.
  struct DescribedPlace {
    PendingPlace pending;
    double seconds = 0.0;
  };

  bool IsNewPlace(const FrameEstimate& estimate) const;
  // Finds and describes the corners; with several threads while the stream goes on.
  void BeginDescription(const FrameEstimate& estimate, const MaskedImage& image);
  void EndDescription();
  // The pending place after the rotation that follows it is known; nullopt where there is none or
  // its corners are not known accurately enough.
  std::optional<Place> TakePending(const RotationMap& cam_from_world);
  LoopReport VerifyBest(const Place& place,
                        const std::vector<LoopCandidate>& candidates,
                        const RotationMap& cam_from_world,
                        const DisjointSets& pieces);
  void UpdateKeyframes(Place place, const LoopReport& report);
  // Moves the corners to their positions in a global-shutter image; false where the motion is not
  // known accurately enough.
  bool CorrectRollingShutter(const RotationMap& cam_from_world, Features& corners) const;
  std::vector<FrameId> NeighboursOf(const Place& place) const;
  // Finds places similar to this one and adds it to the places.
  std::vector<LoopCandidate> FindCandidates(const Place& place);
  // Verifies a candidate; the edges refer to the place's features.
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
  UnconfirmedEdges unconfirmed_;
  std::map<FrameId, Place> places_;
  std::future<DescribedPlace> description_;  // of the place that is pending next
  std::optional<PendingPlace> pending_;
  std::map<FrameId, double> timestamps_s_;
  LoopSeconds seconds_;
};

}  // namespace rotslam
