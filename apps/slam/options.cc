#include "apps/slam/options.h"

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> ReadoutOptions::Problem() const {
  if (max_frames < 0) return OutOfRange("max_frames", max_frames, "zero or more");
  return std::nullopt;
}

std::optional<std::string> SlamOptions::Problem() const {
  if (max_image_side_px < 64) {
    return OutOfRange("max_image_side_px", max_image_side_px, "64 or more");
  }
  if (auto problem = ProblemIn("rotodom", rotodom)) return problem;
  if (auto problem = ProblemIn("readout", readout)) return problem;
  if (auto problem = ProblemIn("loop", loop)) return problem;
  if (auto problem = ProblemIn("pure_rotation_segments", pure_rotation_segments)) return problem;
  if (auto problem = ProblemIn("keyframes", keyframes)) return problem;
  if (auto problem = ProblemIn("krot", krot)) return problem;
  if (auto problem = ProblemIn("ba", ba)) return problem;
  if (auto problem = ProblemIn("track_completion", track_completion)) return problem;
  if (auto problem = ProblemIn("relocalisation", relocalisation)) return problem;
  if (auto problem = ProblemIn("resection", resection)) return problem;
  if (!(cloud_min_angle_deg >= 0.0)) {
    return OutOfRange("cloud_min_angle_deg", cloud_min_angle_deg, "zero or more");
  }
  if (auto problem = ProblemIn("cloud_outliers", cloud_outliers)) return problem;
  if (num_threads < 1) return OutOfRange("num_threads", num_threads, "one or more");
  return std::nullopt;
}

}  // namespace rotslam
