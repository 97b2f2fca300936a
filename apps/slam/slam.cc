#include "apps/slam/slam.h"

#include <stdexcept>
#include <vector>

#include "apps/slam/orientation_collector.h"
#include "apps/slam/working_size/original_size.h"

namespace rotslam {

FrameMasks OriginalMasks(const ReducedInput& input, const StaticContent& found) {
  FrameMasks masks = input.masks;
  masks.AddToAll(input.working.Original(found.mask));
  return masks;
}

void ToOriginalSize(const ReducedInput& input, Orientations& orientations) {
  const WorkingSize& working = input.working;
  orientations.working_scale = working.scale();
  if (!working.IsReduced()) return;
  orientations.camera = working.Original(orientations.camera, input.camera);
  orientations.masks = OriginalMasks(input, orientations.static_content);
  orientations.static_content.mask = working.Original(orientations.static_content.mask);
  if (orientations.readout) ToOriginalSize(working, *orientations.readout);
  ToOriginalSize(working, orientations.graph);
  for (auto& [frame, features] : orientations.features) {
    ToOriginalSize(working, input.level_scale, features);
  }
  for (auto& [frame, features] : orientations.places) {
    ToOriginalSize(working, input.level_scale, features);
  }
}

void ToOriginalSize(const ReducedInput& input, MapResult& map) {
  const WorkingSize& working = input.working;
  if (!working.IsReduced()) return;
  map.camera = working.Original(map.camera, input.camera);
  for (std::vector<Track>* tracks : {&map.map.tracks, &map.cloud.tracks, &map.keyframe_tracks}) {
    ToOriginalSize(working, *tracks);
  }
  for (BundleSummary& bundle : map.bundles) ToOriginalSize(working, bundle);
  ToOriginalSize(working, map.lens_sigmas);
}

namespace {

void ToOriginalSize(const ReducedInput& input, LensEstimate& estimate) {
  const WorkingSize& working = input.working;
  if (!working.IsReduced()) return;
  estimate.camera = working.Original(estimate.camera, input.camera);
  ToOriginalSize(working, estimate.sigmas);
  estimate.static_content.mask = working.Original(estimate.static_content.mask);
}

}  // namespace

SlamResult RunSlam(FrameSource& original_frames,
                   const Camera& camera,
                   const SlamOptions& given_options,
                   SlamObserver& observer,
                   const SlamInputs& inputs) {
  if (const auto problem = given_options.Problem()) {
    throw std::invalid_argument("SlamOptions: " + *problem);
  }
  SlamOptions options = given_options;
  const WorkingSize working({camera.width, camera.height}, options.max_image_side_px);
  ReducedFrames frames(original_frames, working);
  OrientationInputs known = inputs;
  known.masks = inputs.masks.Reduced(working);
  known.static_content.mask = working.Reduced(inputs.static_content.mask);
  const ReducedInput reduced = {
      working, camera, inputs.masks, options.rotodom.features.scale_factor};
  SlamResult result;
  Camera found = working.Reduced(camera);
  if (inputs.estimate_lens) {
    result.lens = EstimateLens(
        frames, {found, inputs.knows_focal}, options, observer, known, LensPurpose::kStart);
    found = result.lens->camera;
    FreeLens(PlainLens(found), options.ba.lens);
    known.static_content = result.lens->static_content;
    ToOriginalSize(reduced, *result.lens);
  }
  result.orientations = FindOrientations(frames, found, options, known, observer);
  if (!result.orientations.interrupted) {
    result.map = BuildMap(result.orientations, options, &frames, observer);
    TakeThroughLens(result.map, result.orientations);
    ToOriginalSize(reduced, result.map);
  }
  ToOriginalSize(reduced, result.orientations);
  return result;
}

SlamResult RunSlam(FrameSource& frames, const Camera& camera, const SlamOptions& options) {
  SlamObserver nobody;
  return RunSlam(frames, camera, options, nobody);
}

}  // namespace rotslam
