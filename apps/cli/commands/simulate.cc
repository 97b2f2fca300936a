#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include <unistd.h>

#include "apps/cli/command.h"
#include "apps/simulation/simulation.h"
#include "apps/simulation/write.h"
#include "rotodom/camera/read_camera.h"

namespace rotslam {
namespace {

struct SimulateFlags {
  CommonFlags common;
  SimulationOptions simulation;
  std::string kind;
  std::string turn_axis = Name(TurnAxis::kYaw);
  std::string out;
  std::string layout = "tum";
  std::string camera;
  int width = 640;
  int height = 480;
  double hfov_deg = 65.0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = -1.0;
  double cy = -1.0;
  double readout_s = 0.0;
};

Camera CameraOf(const SimulateFlags& flags) {
  if (!flags.camera.empty()) {
    Camera camera = ReadCamera(ParseCameraReference(flags.camera), {}, {flags.width, flags.height});
    if (camera.width == 0) {
      camera.width = flags.width;
      camera.height = flags.height;
    }
    return camera;
  }
  Camera camera = CameraWithView(flags.width, flags.height, flags.hfov_deg);
  if (flags.fx > 0.0) camera.fx = camera.fy = flags.fx;
  if (flags.fy > 0.0) camera.fy = flags.fy;
  if (flags.cx >= 0.0) camera.cx = flags.cx;
  if (flags.cy >= 0.0) camera.cy = flags.cy;
  camera.readout_s = flags.readout_s;
  camera.knows_readout = true;
  return camera;
}

int Simulate(const SimulateFlags& flags) {
  if (!flags.common.config.empty()) {
    throw std::invalid_argument(
        "simulate takes its options from the command line, not from --config");
  }
  SimulationOptions options = flags.simulation;
  options.seed = flags.common.seed;
  for (const SimulationKind kind :
       {SimulationKind::kGimbal, SimulationKind::kHandheld, SimulationKind::kStreet}) {
    if (flags.kind == Name(kind)) options.kind = kind;
  }
  for (const TurnAxis axis : {TurnAxis::kYaw, TurnAxis::kPitch, TurnAxis::kRoll}) {
    if (flags.turn_axis == Name(axis)) options.turn_axis = axis;
  }
  options.camera = CameraOf(flags);
  const Simulation simulation(options);

  WriteOptions write;
  write.layout = flags.layout == "euroc" ? SequenceLayout::kEuroc : SequenceLayout::kTum;
  write.num_threads = flags.common.NumThreads();
  const bool terminal = isatty(STDERR_FILENO) != 0;
  if (!flags.common.quiet && terminal) {
    write.progress = [](int done, int count) {
      std::fprintf(stderr, "\rsimulate  frame %d/%d%s", done, count, done == count ? "\n" : "");
    };
  }
  const std::vector<std::string> written = WriteSequence(simulation, flags.out, write);
  if (flags.common.quiet) return 0;
  std::printf("simulated %s: %d frames at %g fps\n",
              flags.kind.c_str(),
              simulation.NumFrames(),
              simulation.Fps());
  std::printf("camera: %s\n", Describe(simulation.GetCamera()).c_str());
  std::printf("wrote to %s:\n", flags.out.c_str());
  for (const std::string& name : written) std::printf("  %s\n", name.c_str());
  return 0;
}

void AddPathFlags(CLI::App& command, SimulateFlags& flags) {
  SimulationOptions& simulation = flags.simulation;
  command.add_option(
      "--frames", simulation.frames, "Frames of the whole path; 0: as many as it brings");
  command.add_option("--first", simulation.first, "First frame of the path to render");
  command.add_option("--last", simulation.last, "Last frame of the path to render");
  command.add_option(
      "--fps", simulation.fps, "Frames a second; 0: 30 in the room, 10 in the street");
  command
      .add_option("--speed-scale",
                  simulation.speed_scale,
                  "The same way in fewer (> 1) or more (< 1) frames")
      ->capture_default_str();
  command.add_option("--turn-axis", flags.turn_axis, "gimbal: turn about yaw, pitch or roll")
      ->check(CLI::IsMember({"yaw", "pitch", "roll"}))
      ->capture_default_str();
  command.add_option("--turn-deg", simulation.turn_deg, "gimbal: angle turned in place")
      ->capture_default_str();
  command.add_option("--lever-arm",
                     simulation.lever_arm_m,
                     "gimbal: metres from the axis of the turn to the camera's centre");
  command.add_option(
      "--poses", simulation.poses, "street: KITTI pose file to drive along (12 numbers a line)");
}

void AddCameraFlags(CLI::App& command, SimulateFlags& flags) {
  auto* camera = command.add_option(
      "--camera",
      flags.camera,
      "Camera file (any form `run` reads; FILE:NAME of several), with distortion");
  command.add_option("--width", flags.width, "Image width in pixels")
      ->check(CLI::Range(16, 20000))
      ->capture_default_str();
  command.add_option("--height", flags.height, "Image height in pixels")
      ->check(CLI::Range(16, 20000))
      ->capture_default_str();
  command.add_option("--hfov-deg", flags.hfov_deg, "Horizontal field of view of a pinhole camera")
      ->excludes(camera)
      ->capture_default_str();
  command.add_option("--fx", flags.fx, "Focal length in pixels, instead of --hfov-deg")
      ->check(AboveZero())
      ->excludes(camera);
  command.add_option("--fy", flags.fy, "Vertical focal length; default: fx")
      ->check(AboveZero())
      ->excludes(camera);
  command.add_option("--cx", flags.cx, "Principal point; default: the middle")->excludes(camera);
  command.add_option("--cy", flags.cy, "Principal point; default: the middle")->excludes(camera);
  command
      .add_option("--readout",
                  flags.readout_s,
                  "Rolling shutter: seconds from the first row to the last; 0: a global one")
      ->excludes(camera);
}

void AddRenderFlags(CLI::App& command, SimulationOptions& simulation) {
  RenderOptions& render = simulation.render;
  command.add_option("--noise", render.noise_grey, "Sensor noise, sigma in grey levels")
      ->capture_default_str();
  command.add_option("--exposure", render.exposure_variation, "Gain wanders within 1 +- this")
      ->capture_default_str();
  command
      .add_option("--blur", render.blur_subframes, "Sub-frames averaged for motion blur; 1: sharp")
      ->capture_default_str();
  command.add_option("--shutter", render.shutter_s, "Seconds the shutter is open, with --blur")
      ->capture_default_str();
  command.add_option("--distractors", simulation.distractors, "Boxes moving through the scene");
  command.add_flag("--color", render.color, "Colour instead of grey pictures");
}

}  // namespace

void AddSimulateCommand(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand(
      "simulate", "Render a sequence with exact ground truth: a room or a street of our own");
  const auto flags = std::make_shared<SimulateFlags>();
  command
      ->add_option("kind",
                   flags->kind,
                   "gimbal (translate, stop, rotate in place, translate on), handheld or street")
      ->required()
      ->check(CLI::IsMember({"gimbal", "handheld", "street"}));
  command->add_option("--out", flags->out, "Folder to write to; made where missing")->required();
  command->add_option("--layout", flags->layout, "Layout of the files: tum or euroc")
      ->check(CLI::IsMember({"tum", "euroc"}))
      ->capture_default_str();
  AddPathFlags(*command, *flags);
  AddCameraFlags(*command, *flags);
  AddRenderFlags(*command, flags->simulation);
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam simulate gimbal --out sequences/gimbal");
  command->callback([flags, &action] { action = [flags] { return Simulate(*flags); }; });
}

}  // namespace rotslam
