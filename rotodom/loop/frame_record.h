#pragma once

#include <optional>

#include "rotodom/loop/loop_closure.h"
#include "rotodom/odometry_archive.h"
#include "rotodom/rolling_shutter/readout.h"

namespace rotslam {

template <class Archive>
void TransferValue(Archive& archive, LoopCheck& check) {
  auto& [frame, match, score, num_inliers, angle_deg, scaled, accepted, num_edges] = check;
  auto& [turn_scale, scaled_angle_deg] = scaled;
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
  auto& [checks, connections, unconfirmed, matches] = report;
  archive(checks, connections, unconfirmed, matches);
}

template <class Archive>
void TransferValue(Archive& archive, SeenPoints& points) {
  auto& [timestamp_s, tracks, keypoints_px] = points;
  archive(timestamp_s, tracks, keypoints_px);
}

template <class Archive>
void TransferValue(Archive& archive, ReadoutEstimate& readout) {
  auto& [readout_s,
         readout_from,
         sigma_s,
         gain_sigmas,
         least_gain_sigmas,
         shear_px,
         noise_px,
         frame_s] = readout;
  archive(readout_s,
          readout_from,
          sigma_s,
          gain_sigmas,
          least_gain_sigmas,
          shear_px,
          noise_px,
          frame_s);
}

/// The result of AddFrame for one frame, from which the frame can be replayed without its image.
struct FrameRecord {
  FrameEstimate estimate;           // of the odometry, in its own world
  std::optional<Features> corners;  // described; set where the frame becomes a place
  LoopReport loops;                 // of the frame before

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(estimate, corners, loops);
  }
};

}  // namespace rotslam
