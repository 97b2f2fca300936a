#include <cstdio>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include <unistd.h>

#include "apps/cli/command.h"
#include "apps/cli/commands/track_input.h"
#include "apps/cli/input/open_input.h"
#include "apps/cli/live/live_page.h"
#include "apps/cli/live/live_session.h"
#include "apps/cli/live/stream_sources.h"
#include "apps/cli/run_directory/run_directory.h"
#include "apps/cli/run_directory/run_report.h"
#include "apps/slam/live/live_slam.h"
#include "apps/slam/orientation_collector.h"
#include "rotodom/camera/read_camera.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct LiveFlags {
  TrackFlags track;
  std::string poses;
  bool realtime = false;
  bool follow = false;
  bool drop = false;
  bool wait = false;
  LivePageFlags page;
  bool ascii = false;
  bool use_report = true;

  bool IsStream() const {
    const std::string& source = track.input.sequence;
    return source == "-" || follow || IsCaptureSource(source);
  }
  // Cameras do not wait; files do.
  Backlog BacklogOr(Backlog usual) const {
    if (drop) return Backlog::kDrop;
    return wait ? Backlog::kWait : usual;
  }
};

LiveOutputs OpenOutputs(const LiveFlags& flags, const Camera& camera, Progress& progress) {
  LiveOutputs outputs;
  if (!flags.poses.empty()) outputs.poses = OpenPoseOutput(flags.poses);
  outputs.show = OpenLivePage(flags.page, camera, progress);
  return outputs;
}

// The frames of a sequence on disk, at the size that is worked with.
FramePump::Source FramesOf(FrameSource& frames, bool realtime) {
  FramePump::Source source = [&frames](const std::function<bool()>& is_over) {
    return is_over() ? std::nullopt : frames.Next();
  };
  return realtime ? Paced(std::move(source)) : source;
}

// Seven parameters: objects of two callers that live in different scopes there.
LiveSummary RunOnSequence(const LiveFlags& flags,
                          FrameSource& frames,
                          const cv::Size& size,
                          LiveSlam& slam,
                          const Camera& camera,
                          const Interruption& interruption,
                          Progress& progress) {
  const LiveOutputs outputs = OpenOutputs(flags, camera, progress);
  FramePump pump(FramesOf(frames, flags.realtime),
                 flags.BacklogOr(flags.realtime ? Backlog::kDrop : Backlog::kWait));
  return RunLiveSession(
      pump, slam, size, outputs, [&] { return interruption.IsRequested(); }, progress);
}

RunOutputFlags OutputFlagsOf(const LiveFlags& flags) {
  return {flags.ascii, flags.use_report, flags.track.common};
}

// The inputs of FindOrientations beside the frames.
struct TrackingInputs {
  const Camera& camera;
  const SlamOptions& options;
  const OrientationInputs& inputs;
  SlamObserver& observer;
};

// A session that has left out frames has numbered them differently from `run`. All frames that were
// read are then tracked again, as `run` does.
Orientations FinishSession(LiveSlam& slam,
                           const LiveSummary& summary,
                           FrameSource& seen,
                           const TrackingInputs& again) {
  if (summary.num_dropped == 0) return slam.FinishOrientations(&seen, again.observer);
  seen.Rewind();
  return FindOrientations(seen, again.camera, again.options, again.inputs, again.observer);
}

constexpr const char* kEmitted = "live_trajectory_tum.txt";

// A sequence on disk, whose images can be read again.
int LiveFromSequence(const LiveFlags& flags) {
  const RunOptions options = ReadRunOptions(flags.track.common, flags.track.input);
  if (flags.track.input.out.empty()) {
    Interruption interruption;
    Progress progress(flags.track.common);
    Input input = OpenInput(
        flags.track.input, options.sequence, [&](const std::string& line) { progress.Say(line); });
    if (input.guess) {
      throw std::runtime_error(
          flags.track.input.sequence +
          ": there is no calibration: give --camera FILE, or --out, with which "
          "the lens is estimated first");
    }
    SlamInputs inputs;
    inputs.masks = input.masks;
    inputs.vocabulary = OpenVocabulary(flags.track.input);
    inputs.find_static_content = input.find_static_content;
    LiveSlam slam(input.camera, options, {}, inputs);
    RunOnSequence(flags,
                  *input.frames,
                  input.sequence().image_size(),
                  slam,
                  input.camera,
                  interruption,
                  progress);
    return interruption.IsRequested() ? Interruption::kExitCode : 0;
  }
  LiveSummary summary;
  const auto track = [&](TrackedInput& tracked, const OrientationInputs& found) {
    const Camera camera = tracked.working.Reduced(tracked.input.camera);
    SlamInputs inputs;
    static_cast<OrientationInputs&>(inputs) = found;
    LiveSlam slam(camera, tracked.options, {}, inputs);
    summary = RunOnSequence(flags,
                            tracked.frames,
                            tracked.working.size(),
                            slam,
                            camera,
                            tracked.interruption,
                            tracked.progress);
    tracked.interruption.Answer();
    FirstFrames seen(tracked.frames, summary.num_read);
    return FinishSession(slam, summary, seen, {camera, tracked.options, found, tracked.observer});
  };
  TrackedInput tracked("live", flags.track, options, true, track);
  WriteEmitted(tracked.outputs.folder() / kEmitted, summary);
  return FinishRun(tracked, OutputFlagsOf(flags));
}

// Throws std::runtime_error where a flag does not suit frames that come once.
void CheckStreamFlags(const InputFlags& input) {
  if (input.camera.empty() || input.camera == "none") {
    throw std::runtime_error(input.sequence +
                             ": a camera needs its calibration, give --camera FILE; `rotslam "
                             "calibrate` makes one from any film");
  }
  if (input.first || input.last) {
    throw std::runtime_error(input.sequence + ": --first and --last are for files");
  }
}

