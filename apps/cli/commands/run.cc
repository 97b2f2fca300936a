#include <cstdio>
#include <iterator>
#include <memory>
#include <stdexcept>

#include "apps/cli/command.h"
#include "apps/cli/commands/track_input.h"
#include "apps/cli/input/option_texts.h"
#include "apps/cli/run_directory/map_files.h"
#include "apps/cli/run_directory/orientation_files.h"
#include "apps/cli/run_directory/position_files.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/cli/run_directory/summary_parts.h"
#include "apps/cli/terminal/describe.h"
#include "apps/report/run_check.h"
#include "apps/slam/build_map.h"
#include "apps/slam/lens_estimation.h"
#include "apps/slam/map/stated_sigmas.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

struct RunFlags {
  TrackFlags track;
  KrotFlags krot;
  bool ascii = false;
  bool use_report = true;
  bool prints_config = false;
};

RunOptions RunOptionsOf(const RunFlags& flags) {
  RunOptions options = ReadRunOptions(flags.track.common, flags.track.input);
  flags.krot.Override(options.krot);
  return options;
}

// The first frame of a component of the map, as segments.csv has it. Its first keyframes may lie
// before that frame, in the pure-rotation segment at the end of the component before.
int FirstFrame(const std::vector<Segment>& segments, const MapComponent& part, int number) {
  for (const Segment& segment : segments) {
    if (segment.component == number) return segment.first_frame;
  }
  return part.keyframes.begin()->value;
}

void WriteInterrupted(const TrackedInput& tracked, double orientations_s) {
  RunSummary summary =
      StartSummary("run", tracked.input, tracked.orientations, DescribeOptions(tracked.options));
  summary.interrupted = true;
  if (tracked.input.guess) summary.seconds.push_back({"lens", tracked.lens_s});
  summary.seconds.push_back({"orientations", orientations_s});
  summary.seconds.push_back({"total", SecondsSince(tracked.start)});
  WriteSummary(tracked.outputs.folder() / "summary.json", summary);
  tracked.outputs.Publish();
}

// Whether the camera rotates throughout and another lens than the given one explains its images.
bool RotatesByLens(const MapResult& positions, const Input& input) {
  return positions.rotates_throughout && positions.camera != input.camera;
}

RunSummary SummariseRun(const TrackedInput& tracked, const MapResult& positions) {
  const Input& input = tracked.input;
  RunSummary summary =
      StartSummary("run", input, tracked.orientations, DescribeOptions(tracked.options));
  AddPositions(positions, input.camera, summary);
  if (RotatesByLens(positions, input)) {
    summary.calibration = {{"source", "pure_rotation"},
                           {"given_px", input.camera.MeanFocal()},
                           {"refined_px", positions.camera.MeanFocal()}};
  }
  if (input.guess) {
    summary.calibration = SummaryOf(*input.guess, positions.camera);
    summary.seconds.push_back({"lens", tracked.lens_s});
  }
  return summary;
}

// Warns of scales that are a guess, of a lens that was estimated and of a map without positions.
void Warn(const TrackedInput& tracked,
          const MapResult& positions,
          const std::vector<Segment>& segments,
          Progress& progress) {
  const Input& input = tracked.input;
  for (int k = 1; k < std::ssize(positions.components); ++k) {
    progress.Warn("the map from frame " +
                  std::to_string(FirstFrame(segments, positions.components[k], k)) +
                  " on shares no points with the part before: its scale is a guess, so that the "
                  "scene stays as far away as it was, and distances there may be too long or too "
                  "short. Film such changes of view more slowly, with part of the old view in the "
                  "picture");
  }
  if (input.guess) progress.Warn(WarningOf(*input.guess, positions.camera));
  if (!positions.rotates_throughout || tracked.orientations.CameraStands()) return;
  progress.Warn(
      "the camera never leaves its place (it rests, rotates or trembles): the result has "
      "orientations, no positions and no points. For a map, walk while you film" +
      (RotatesByLens(positions, input)
           ? ". With the calibration given the camera seems to move; without movement "
             "this one fits better: " +
                 DescribeRounded(positions.camera)
           : std::string()));
}

// Drops the fields of features that only tracking and lens estimation read.
void DropTrackingFields(Orientations& orientations) {
  for (auto& [frame, features] : orientations.features) {
    features.covariances_px = {};
    features.tracks = {};
  }
}

// Writes the files of a finished run into the folder of unfinished outputs, and publishes them.
// @param positions  loses the tracks of its cloud, as WriteMaps says.
// @param taken_out  as WriteFocalLengths takes it.
RunSummary WriteRun(TrackedInput& tracked,
                    MapResult& positions,
                    const Camera& taken_out,
                    PlyForm ply,
                    double orientations_s) {
  const double positions_s = SecondsSince(tracked.start) - orientations_s - tracked.lens_s;
  const std::filesystem::path& folder = tracked.outputs.folder();
  const Orientations& orientations = tracked.orientations;
  WritePositions(folder, orientations, positions, ply);
  WriteFocalLengths(folder, orientations, positions, taken_out);
  WriteKnownRotationInput(folder,
                          orientations,
                          positions,
                          positions.through_lens ? positions.camera : tracked.input.camera);
  FeatureOptions features = tracked.options.rotodom.features;
  features.num_levels += tracked.working.NumLevelsBelow(features.scale_factor);
  WriteCameraYaml(folder / "camera.yaml", positions.camera, positions.lens_sigmas);
  WriteMaps(folder, tracked.input.sequence(), orientations, positions, features);
  RunSummary summary = SummariseRun(tracked, positions);
  summary.seconds.push_back({"orientations", orientations_s});
  summary.seconds.push_back({"positions", positions_s});
  summary.seconds.push_back({"total", SecondsSince(tracked.start)});
  WriteSummary(folder / "summary.json", summary);
  tracked.outputs.Publish();
  return summary;
}

