#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/camera_file.h"

namespace rotslam {

/// Reads a calibration file. Its form is told by its content; CameraForms() in camera_form.h is the
/// table of all forms. A folder stands for the calibration file in it: `camera.yaml`, else the one
/// that has a name of the table.
///
/// Radtan files whose coefficients are all zero give kPinhole. No number that is not zero is
/// dropped: models that we lack are refused by name. What is ignored or assumed is in the notes.
///
/// Our own form:
///   model: radtan                    # pinhole, radtan, equidistant, rational or fov
///   width: 752                       # pixels; both 0 or left out: the images decide
///   height: 480
///   fx: 458.654                      # pixels; pixel centres at integer coordinates, as in OpenCV
///   fy: 457.296
///   cx: 367.215
///   cy: 248.375
///   distortion: [-0.283, 0.074, 0.00019, 1.8e-05, 0]  # as DistortionNames(model) says
///   readout_s: 0.02                  # rolling shutter, first row to last; 0: global;
///                                    # left out: not known, and 0
///   readout_from: top                # its first row: top, bottom, left or right; left out: top
///   # Standard deviations, all of them or none. 0: exact; left out: not known.
///   sigma_focal_px: 0.4              # of fx and fy together
///   sigma_cx_px: 0.5
///   sigma_cy_px: 0.6
///   # Of the first coefficients, five at most; of a pinhole those of radtan.
///   sigma_distortion: [0.001, 0.002, 0.0001, 0.0001, 0.002]
///   # Polygons of corners x, y: parts of the image to be ignored (a bonnet, a mount); left out:
///   # none.
///   masked_px: [[[0, 400], [752, 400], [752, 480], [0, 480]]]
/// radtan may leave k3 out; pinhole has no distortion. Unknown keys are errors.
///
/// Throws std::runtime_error in one line, "file:line: key is 'x', must be ...": no such file, no
/// known form, a model not supported, a number missing, malformed, not finite, or not positive
/// where it has to be. Where only some of several cameras are at fault, these have it as their
/// `problem`.
CameraFile ReadCameraFile(const std::filesystem::path& path);

/// Name of the form that a file would be read in; nullopt where none or several take it. Throws
/// std::runtime_error when it cannot be read at all.
std::optional<std::string> RecogniseCameraFile(const std::filesystem::path& path);

/// A calibration file and the camera in it; no name: the one that ChooseCamera finds.
struct CameraReference {
  std::filesystem::path file;
  std::string name;
};

/// "calib.yaml" or "calib.yaml:cam1". A path that exists as it stands is a file without a name.
CameraReference ParseCameraReference(const std::string& text);

/// The camera of `file` that `reference` names; else the only one; else the one that belongs to the
/// images by a component of their folder's path (`cam1`, `image_2`, `left`, `right`, `image_rect`);
/// else the first where the form says so, or where all are the same. `image_folder` may be empty.
/// Throws std::runtime_error in one line: no camera of that name, or several that differ, with
/// their names; or the problem of the chosen one.
NamedCamera ChooseCamera(const CameraFile& file,
                         const CameraReference& reference,
                         const std::filesystem::path& image_folder);

/// ReadCameraFile and ChooseCamera at once.
/// @param image_size  width and height of the images, for files with an angle of view in place of a
///                    focal length, which are refused without it.
Camera ReadCamera(const CameraReference& reference,
                  const std::filesystem::path& image_folder = {},
                  const std::array<int, 2>& image_size = {});

/// The same for a file without a name.
Camera ReadCamera(const std::filesystem::path& file);

/// `camera` in our own form; ReadCamera gives back the very same numbers.
/// @param sigmas  how well the lens is known; nullopt: nobody knows.
std::string CameraYaml(const Camera& camera, const std::optional<LensSigmas>& sigmas = {});

/// Writes CameraYaml(camera, sigmas), beside first, then renamed. Throws std::runtime_error when it
/// cannot, std::invalid_argument when camera.Problem().
void WriteCameraYaml(const std::filesystem::path& file,
                     const Camera& camera,
                     const std::optional<LensSigmas>& sigmas = {});

}  // namespace rotslam
