#pragma once

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "rotodom/camera/read_camera.h"
#include "tests/apps/command_line.h"

namespace rotslam {

/// Renders 45 frames of a fast walk through the room, read out in 25 ms, which the camera file does
/// not tell.
inline void SimulateUnknownReadout(const std::filesystem::path& sequence) {
  const CommandResult result = Rotslam({"simulate",
                                        "handheld",
                                        "--frames=45",
                                        "--readout=0.025",
                                        "--speed-scale=2",
                                        "--width=320",
                                        "--height=240",
                                        "--out=" + sequence.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  Camera camera = ReadCamera(sequence / "camera.yaml");
  camera.readout_s = 0.0;
  camera.knows_readout = false;
  WriteCameraYaml(sequence / "camera.yaml", camera);
}

}  // namespace rotslam
