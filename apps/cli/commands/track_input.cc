#include "apps/cli/commands/track_input.h"

#include <iterator>
#include <utility>

#include "apps/cli/input/open_input.h"
#include "apps/cli/run_directory/orientation_files.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/terminal/describe.h"
#include "apps/slam/lens_estimation.h"
#include "apps/slam/orientation_collector.h"
#include "apps/slam/slam.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

WorkingSize WorkingSizeFor(const Input& input, const RunOptions& options, Progress& progress) {
  const WorkingSize working(input.sequence().image_size(), options.max_image_side_px);
  if (working.IsReduced()) {
    progress.Say("images are " + SizeText(working.image_size()) + "; worked at " +
                 SizeText(working.size()));
  }
  return working;
}

ReducedInput ReducedInputOf(const TrackedInput& tracked) {
  const Input& input = tracked.input;
  return {
      tracked.working, input.camera, input.masks, tracked.options.rotodom.features.scale_factor};
}

OrientationInputs MaskInputs(const TrackedInput& tracked) {
  const Input& input = tracked.input;
  OrientationInputs inputs;
  inputs.masks = input.masks.Reduced(tracked.working);
  inputs.find_static_content = input.find_static_content;
  inputs.static_content = input.static_content;
  return inputs;
}

// Estimates the lens of an input without a calibration; of another one nothing. A request to stop
// ends the program meanwhile: nothing is lost yet.
// @param refines  whether a map is built, which refines the lens.
// @return  seconds since the start.
double FindLensOf(TrackedInput& tracked, bool refines) {
  Input& input = tracked.input;
  if (!input.guess) return SecondsSince(tracked.start);
  SlamProgress observer(tracked.options, tracked.working, tracked.interruption, tracked.progress);
  const EndAtInterruption end_at_interruption(tracked.interruption, [&] {
    tracked.progress.Warn("interrupted while the lens is estimated: nothing is written yet");
  });
  const LensEstimate estimate =
      EstimateLens(tracked.frames,
                   {tracked.working.Reduced(input.camera), input.guess->KnowsFocal()},
                   tracked.options,
                   observer,
                   MaskInputs(tracked),
                   refines ? LensPurpose::kStart : LensPurpose::kCameraFile);
  input.camera = tracked.working.Original(estimate.camera);
  input.static_content = estimate.static_content;
  input.guess->is_found = estimate.is_found;
  tracked.progress.Say(estimate.is_found ? "lens: " + DescribeRounded(input.camera) +
                                               "; now the sequence from its start"
                                         : "lens: the images do not tell it, the guess stands");
  return SecondsSince(tracked.start);
}

Orientations TrackFrames(TrackedInput& tracked,
                         bool keep_features,
                         const TrackedInput::Tracking& track) {
  Input& input = tracked.input;
  OrientationInputs inputs = MaskInputs(tracked);
  inputs.vocabulary = tracked.vocabulary;
  inputs.keep_features = keep_features;
  inputs.given = input.given_rotations;
  inputs.log = &tracked.checkpoint;
  // For the maps by which zooms are followed.
  SlamOptions options = tracked.options;
  if (input.guess) FreeLens(PlainLens(tracked.working.Reduced(input.camera)), options.ba.lens);
  Orientations orientations = track ? track(tracked, inputs)
                                    : FindOrientations(tracked.frames,
                                                       tracked.working.Reduced(input.camera),
                                                       options,
                                                       inputs,
                                                       tracked.observer);
  if (!orientations.IsUsable()) {
    throw InterruptedError("interrupted after frame " +
                           std::to_string(std::ssize(orientations.timestamps_s) - 1) +
                           ": too early, nothing is written");
  }
  input.camera = tracked.working.Original(orientations.camera, input.camera);
  if (orientations.readout) input.readout = orientations.readout;
  return orientations;
}

}  // namespace

TrackedInput::TrackedInput(const std::string& command,
                           const TrackFlags& flags,
                           RunOptions run_options,
                           bool keep_features,
                           const Tracking& track)
    : progress(flags.common),
      options(std::move(run_options)),
      input(OpenInput(
          flags.input, options.sequence, [this](const std::string& line) { progress.Say(line); })),
      working(WorkingSizeFor(input, options, progress)),
      frames(*input.frames, working),
      vocabulary(OpenVocabulary(flags.input)),
      directory(PrepareRunDirectory(flags.input.out)),
      lens_s(FindLensOf(*this, keep_features)),
      checkpoint(directory,
                 flags.checkpoint,
                 IdentityOf(command, input, flags.input, options, flags.common.seed),
                 progress),
      observer(options, working, interruption, progress),
      orientations(TrackFrames(*this, keep_features, track)),
      outputs(directory) {
  orientations.working_scale = working.scale();
  WriteOrientations(outputs.folder(), orientations, options.rotodom.averaging);
  WriteCommonMask(outputs.folder(),
                  OriginalMasks(ReducedInputOf(*this), orientations.static_content));
}

void TrackedInput::ToOriginalSize() {
  rotslam::ToOriginalSize(ReducedInputOf(*this), orientations);
}

void TrackedInput::ToOriginalSize(MapResult& map) const {
  rotslam::ToOriginalSize(ReducedInputOf(*this), map);
}

}  // namespace rotslam
