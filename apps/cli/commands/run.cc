#include <chrono>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <utility>

#include "apps/cli/command.h"
#include "apps/cli/commands/track_input.h"
#include "apps/cli/input/open_input.h"
#include "apps/cli/input/option_texts.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/terminal/describe.h"
#include "apps/cli/terminal/interruption.h"
#include "apps/cli/terminal/progress.h"
#include "apps/cli/terminal/slam_progress.h"
#include "apps/slam/build_map.h"
#include "apps/slam/focal_length.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

struct RunFlags {
  CommonFlags common;
  InputFlags input;
  CheckpointFlags checkpoint;
  KrotFlags krot;
  bool ascii = false;
  bool use_report = true;
};

// The first frame of a component of the map, as segments.csv has it. Its first keyframes may lie
// before that frame, in the pure-rotation segment at the end of the component before.
int FirstFrame(const std::vector<Segment>& segments, const MapComponent& part, int number) {
  for (const Segment& segment : segments) {
    if (segment.component == number) return segment.first_frame;
  }
  return part.keyframes.begin()->value;
}

int Run(const RunFlags& flags) {
  const Clock::time_point start = Clock::now();
  Interruption interruption;
  Progress progress(flags.common);
  RunOptions options = ReadRunOptions(flags.common, flags.input);
  flags.krot.Override(options.krot);

  Input input = OpenInput(
      flags.input, options.sequence, [&](const std::string& line) { progress.Say(line); });
  auto vocabulary = OpenVocabulary(flags.input);
  const std::filesystem::path directory = PrepareRunDirectory(flags.input.out);
  RefineGuess(options, interruption, progress, input);
  const double guess_s = SecondsSince(start);
  Checkpoint checkpoint(directory,
                        flags.checkpoint,
                        IdentityOf("run", input, flags.input, options, flags.common.seed),
                        progress);
  if (input.guess) FreeFocalLength(options.ba.lens);
  SlamProgress observer(options, interruption, progress);
  const Orientations orientations =
      TrackInput(options, std::move(vocabulary), true, observer, checkpoint, input);
  const UnfinishedOutputs outputs(directory);
  WriteOrientations(outputs.folder(), orientations);
  const double orientations_s = SecondsSince(start) - guess_s;
  const auto end_early = [&] {
    RunSummary summary = StartSummary("run", input, orientations, DescribeOptions(options));
    summary.interrupted = true;
    if (input.guess) summary.seconds.push_back({"focal_guess", guess_s});
    summary.seconds.push_back({"orientations", orientations_s});
    summary.seconds.push_back({"total", SecondsSince(start)});
    WriteSummary(outputs.folder() / "summary.json", summary);
    outputs.Publish();
    progress.Warn(DescribeInterrupted(directory, orientations, checkpoint));
  };
  if (orientations.interrupted) {
    end_early();
    return Interruption::kExitCode;
  }

  const MapResult positions = [&] {
    const EndAtInterruption end_at_interruption(interruption, end_early);
    return BuildMap(orientations, options, input.frames.get(), observer);
  }();
  const double positions_s = SecondsSince(start) - orientations_s - guess_s;
  WritePositions(outputs.folder(),
                 orientations,
                 positions,
                 positions.camera,
                 flags.ascii ? PlyForm::kAscii : PlyForm::kBinary);
  WriteKnownRotationInput(outputs.folder(), orientations, positions, input.camera);
  WriteMaps(outputs.folder(), input.sequence(), orientations, positions, options.rotodom.features);

  RunSummary summary = StartSummary("run", input, orientations, DescribeOptions(options));
  AddPositions(positions, input.camera, summary);
  const bool rotates_by_lens = positions.rotates_throughout && positions.camera != input.camera;
  if (rotates_by_lens) {
    summary.calibration = {{"source", "pure_rotation"},
                           {"given_px", input.camera.MeanFocal()},
                           {"refined_px", positions.camera.MeanFocal()}};
  }
  if (input.guess) summary.calibration = SummaryOf(*input.guess, positions.camera);
  if (input.guess) summary.seconds.push_back({"focal_guess", guess_s});
  summary.seconds.push_back({"orientations", orientations_s});
  summary.seconds.push_back({"positions", positions_s});
  summary.seconds.push_back({"total", SecondsSince(start)});
  WriteSummary(outputs.folder() / "summary.json", summary);
  outputs.Publish();

  for (int k = 1; k < std::ssize(positions.components); ++k) {
    progress.Warn("the map from frame " +
                  std::to_string(FirstFrame(*summary.segments, positions.components[k], k)) +
                  " on shares no points with the part before: its scale is a guess, so that the "
                  "scene stays as far away as it was, and distances there may be too long or too "
                  "short. Film such changes of view more slowly, with part of the old view in the "
                  "picture");
  }
  if (input.guess) progress.Warn(WarningOf(*input.guess, positions.camera));
  if (positions.rotates_throughout) {
    progress.Warn(
        "the camera never leaves its place, it only rotates: the result has orientations, no "
        "positions and no points. For a map, walk while you film" +
        (rotates_by_lens
             ? ". With the calibration given the camera seems to move; without movement "
               "this one fits better: " +
                   DescribeRounded(positions.camera)
             : std::string()));
  }
  if (flags.use_report) WriteReportOfRun(directory, flags.common, progress);
  checkpoint.Remove();
  progress.Say("wrote " + directory.string() +
               ": trajectory_tum.txt, trajectory_kitti.txt, keyframes_tum.txt, "
               "rotations_tum.txt, rotations.csv, loops.csv, cloud.ply, cameras.ply, segments.csv, "
               "view_graph.g2o, "
               "known_rotation.txt, map.bin, map_all_frames.bin, summary.json" +
               (flags.use_report ? ", report.html" : ""));
  if (positions.failure.empty()) {
    return interruption.IsRequested() ? Interruption::kExitCode : 0;
  }
  throw std::runtime_error("orientations are in " + directory.string() +
                           ", positions are not: " + positions.failure);
}

// Prints the options as they would be used, and ends the program.
void AddPrintConfigFlag(CLI::App& command, const RunFlags& flags) {
  command.add_flag_callback(
      "--print-config",
      [&flags] {
        RunOptions options = ReadRunOptions(flags.common, flags.input);
        flags.krot.Override(options.krot);
        std::fputs(OptionsAsYaml(ListOptions(options)).c_str(), stdout);
        throw CLI::Success();
      },
      "Print all options as YAML for --config, with values, units and explanations, and end");
}

}  // namespace

void AddRunCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<RunFlags>();
  CLI::App* command = app.add_subcommand(
      "run", "The whole chain: a sequence goes in, a trajectory and a point cloud come out");
  AddInputFlags(*command, flags->input);
  AddCheckpointFlags(*command, flags->checkpoint);
  AddKrotFlags(*command, flags->krot);
  command->add_option(
      "--rotations",
      flags->input.rotations,
      "Orientations from elsewhere (a gimbal, an IMU, another SLAM), camera->world: "
      "a TUM file or a rotations.csv; the images then give tracks and positions");
  command->add_flag("--ascii", flags->ascii, "Write the PLY files as text");
  AddReportFlag(*command, flags->use_report);
  AddCommonFlags(*command, flags->common);
  // The last one: what stands in front of it is read first.
  AddPrintConfigFlag(*command, *flags);
  command->footer("Example: rotslam run kitti/sequences/00 --out runs/kitti00");
  command->callback([flags, &action] { action = [flags] { return Run(*flags); }; });
}

}  // namespace rotslam
