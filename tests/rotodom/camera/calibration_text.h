#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "rotodom/camera/read_camera.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {

/// What ReadCameraFile makes of a file "calib.txt" with this content.
inline CameraFile ReadCalibration(const std::string& content) {
  const TemporaryFolder folder;
  return ReadCameraFile(folder.Write("calib.txt", content));
}

/// The one camera of such a file, or the one that ChooseCamera takes for these images.
inline Camera ReadChosen(const std::string& content,
                         const std::string& name = "",
                         const std::string& image_folder = "") {
  const CameraReference reference{"calib.txt", name};
  return ChooseCamera(ReadCalibration(content), reference, image_folder).camera;
}

/// What reading such a file, and choosing a camera of it, complains about: one line, from the
/// file's name on.
inline std::string CalibrationComplaint(const std::string& content,
                                        const std::string& image_folder = "") {
  try {
    const Camera camera = ReadChosen(content, "", image_folder);
    return "read without complaint: " + Describe(camera);
  } catch (const std::runtime_error& error) {
    const std::string text = error.what();
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_NE(text.find("calib.txt"), std::string::npos) << text;
    return text.substr(std::min(text.find("calib.txt"), text.size()));
  }
}

inline Camera CameraOfNumbers(CameraModel model,
                              const std::array<int, 2>& size,
                              const std::array<double, 4>& intrinsics,
                              const std::array<double, 8>& distortion = {}) {
  Camera camera;
  camera.model = model;
  camera.width = size[0];
  camera.height = size[1];
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  camera.distortion = distortion;
  return camera;
}

/// Model and size the same, all other numbers within `tolerance`.
inline void ExpectNear(const Camera& camera, const Camera& expected, double tolerance) {
  SCOPED_TRACE("camera is " + Describe(camera) + ", must be " + Describe(expected));
  EXPECT_EQ(camera.model, expected.model);
  EXPECT_EQ(camera.width, expected.width);
  EXPECT_EQ(camera.height, expected.height);
  EXPECT_NEAR(camera.fx, expected.fx, tolerance);
  EXPECT_NEAR(camera.fy, expected.fy, tolerance);
  EXPECT_NEAR(camera.cx, expected.cx, tolerance);
  EXPECT_NEAR(camera.cy, expected.cy, tolerance);
  for (std::size_t k = 0; k < expected.distortion.size(); ++k) {
    EXPECT_NEAR(camera.distortion[k], expected.distortion[k], tolerance) << k;
  }
  EXPECT_NEAR(camera.readout_s, expected.readout_s, tolerance);
  EXPECT_EQ(camera.knows_readout, expected.knows_readout);
}

}  // namespace rotslam
