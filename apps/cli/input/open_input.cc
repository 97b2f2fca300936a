#include "apps/cli/input/open_input.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

#include "apps/cli/input/input_lines.h"
#include "apps/slam/lens_estimation.h"
#include "output/trajectory/orientation_file.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/loop/vocabulary_file.h"
#include "rotodom/sequence/spherical.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// The names of the frames; none for a video, whose frames are only known once they are read.
std::vector<std::string> FrameNames(const Sequence& sequence) {
  std::vector<std::string> names;
  if (sequence.is_video()) return names;
  for (const std::filesystem::path& file : sequence.Files()) {
    names.push_back(file.filename().string());
  }
  return names;
}

void ReadMasks(const InputFlags& flags, Input& input) {
  const cv::Size size = input.sequence().image_size();
  if (!flags.mask.empty()) input.masks.AddToAll(ReadMask(flags.mask, size));
  if (!flags.masks.empty()) {
    input.masks.AddFolder(flags.masks, FrameNames(input.sequence()), size);
  }
  input.find_static_content = flags.auto_mask;
}

// The command that cuts a square pinhole view of 90 deg out of spherical pictures.
std::string PinholeCommand(const Sequence& sequence, int side_px) {
  const std::string side = std::to_string(side_px);
  const std::filesystem::path& place = sequence.image_folder();
  const std::string input =
      sequence.is_video()
          ? "-i '" + place.string() + "'"
          : "-pattern_type glob -i '" +
                (place / ("*" + sequence.Files().front().extension().string())).string() + "'";
  return "ffmpeg " + input + " -vf v360=e:flat:h_fov=90:v_fov=90:w=" + side + ":h=" + side +
         " view.mp4";
}

// Throws where the pictures are spherical ones. Reads images only where their size allows it.
void RefuseSphericalPictures(SequenceSource& frames) {
  const Sequence& sequence = frames.sequence();
  if (!HasSphericalSize(sequence.image_size())) return;
  constexpr int kNumImages = 5;
  constexpr int kStep = 5;  // frames between them
  std::set<FrameId> sample;
  for (int k = 0; k < kNumImages; ++k) {
    const int number = k * kStep;
    if (sequence.NumFrames() < 0 || number < sequence.NumFrames()) sample.insert(FrameId{number});
  }
  std::vector<cv::Mat> images;
  frames.Read(
      sample,
      [&](FrameId, const cv::Mat& image) { images.push_back(image.clone()); },
      [](const std::string&) {});
  if (!AreSpherical(images)) return;
  // As fine as the pictures are in the middle of the view, a multiple of 16.
  const int side_px = std::max(16, sequence.image_size().width * 5 / 16 / 16 * 16);
  const std::string focal_px = std::to_string(side_px / 2);
  throw std::runtime_error(
      frames.path().string() +
      ": these are spherical pictures (equirectangular, 2:1), a camera model that is not supported "
      "yet. Cut a pinhole view out of them, `" +
      PinholeCommand(sequence, side_px) + "`, and run that with a camera of fx = fy = " + focal_px +
      ", cx = cy = " + FormatNumber("%.1f", 0.5 * (side_px - 1)));
}

}  // namespace

std::shared_ptr<const Vocabulary> OpenVocabulary(const InputFlags& flags) {
  if (flags.vocabulary.empty()) return nullptr;
  return std::make_shared<const Vocabulary>(ReadVocabulary(flags.vocabulary));
}

bool ReadCalibration(const InputFlags& flags, Input& input) {
  if (flags.focal_guess || flags.camera == "none") return false;
  const Sequence& sequence = input.sequence();
  const cv::Size size = sequence.image_size();
  Camera camera;
  std::optional<LensSigmas> sigmas;
  if (!flags.camera.empty() || sequence.camera_reference()) {
    const CameraReference reference =
        flags.camera.empty() ? *sequence.camera_reference() : ParseCameraReference(flags.camera);
    const CameraFile file = ReadCameraFile(reference.file);
    const NamedCamera chosen = ChooseCamera(file, reference, sequence.image_folder());
    camera = AtSize(chosen, size.width, size.height);
    sigmas = chosen.sigmas;
    input.camera_file = reference.file.string();
    input.camera_source =
        input.camera_file + (chosen.name.empty() ? "" : ":" + chosen.name) + ", " + file.form;
    input.camera_notes = file.notes;
    if (!chosen.masked_px.empty()) input.masks.AddToAll(MaskOfPolygons(chosen.masked_px, size));
  } else if (const auto& own_camera = sequence.own_camera()) {
    input.camera_file = sequence.form();
    input.camera_source = "as " + sequence.form() + " says";
    camera = *own_camera;
  } else {
    return false;
  }
  try {
    input.camera = MatchToImages(camera, size);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(input.camera_file + ": " + error.what());
  }
  if (camera.width > 0 && camera.width != size.width) {
    input.camera_notes.push_back("it is of images of " + std::to_string(camera.width) + "x" +
                                 std::to_string(camera.height) + ", scaled to those here");
  }
  if (sigmas) input.lens_sigmas = SigmasInPixels(RelativeSigmas(*sigmas, camera), input.camera);
  return true;
}

Input OpenInput(const InputFlags& flags,
                const SequenceOptions& options,
                const std::function<void(const std::string&)>& tell) {
  Input input;
  input.path = std::filesystem::absolute(flags.sequence).lexically_normal().string();
  input.frames = std::make_unique<SequenceSource>(flags.sequence, options);
  for (const std::string& line : DescribeSequence(input.sequence())) tell(line);
  RefuseSphericalPictures(*input.frames);
  if (!ReadCalibration(flags, input)) {
    input.guess = GuessFocal(flags.sequence, options, input.sequence());
    input.camera = UncalibratedCamera(input.sequence().image_size(), input.guess->focal_px);
  }
  ReadMasks(flags, input);
  if (!flags.rotations.empty()) {
    OrientationFile file = ReadOrientationFile(flags.rotations);
    for (const std::string& note : file.notes) tell("note:   " + flags.rotations + ": " + note);
    input.given_rotations = {flags.rotations, std::move(file.orientations), flags.align};
  }
  for (const std::string& line : DescribeCamera(input)) tell(line);
  for (const std::string& line : DescribeMasks(input.masks)) tell(line);
  if (input.sequence().NumFrames() >= 0 && input.sequence().NumFrames() < 3) {
    throw std::runtime_error(flags.sequence + ": " + std::to_string(input.sequence().NumFrames()) +
                             " frames after --first, --last and --stride; at least 3 are needed");
  }
  return input;
}

}  // namespace rotslam
