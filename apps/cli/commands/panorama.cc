#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/cli/command.h"
#include "apps/cli/commands/stitching.h"
#include "apps/cli/input/input.h"
#include "apps/report/run_summary.h"
#include "output/files/atomic_file.h"
#include "output/tables/segments.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct PanoramaFlags {
  CommonFlags common;
  std::string run;
  std::string out;
  std::string sequence;
  std::string camera;
  std::optional<int> first;
  std::optional<int> last;
  std::optional<int> segment;
  bool plain_exposure = false;
  StitchOptions stitch;
};

// First and last frame, both included.
struct Frames {
  int first = 0;
  int last = 0;
};

Camera CameraOf(const nlohmann::ordered_json& summary, const std::string& path) {
  try {
    const nlohmann::ordered_json& json = summary.at("camera");
    Camera camera;
    const std::string model = json.at("model");
    const auto found = FindCameraModel(model);
    if (!found) throw std::runtime_error("model must be one of " + CameraModelNames());
    camera.model = *found;
    camera.width = json.at("width");
    camera.height = json.at("height");
    camera.fx = json.at("fx");
    camera.fy = json.at("fy");
    camera.cx = json.at("cx");
    camera.cy = json.at("cy");
    if (json.contains("distortion")) {
      const std::vector<double> distortion = json.at("distortion");
      if (distortion.size() > camera.distortion.size()) {
        throw std::runtime_error("distortion has " + std::to_string(distortion.size()) +
                                 " numbers, must be at most " +
                                 std::to_string(camera.distortion.size()));
      }
      std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
    }
    if (json.contains("readout_s")) camera.readout_s = json.at("readout_s");
    if (json.contains("readout_from")) {
      const auto start = FindReadoutStart(json.at("readout_from"));
      if (!start) throw std::runtime_error("readout_from must be top, bottom, left or right");
      camera.readout_from = *start;
    }
    if (const auto problem = camera.Problem()) throw std::runtime_error(*problem);
    return camera;
  } catch (const std::exception& error) {
    throw std::runtime_error(path + ": its camera cannot be used (" + error.what() +
                             "); give one with --camera FILE");
  }
}

Frames WithinRun(Frames frames, int num_frames) {
  if (frames.last < 0 || frames.last >= num_frames) frames.last = num_frames - 1;
  if (frames.first < 0 || frames.first > frames.last) {
    throw std::runtime_error("no frames from " + std::to_string(frames.first) + " to " +
                             std::to_string(frames.last) + ": the run has frames 0 to " +
                             std::to_string(num_frames - 1));
  }
  return frames;
}

// What --first and --last or --segment name; else the longest segment that rotates.
Frames ChooseFrames(const PanoramaFlags& flags, int num_frames) {
  if (flags.first || flags.last) {
    return WithinRun({flags.first.value_or(0), flags.last.value_or(-1)}, num_frames);
  }
  const fs::path path = fs::path(flags.run) / "segments.csv";
  if (!fs::exists(path)) {
    if (flags.segment) {
      throw std::runtime_error(path.string() +
                               ": is not there; name frames with --first and --last");
    }
    return WithinRun({0, -1}, num_frames);
  }
  const std::vector<Segment> segments = ReadSegmentsCsv(path);
  if (flags.segment) {
    if (*flags.segment < 0 || *flags.segment >= std::ssize(segments)) {
      throw std::runtime_error(path.string() + ": has no segment " +
                               std::to_string(*flags.segment) + "; there are " +
                               std::to_string(segments.size()) + ", counted from 0");
    }
    const Segment& segment = segments[*flags.segment];
    return WithinRun({segment.first_frame, segment.last_frame}, num_frames);
  }
  const Segment* longest = nullptr;
  const auto length = [](const Segment& segment) {
    return segment.last_frame - segment.first_frame;
  };
  for (const Segment& segment : segments) {
    if (segment.kind != "rotating") continue;
    if (longest == nullptr || length(segment) > length(*longest)) longest = &segment;
  }
  if (longest == nullptr) {
    throw std::runtime_error(path.string() +
                             ": the camera nowhere turns in one place; name frames with --first "
                             "and --last to stitch them all the same");
  }
  return WithinRun({longest->first_frame, longest->last_frame}, num_frames);
}

// Frames so far apart that each shows something new; most videos repeat themselves.
std::vector<int> Thinned(const Trajectory& poses, const Frames& frames, const Camera& camera) {
  constexpr double kNews = 0.04;  // of the image's width
  const double enough_rad = kNews * camera.width / camera.fx;
  std::vector<int> chosen = {frames.first};
  for (int n = frames.first + 1; n <= frames.last; ++n) {
    const Rotation turn = poses[n].world_from_cam * poses[chosen.back()].world_from_cam.Inverse();
    if (turn.Angle() >= enough_rad) chosen.push_back(n);
  }
  return chosen;
}

