#include "apps/paper_method/paper_options.h"

namespace rotslam {

OdometryOptions PaperDefaults() {
  OdometryOptions options;
  options.features.max_features = 4000;
  options.features.num_levels = 8;
  options.features.scale_factor = 1.2;
  options.features.fast_threshold = 20;
  options.features.min_fast_threshold = 7;
  options.matching.radius_px = 100.0;
  options.matching.max_distance = 50;
  options.matching.ratio = 0.9;
  options.view_graph.window_frames = 4;
  options.view_graph.min_edge_inliers = 100;
  options.averaging.mode = AveragingMode::kWindow;
  options.averaging.window = 10;
  return options;
}

}  // namespace rotslam
