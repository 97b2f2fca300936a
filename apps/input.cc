#include "apps/input.h"

#include <stdexcept>

#include "rotodom/camera/read_camera.h"

namespace rotslam {

void InputFlags::Override(SequenceOptions& options) const {
  if (first) options.first = *first;
  if (last) options.last = *last;
  if (stride) options.stride = *stride;
  if (fps) options.fps = *fps;
}

void AddInputFlags(CLI::App& command, InputFlags& flags) {
  command
      .add_option("sequence",
                  flags.sequence,
                  "Image folder, KITTI odometry, TUM RGB-D or EuRoC sequence, or video file")
      ->required();
  command.add_option(
      "--camera",
      flags.camera,
      "Calibration: our YAML, ORB-SLAM, Kalibr, KITTI, EuRoC or COLMAP; not needed where "
      "it lies with the images");
  command.add_option("--out", flags.out, "Folder for the results, made if it is not there")
      ->required();
  command.add_option("--first", flags.first, "First input frame to use");
  command.add_option("--last", flags.last, "Last input frame to use; -1: to the end");
  command.add_option("--stride", flags.stride, "Use every n-th frame");
  command.add_option("--fps", flags.fps, "Frames per second where the input has no timestamps");
}

Input OpenInput(const InputFlags& flags,
                const SequenceOptions& options,
                const std::function<void(const std::string&)>& tell) {
  Input input;
  input.sequence = OpenSequence(flags.sequence, options);
  tell("input:  " + input.sequence->Describe());
  if (!flags.camera.empty()) {
    input.camera_file = flags.camera;
  } else if (const auto& file = input.sequence->CameraFile()) {
    input.camera_file = file->string();
  } else {
    throw std::runtime_error(flags.sequence +
                             ": no calibration lies with the images; give one with --camera FILE");
  }
  const Camera camera = ReadCamera(input.camera_file);
  try {
    input.camera = MatchToImages(camera, input.sequence->image_size());
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(input.camera_file + ": " + error.what());
  }
  tell("camera: " + Describe(input.camera) + " (" + input.camera_file + ")");
  if (input.sequence->NumFrames() >= 0 && input.sequence->NumFrames() < 3) {
    throw std::runtime_error(flags.sequence + ": " + std::to_string(input.sequence->NumFrames()) +
                             " frames after --first, --last and --stride; at least 3 are needed");
  }
  return input;
}

}  // namespace rotslam
