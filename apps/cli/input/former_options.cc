#include "apps/cli/input/former_options.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string_view>

namespace rotslam {
namespace {

// A group of options and those of it that are constants now, each between blanks.
struct FixedOptions {
  std::string_view group;
  std::string_view names;
};

constexpr FixedOptions kFixedOptions[] = {
    {"rotodom.features", " num_levels scale_factor "},
    {"rotodom.matching", " min_matches max_level_step "},
    {"rotodom.tracking", " num_probes min_found_ratio "},
    {"rotodom.relative_rotation",
     " loss_sigmas min_noise_px shared_error_px finest_px sample_size confidence "
     "min_samples refine_iterations min_inliers "},
    {"rotodom.relative_rotation.baseline", " anisotropy lens_error clip_sigmas "},
    {"rotodom.view_graph", " min_inlier_ratio max_keyframes "},
    {"rotodom.averaging",
     " edge_floor_deg edge_error_factor lasting_share lasting_views shared_noise "
     "l1_iterations min_step_deg max_iterations "},
    {"loop", " max_shutter_error_deg min_correction_deg min_common_points max_neighbours "},
    {"loop.candidates", " common_words_ratio group_score_ratio group_size "},
    {"loop.verification",
     " min_inlier_ratio max_sigma_deg max_witness_sigma_deg blur_s_per_px "
     "shutter_sigma_deg max_cycle_deg max_cycle_sigmas min_edges min_witness_deg "
     "sure_inliers max_drift_deg_per_sqrt_frame max_turn_error "},
    {"pure_rotation_segments", " min_rotation_only_ratio max_edge_span max_gap still_sigmas "},
    {"keyframes", " min_linked_ratio "},
    {"krot",
     " threshold_sigmas loose_factor min_lp_parallax_deg still_parallax_px "
     "min_shared_points max_off_axis_deg seed "},
    {"krot.robust_start", " method max_rounds depth_price use_sharpening "},
    {"krot.bisection", " method zero_gamma max_extent points_per_view added_per_view "},
    {"ba.bridge",
     " enabled refine_rotations max_error_px max_residual loss loss_scale "
     "max_iterations initial_radius function_tolerance "},
    {"ba.coarse",
     " enabled refine_rotations max_residual loss loss_scale max_iterations "
     "initial_radius function_tolerance "},
    {"ba.fine",
     " enabled refine_rotations max_residual loss loss_scale max_iterations "
     "initial_radius function_tolerance "},
    {"ba", " max_changed_share min_observations min_frame_observations max_dense_frames "},
    {"ba.lens", " min_gain "},
    {"track_completion", " max_return_px max_angle_deg max_distance_ratio "},
    {"relocalisation", " max_error_px min_gain_sigmas "},
    {"resection", " refine_rotation refine_center loss_scale min_inliers max_iterations "},
    {"cloud_outliers", " num_neighbours "},
};

struct RenamedOption {
  std::string_view before;
  std::string_view now;
};

constexpr RenamedOption kRenamedOptions[] = {
    {"ba.max_close_rounds", "ba.max_final_rounds"},
    {"ba.smear_s_per_px", "ba.blur_s_per_px"},
    {"completion", "track_completion"},
    {"held_stretches", "pure_rotation_segments"},
};

// @param key  may lack groups in front, as in Python.
bool IsFixed(std::string_view key) {
  const std::size_t dot = key.rfind('.');
  if (dot == std::string_view::npos) return false;
  const std::string_view group = key.substr(0, dot);
  const std::string name = " " + std::string(key.substr(dot + 1)) + " ";
  return std::any_of(
      std::begin(kFixedOptions), std::end(kFixedOptions), [&](const FixedOptions& fixed) {
        if (fixed.group == key) return true;
        const bool is_group =
            fixed.group == group || fixed.group.ends_with("." + std::string(group));
        return is_group && fixed.names.find(name) != std::string_view::npos;
      });
}

}  // namespace

std::string FormerOption(const std::string& key) {
  constexpr std::string_view kOfBatch = "options.";
  std::string_view option = key;
  if (option.starts_with(kOfBatch)) option.remove_prefix(kOfBatch.size());
  for (const RenamedOption& renamed : kRenamedOptions) {
    if (renamed.before == option) {
      return "\"" + key + "\" is called \"" + std::string(renamed.now) + "\" now";
    }
  }
  if (!IsFixed(option)) return "";
  return "\"" + key + "\" is fixed now; rotslam run --print-config lists the options";
}

}  // namespace rotslam