// Writes the report from the files of the run. Data that are in these leave the memory first.
void WriteReport(TrackedInput& tracked, MapResult& positions, const CommonFlags& flags) {
  tracked.orientations.features.clear();
  tracked.orientations.edge_matches = {};
  tracked.orientations.places.clear();
  positions.map.tracks = positions.keyframe_tracks = {};
  WriteReportOfRun(tracked.directory, flags, tracked.progress);
}

}  // namespace

int FinishRun(TrackedInput& tracked, const RunOutputFlags& flags) {
  const Input& input = tracked.input;
  Orientations& orientations = tracked.orientations;
  Progress& progress = tracked.progress;
  if (input.guess) {
    FreeLens(PlainLens(tracked.working.Reduced(input.camera)), tracked.options.ba.lens);
  } else if (input.lens_sigmas) {
    TakeStatedSigmas(*input.lens_sigmas, input.camera, tracked.options.ba.lens);
  }
  const double orientations_s = SecondsSince(tracked.start) - tracked.lens_s;
  const auto end_early = [&] {
    WriteInterrupted(tracked, orientations_s);
    progress.Warn(DescribeInterrupted(tracked.directory, orientations, tracked.checkpoint));
  };
  if (orientations.interrupted) {
    end_early();
    return Interruption::kExitCode;
  }

  DropTrackingFields(orientations);
  MapResult positions = [&] {
    const EndAtInterruption end_at_interruption(tracked.interruption, end_early);
    return BuildMap(orientations, tracked.options, &tracked.frames, tracked.observer);
  }();
  const Camera taken_out = tracked.working.Original(orientations.camera);
  if (positions.through_lens) {
    TakeThroughLens(positions, orientations);
    WriteOrientations(tracked.outputs.folder(), orientations, tracked.options.rotodom.averaging);
  }
  tracked.ToOriginalSize(positions);
  tracked.ToOriginalSize();
  const RunSummary summary = WriteRun(tracked,
                                      positions,
                                      taken_out,
                                      flags.ascii ? PlyForm::kAscii : PlyForm::kBinary,
                                      orientations_s);

  Warn(tracked, positions, *summary.segments, progress);
  for (const CheckReason& reason : CheckRun(tracked.directory).reasons) {
    if (reason.warns) progress.Warn(reason.frames + ": " + reason.text);
  }
  if (flags.use_report) WriteReport(tracked, positions, flags.common);
  tracked.checkpoint.Remove();
  progress.Say("wrote " + tracked.directory.string() +
               ": trajectory_tum.txt, trajectory_kitti.txt, keyframes_tum.txt, "
               "rotations_tum.txt, rotations.csv, loops.csv, cloud.ply, cameras.ply, segments.csv, "
               "poses.csv, view_graph.g2o, known_rotation.txt, map.bin, map_all_frames.bin, "
               "matches.bin, thumbnails.bin, camera.yaml, summary.json" +
               (flags.use_report ? ", report.html" : ""));
  if (positions.failure.empty()) {
    return tracked.interruption.IsRequested() ? Interruption::kExitCode : 0;
  }
  throw std::runtime_error("orientations are in " + tracked.directory.string() +
                           ", positions are not: " + positions.failure);
}

namespace {

int Run(const RunFlags& flags) {
  TrackedInput tracked("run", flags.track, RunOptionsOf(flags), true);
  return FinishRun(tracked, {flags.ascii, flags.use_report, flags.track.common});
}

int PrintConfig(const RunFlags& flags) {
  RunOptions options = RunOptionsOf(flags);
  std::fputs(OptionsAsYaml(ListOptions(options)).c_str(), stdout);
  return 0;
}

// A flag that needs neither a sequence nor a folder for results.
void AddPrintConfigFlag(CLI::App& command, RunFlags& flags) {
  command
      .add_flag_callback(
          "--print-config",
          [&command, &flags] {
            flags.prints_config = true;
            for (CLI::Option* option : command.get_options()) option->required(false);
          },
          "Print all options as YAML for --config, with values, units and explanations, and end")
      ->trigger_on_parse();
}

}  // namespace

void AddRunCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<RunFlags>();
  CLI::App* command = app.add_subcommand(
      "run", "The whole chain: a sequence goes in, a trajectory and a point cloud come out");
  AddInputFlags(*command, flags->track.input);
  AddCheckpointFlags(*command, flags->track.checkpoint);
  AddKrotFlags(*command, flags->krot);
  auto* rotations = command->add_option(
      "--rotations",
      flags->track.input.rotations,
      "Orientations from elsewhere (a gimbal, an IMU, another SLAM), camera->world: a TUM file or "
      "a rotations.csv. They count as much as they agree with the images, which fill their gaps");
  command
      ->add_flag("--align",
                 flags->track.input.align,
                 "Take out their offset in time and the rotation between their axes and the "
                 "camera's, both estimated from the images")
      ->needs(rotations);
  command->add_flag("--ascii", flags->ascii, "Write the PLY files as text");
  AddReportFlag(*command, flags->use_report);
  AddCommonFlags(*command, flags->track.common);
  AddPrintConfigFlag(*command, *flags);
  command->footer("Example: rotslam run kitti/sequences/00 --out runs/kitti00");
  command->callback([flags, &action] {
    action = [flags] { return flags->prints_config ? PrintConfig(*flags) : Run(*flags); };
  });
}

}  // namespace rotslam
