#include "apps/cli/paper/paper_rotations.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "apps/cli/input/config.h"
#include "apps/paper_method/paper_odometry.h"
#include "apps/paper_method/paper_options.h"
#include "apps/slam/connected_frames.h"

namespace rotslam {
namespace {

PaperOdometryOptions OptionsOf(const SlamOptions& slam, const OrientationInputs& inputs) {
  PaperOdometryOptions options;
  options.odometry = slam.rotodom;
  options.use_loops = slam.loop.use_loops;
  options.candidates = slam.loop.candidates;
  options.vocabulary = inputs.vocabulary;
  options.seed = slam.seed;
  options.num_threads = slam.num_threads;
  return options;
}

LoopedEstimate EstimateOf(const PaperFrame& frame) {
  LoopedEstimate estimate;
  estimate.frame = frame.frame;
  estimate.cam_from_world = frame.cam_from_world;
  estimate.report.num_tracked = frame.num_features;
  for (const RelativeRotation& edge : frame.edges) {
    estimate.report.num_inliers = std::max(estimate.report.num_inliers, edge.num_inliers);
  }
  estimate.report.predicted_only = frame.predicted_only;
  estimate.loops = frame.loops;
  estimate.has_averaged = frame.has_averaged;
  return estimate;
}

// Sets what follows from all edges together.
void ClassifyFrames(const AveragingOptions& averaging, Orientations& orientations) {
  for (const auto& [frame, rotation] : orientations.cam_from_world) {
    if (orientations.graph.EdgesOf(frame).empty()) orientations.unconnected.insert(frame);
  }
  InterpolateUnknown(orientations, orientations.unconnected, orientations.cam_from_world);
  orientations.inlier_edges =
      CountInlierEdges(orientations.graph, orientations.cam_from_world, averaging);
  orientations.breaks = FindBreaks(orientations.graph, orientations.cam_from_world);
}

}  // namespace

RunOptions ReadPaperOptions(const CommonFlags& common, const InputFlags& input) {
  CommonFlags without_config = common;
  without_config.config.clear();
  RunOptions options = ReadRunOptions(without_config, input);
  options.rotodom = PaperDefaults();
  if (!common.config.empty()) LoadOptionsYaml(common.config, options);
  input.Override(options.sequence);
  input.Override(options.loop);
  return options;
}

Orientations FindPaperOrientations(FrameSource& frames,
                                   const Camera& camera,
                                   const SlamOptions& options,
                                   const OrientationInputs& inputs,
                                   SlamObserver& observer) {
  Orientations orientations;
  orientations.camera = camera;
  orientations.masks = inputs.masks;
  PaperOdometry odometry(camera, OptionsOf(options, inputs));
  observer.OnBegin(SlamStage::kOrientations, frames.NumFrames());
  while (!orientations.interrupted) {
    std::optional<Frame> frame = frames.Next();
    if (!frame) break;
    const Mask mask = frame->image.empty() ? Mask() : orientations.masks.Of(frame->name);
    const PaperFrame found = odometry.AddFrame(frame->id, {frame->image, mask});
    orientations.num_unreadable += frame->problem.empty() ? 0 : 1;
    orientations.timestamps_s.push_back(frame->timestamp_s);
    orientations.image_names.push_back(frame->name);
    orientations.thumbnails.push_back(MakeFrameThumbnail(frame->image));
    frame->image.release();
    const LoopedEstimate estimate = EstimateOf(found);
    orientations.reports.push_back(estimate.report);
    orientations.loops.insert(orientations.loops.end(), found.loops.begin(), found.loops.end());
    for (const RelativeRotation& edge : found.edges) orientations.graph.AddEdge(edge);
    orientations.cam_from_world[found.frame] = found.cam_from_world;
    observer.OnFrame({*frame, estimate, orientations});
    orientations.interrupted = observer.ShouldStop();
  }
  orientations.graph = odometry.graph();
  orientations.cam_from_world = odometry.cam_from_world();
  orientations.num_places = odometry.num_places();
  const PaperSeconds& seconds = odometry.seconds();
  orientations.seconds.detection = seconds.extraction;
  orientations.seconds.tracking = seconds.matching;
  orientations.seconds.edges = seconds.graph;
  orientations.loop_seconds.verification = seconds.loops;
  if (orientations.interrupted && !orientations.IsUsable()) return orientations;
  RequireFramesAndEdges(orientations);
  ClassifyFrames(options.rotodom.averaging, orientations);
  observer.OnEnd(SlamStage::kOrientations, orientations);
  return orientations;
}

}  // namespace rotslam
