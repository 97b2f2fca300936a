#pragma once

#include <optional>

#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry_archive.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

template <class Archive>
void TransferValue(Archive& archive, LoopCheck& check) {
  auto& [frame, match, score, num_inliers, angle_deg, way, accepted, num_edges] = check;
  auto& [turn_scale, scaled_angle_deg] = way;
  archive(frame,
          match,
          score,
          num_inliers,
          angle_deg,
          turn_scale,
          scaled_angle_deg,
          accepted,
          num_edges);
}

template <class Archive>
void TransferValue(Archive& archive, LoopReport& report) {
  auto& [checks, connections, waiting, matches] = report;
  archive(checks, connections, waiting, matches);
}

template <class Archive>
void TransferValue(Archive& archive, SeenPoints& points) {
  auto& [timestamp_s, tracks, keypoints_px] = points;
  archive(timestamp_s, tracks, keypoints_px);
}

template <class Archive>
void TransferValue(Archive& archive, ReadoutEstimate& readout) {
  auto& [readout_s, readout_from, sigma_s, gain_sigmas, shear_px, noise_px, frame_s] = readout;
  archive(readout_s, readout_from, sigma_s, gain_sigmas, shear_px, noise_px, frame_s);
}

/// One frame as AddFrame found it: to take it again without its image.
struct FrameRecord {
  FrameEstimate estimate;           // as the odometry says it, in its own world
  std::optional<Features> corners;  // described, where the frame is to be a place
  LoopReport loops;                 // what became of the frame before

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(estimate, corners, loops);
  }
};

}  // namespace rotslam