std::string SequencePath(const PanoramaFlags& flags, const nlohmann::ordered_json& summary) {
  if (!flags.sequence.empty()) return flags.sequence;
  const nlohmann::ordered_json& sequence = summary.at("sequence");
  if (!sequence.contains("path")) {
    throw std::runtime_error(flags.run + ": does not say where its images are; use --sequence");
  }
  return sequence.at("path");
}

void WriteImage(const fs::path& path, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  const std::string extension = path.extension().string();
  if (extension.empty() || !cv::haveImageWriter(path.string()) ||
      !cv::imencode(extension, image, bytes)) {
    throw std::runtime_error(path.string() + ": no picture format has this ending; use .png");
  }
  ReplaceFile(path, std::string(bytes.begin(), bytes.end()));
}

int MakePanorama(const PanoramaFlags& flags) {
  const fs::path run = flags.run;
  const nlohmann::ordered_json summary = ReadSummaryOf(run);
  const fs::path refined = run / "trajectory_tum.txt";
  const Trajectory poses =
      ReadTrajectory(fs::exists(refined) ? refined : run / "rotations_tum.txt");
  const Frames frames = ChooseFrames(flags, static_cast<int>(poses.size()));
  const std::string place = SequencePath(flags, summary);
  const SequenceOptions sequence_options = SequenceOptionsOf(summary);
  const auto opened = OpenSequence(place, sequence_options);
  const cv::Size size = opened->image_size();
  const Camera camera =
      MatchToImages(flags.camera.empty() ? CameraOf(summary, (run / "summary.json").string())
                                         : ReadCamera(ParseCameraReference(flags.camera),
                                                      opened->image_folder(),
                                                      {size.width, size.height}),
                    size);

  const std::vector<int> chosen = Thinned(poses, frames, camera);
  std::vector<Rotation> world_from_cam;
  world_from_cam.reserve(chosen.size());
  for (const int n : chosen) world_from_cam.push_back(poses[n].world_from_cam);
  const auto read_views = [&](const ViewVisitor& visit) {
    const std::unique_ptr<Sequence> sequence = OpenSequence(place, sequence_options);
    int next = 0;
    while (next < std::ssize(chosen)) {
      const std::optional<Frame> frame = sequence->Next();
      if (!frame) return;
      if (frame->id.value != chosen[next]) continue;
      if (!frame->image.empty()) visit(next, frame->image);
      ++next;
    }
  };
  StitchOptions stitch = flags.stitch;
  stitch.compensate_exposure = !flags.plain_exposure;
  stitch.num_threads = flags.common.NumThreads();
  const Panorama panorama = Stitch(camera, world_from_cam, read_views, stitch);
  WriteImage(flags.out, panorama.image);
  if (!flags.common.quiet) {
    std::printf("wrote %s: %d x %d, %.1f x %.1f deg from %zu of the frames %d to %d\n",
                flags.out.c_str(),
                panorama.image.cols,
                panorama.image.rows,
                panorama.width_deg,
                panorama.height_deg,
                chosen.size(),
                frames.first,
                frames.last);
  }
  return 0;
}

}  // namespace

void AddPanoramaCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<PanoramaFlags>();
  CLI::App* command = app.add_subcommand(
      "panorama", "Stitch the frames of a turn in place onto a sphere (equirectangular)");
  command->add_option("run", flags->run, "Folder that `run` or `rotations` has written to")
      ->required();
  command->add_option("--out", flags->out, "Picture to write")->required();
  command->add_option("--sequence", flags->sequence, "Where the images are now, if they moved");
  command->add_option("--camera", flags->camera, "Another calibration than the run's");
  auto* first = command->add_option("--first", flags->first, "First frame of the run to use");
  auto* last =
      command->add_option("--last", flags->last, "Last frame of the run to use; -1: to the end");
  command
      ->add_option("--segment",
                   flags->segment,
                   "Line of segments.csv to use, counted from 0; default: the longest that rotates")
      ->excludes(first)
      ->excludes(last);
  command->add_option("--width",
                      flags->stitch.width,
                      "Pixels of the whole circle; 0: as fine as the images, at most 8192");
  command->add_flag("--full", flags->stitch.full, "The whole sphere, also where nothing was seen");
  command->add_flag(
      "--plain-exposure", flags->plain_exposure, "Leave each frame as bright as it is");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam panorama runs/gimbal --out gimbal.png");
  command->callback([flags, &action] { action = [flags] { return MakePanorama(*flags); }; });
}

}  // namespace rotslam
