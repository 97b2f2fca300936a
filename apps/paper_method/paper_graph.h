#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "rotodom/averaging/averaging.h"
#include "rotodom/relative_rotation/bearing_pair.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// The matches of an older frame i with a newer frame j.
struct PairMatches {
  FrameId i;
  FrameId j;
  std::vector<BearingPair> pairs;  // with outliers
};

/// Estimates the relative rotation of a pair of frames; nullopt where it finds none. It is called
/// from several threads.
using PairSolver = std::function<std::optional<RelativeRotation>(
    const PairMatches& matches, const Rotation& start_j_from_i, std::uint64_t seed)>;

/// Averages the free views of a graph; as AverageEqually.
using WindowAverager = std::function<RotationMap(const ViewGraph& graph,
                                                 const RotationMap& cam_from_world,
                                                 const std::set<FrameId>& free_views)>;

/// The back end of the paper's method. What it is made of can be exchanged, to measure what each
/// part is worth.
struct PaperGraphOptions {
  AveragingOptions averaging;  // mode and window
  int min_edge_inliers = 100;  // the paper's theta: an edge has more
  PairSolver solver;           // empty: OpenGV's eigensolver
  WindowAverager averager;     // empty: AverageEqually
  std::uint64_t seed = 1;
  int num_threads = 1;
};

/// Alg. 1 of the paper from the matches on: relative rotations, view-graph, averaging of the newest
/// orientations, and of all after a loop.
class PaperGraph {
 public:
  explicit PaperGraph(const PaperGraphOptions& options);

  /// The result for one frame.
  struct Step {
    std::vector<RelativeRotation> edges;  // of the frame, the newest partner first
    bool predicted_only = false;          // no edge: the orientation is the prediction
  };

  /// Adds the next frame with its matches to the frames before it, the newest first. Each relative
  /// rotation is looked for from that between the two frames before the pair. The frame's
  /// orientation follows its first edge; without one it goes on as between the last two frames.
  Step AddFrame(FrameId frame, std::span<const PairMatches> matches);

  /// Estimates the edges of loops that end at the newest frame, each looked for from the newest
  /// relative rotation.
  /// @return  one for each candidate; nullopt where there are too few inliers. They are not in the
  ///          graph yet.
  std::vector<std::optional<RelativeRotation>> VerifyLoops(
      std::span<const PairMatches> candidates) const;
  /// Adds the edges of loops and averages all orientations; does nothing without edges.
  void CloseLoops(std::span<const RelativeRotation> edges);

  const ViewGraph& graph() const { return graph_; }
  const RotationMap& cam_from_world() const { return cam_from_world_; }

 private:
  std::optional<RelativeRotation> Estimate(const PairMatches& matches,
                                           const Rotation& start_j_from_i) const;
  // Rotation between two frames, as an edge has it, else as the orientations say; the identity for
  // frames before the first.
  Rotation RelativeRotationOf(FrameId i, FrameId j) const;
  std::vector<std::optional<RelativeRotation>> EstimateAll(
      std::span<const PairMatches> matches,
      const std::function<Rotation(const PairMatches&)>& start_of) const;
  void Average(const std::set<FrameId>& free_views);

  PaperGraphOptions options_;
  ViewGraph graph_;
  RotationMap cam_from_world_;
};

/// The paper's solver: EstimateByEigensolver. All its edges have the same covariance, a tenth of a
/// degree, and no evidence about a baseline.
PairSolver EigensolverPairs();

}  // namespace rotslam