FramePump::Source OpenStream(const LiveFlags& flags, const std::optional<fs::path>& folder) {
  const InputFlags& input = flags.track.input;
  const ArrivalTimes times = {input.fps};
  if (input.sequence == "-") return ImageStream(STDIN_FILENO, times, folder);
  return flags.follow ? FollowedFolder(input.sequence, times, folder)
                      : CaptureStream(input.sequence, times, folder);
}

Camera CameraOfStream(const InputFlags& input) {
  Camera camera = ReadCamera(ParseCameraReference(input.camera));
  if (camera.width <= 0 || camera.height <= 0) {
    throw std::runtime_error(input.camera +
                             ": does not say the size of its images; add width and height");
  }
  return camera;
}

SlamInputs InputsOfStream(const InputFlags& input, const Camera& camera) {
  SlamInputs inputs;
  inputs.vocabulary = OpenVocabulary(input);
  inputs.find_static_content = input.auto_mask;
  if (!input.mask.empty()) {
    inputs.masks.AddToAll(ReadMask(input.mask, {camera.width, camera.height}));
  }
  return inputs;
}

// Frames that come once: the images are kept beside the results, as an input for `run`.
int LiveFromStream(const LiveFlags& flags) {
  const InputFlags& input = flags.track.input;
  CheckStreamFlags(input);
  const RunOptions options = ReadRunOptions(flags.track.common, input);
  std::optional<fs::path> folder;
  if (!input.out.empty()) folder = PrepareRunDirectory(input.out) / "frames";
  if (folder && flags.follow && fs::exists(*folder) && fs::equivalent(*folder, input.sequence)) {
    throw std::runtime_error(input.sequence + ": images are kept there; give another --out");
  }
  LiveSummary summary;
  std::unique_ptr<LiveSlam> slam;
  {
    Interruption interruption;
    Progress progress(flags.track.common);
    const FramePump::Source source = OpenStream(flags, folder);
    const Camera camera = CameraOfStream(input);
    slam =
        std::make_unique<LiveSlam>(camera, options, LiveOptions(), InputsOfStream(input, camera));
    const LiveOutputs outputs = OpenOutputs(flags, camera, progress);
    FramePump pump(source, flags.BacklogOr(Backlog::kDrop));
    summary = RunLiveSession(
        pump,
        *slam,
        {camera.width, camera.height},
        outputs,
        [&] { return interruption.IsRequested(); },
        progress);
    if (summary.num_frames == 0) {
      throw std::runtime_error((input.sequence == "-" ? "standard input" : input.sequence) +
                               ": no image came");
    }
    if (!folder) return 0;
  }
  LiveFlags again = flags;
  again.track.input.sequence = folder->string();
  again.track.input.fps.reset();
  const auto track = [&](TrackedInput& tracked, const OrientationInputs& found) {
    FirstFrames seen(tracked.frames, summary.num_read);
    const Camera camera = tracked.working.Reduced(tracked.input.camera);
    return FinishSession(*slam, summary, seen, {camera, tracked.options, found, tracked.observer});
  };
  TrackedInput tracked("live", again.track, options, true, track);
  WriteEmitted(tracked.outputs.folder() / kEmitted, summary);
  return FinishRun(tracked, OutputFlagsOf(flags));
}

void AddSourceFlags(CLI::App& command, LiveFlags& flags) {
  InputFlags& input = flags.track.input;
  command
      .add_option(
          "source",
          input.sequence,
          "What `run` takes; a video device (/dev/video0) or address (rtsp://, http://); `-`: "
          "JPEG or PNG images on standard input")
      ->required();
  command.add_option(
      "--camera", input.camera, "Calibration, of several cameras FILE:NAME; a stream needs one");
  command.add_option(
      "--out", input.out, "Folder for the results of a run; without it, none are written");
  command.add_option("--fps", input.fps, "Frames per second where the source has no timestamps");
  command.add_option("--first", input.first, "First input frame to use");
  command.add_option("--last", input.last, "Last input frame to use; -1: to the end");
  command.add_option("--mask", input.mask, "As of `run`");
  command.add_option("--vocabulary", input.vocabulary, "As of `run`");
  command.add_flag(
      "--realtime", flags.realtime, "Give the frames of files at the pace of their timestamps");
  command.add_flag(
      "--follow", flags.follow, "Take images as they appear in a folder, until Ctrl-C");
  CLI::Option* drop = command.add_flag(
      "--drop",
      flags.drop,
      "Leave frames out that come too fast (the default of cameras and --realtime)");
  command.add_flag("--wait", flags.wait, "Take every frame (the default of files)")->excludes(drop);
}

}  // namespace

void AddLiveCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<LiveFlags>();
  flags->track.checkpoint.every = 0;
  CLI::App* command = app.add_subcommand(
      "live", "A pose for every frame at once, and a map that grows, while the camera runs");
  AddSourceFlags(*command, *flags);
  command->add_option("--poses",
                      flags->poses,
                      "Where every pose goes at once: - (standard output), a file or "
                      "udp://HOST:PORT");
  AddLivePageFlags(*command, flags->page);
  command->add_flag("--ascii", flags->ascii, "Write the PLY files as text");
  AddReportFlag(*command, flags->use_report);
  AddCommonFlags(*command, flags->track.common);
  command->footer("Example: rotslam live /dev/video0 --camera webcam.yaml --view --out runs/desk");
  command->callback([flags, &action] {
    action = [flags] {
      return flags->IsStream() ? LiveFromStream(*flags) : LiveFromSequence(*flags);
    };
  });
}

}  // namespace rotslam
