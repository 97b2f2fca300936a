#include "apps/cli/input/open_input.h"

#include <filesystem>
#include <stdexcept>
#include <utility>

#include "apps/cli/input/input_lines.h"
#include "apps/slam/focal_length.h"
#include "output/trajectory/orientation_file.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/loop/vocabulary_file.h"

namespace rotslam {

std::shared_ptr<const Vocabulary> OpenVocabulary(const InputFlags& flags) {
  if (flags.vocabulary.empty()) return nullptr;
  return std::make_shared<const Vocabulary>(ReadVocabulary(flags.vocabulary));
}

void ReadCalibration(const InputFlags& flags, Input& input) {
  const Sequence& sequence = input.sequence();
  const cv::Size size = sequence.image_size();
  Camera camera;
  if (!flags.camera.empty() || sequence.camera_reference()) {
    const CameraReference reference =
        flags.camera.empty() ? *sequence.camera_reference() : ParseCameraReference(flags.camera);
    const CameraFile file = ReadCameraFile(reference.file);
    const NamedCamera chosen = ChooseCamera(file, reference, sequence.image_folder());
    camera = AtSize(chosen, size.width, size.height);
    input.camera_file = reference.file.string();
    input.camera_source =
        input.camera_file + (chosen.name.empty() ? "" : ":" + chosen.name) + ", " + file.form;
    input.camera_notes = file.notes;
  } else if (const auto& own_camera = sequence.own_camera()) {
    input.camera_file = sequence.form();
    input.camera_source = "as " + sequence.form() + " says";
    camera = *own_camera;
  } else {
    throw std::runtime_error(
        flags.sequence +
        ": no calibration lies with the images; give one with --camera FILE (film a printed "
        "checkerboard and let `rotslam calibrate` make it), or have one guessed with "
        "--focal-guess");
  }
  try {
    input.camera = MatchToImages(camera, size);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(input.camera_file + ": " + error.what());
  }
}

Input OpenInput(const InputFlags& flags,
                const SequenceOptions& options,
                const std::function<void(const std::string&)>& tell) {
  Input input;
  input.path = std::filesystem::absolute(flags.sequence).lexically_normal().string();
  input.frames = std::make_unique<SequenceSource>(flags.sequence, options);
  for (const std::string& line : DescribeSequence(input.sequence())) tell(line);
  if (flags.focal_guess) {
    const cv::Size size = input.sequence().image_size();
    input.guess = GuessFocal(flags.sequence, options, size);
    input.camera = UncalibratedCamera(size, input.guess->focal_px);
  } else {
    ReadCalibration(flags, input);
  }
  if (!flags.rotations.empty()) {
    OrientationFile file = ReadOrientationFile(flags.rotations);
    for (const std::string& note : file.notes) tell("note:   " + flags.rotations + ": " + note);
    input.given_rotations = {flags.rotations, std::move(file.orientations)};
  }
  for (const std::string& line : DescribeCamera(input)) tell(line);
  if (input.sequence().NumFrames() >= 0 && input.sequence().NumFrames() < 3) {
    throw std::runtime_error(flags.sequence + ": " + std::to_string(input.sequence().NumFrames()) +
                             " frames after --first, --last and --stride; at least 3 are needed");
  }
  return input;
}

}  // namespace rotslam
