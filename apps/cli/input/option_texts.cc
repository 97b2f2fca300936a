#include "apps/cli/input/option_texts.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <iterator>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <variant>

namespace rotslam {
namespace {

struct OptionText {
  const char* key;
  const char* unit;  // or the words that the option may be; empty where there is neither
  const char* text;
};

// In the order in which RunOptions::Visit has them.
constexpr OptionText kOptionTexts[] = {
    {"sequence.first", "frame", "first input frame to use; the input's own first one is 0"},
    {"sequence.last", "frame", "last input frame to use; -1: to the end"},
    {"sequence.stride",
     "frames",
     "use every n-th frame; more than 1 widens the motion between them"},
    {"sequence.fps", "1/s", "frame rate of input without timestamps"},
    {"max_image_side_px", "px", "images whose longer side is larger are reduced to this, or less"},
    {"rotodom.features.max_features",
     "features",
     "features wanted per frame; more help weak texture and take time"},
    {"rotodom.features.fast_threshold",
     "grey levels",
     "contrast of a corner (FAST); less finds more"},
    {"rotodom.features.min_fast_threshold",
     "grey levels",
     "the same where a cell has no such corner"},
    {"rotodom.features.min_distance_px", "px", "distance between features, in their pyramid level"},
    {"rotodom.matching.radius_px",
     "px",
     "descriptors are matched this near to where they are expected"},
    {"rotodom.matching.wide_radius_px", "px", "radius where too few match within the first one"},
    {"rotodom.matching.max_distance", "bits of 256", "largest Hamming distance of a match"},
    {"rotodom.matching.ratio", "share", "a match is nearer than this times the second nearest"},
    {"rotodom.tracking.min_correlation",
     "0 to 1",
     "a patch is found where it correlates this much"},
    {"rotodom.tracking.num_references",
     "views",
     "views that a point's patch is aligned with; more average noise"},
    {"rotodom.tracking.min_points",
     "points",
     "tracked points; with fewer the frame is matched by descriptors"},
    {"rotodom.tracking.match_blur", "", "blur sharp patches where the other image has motion blur"},
    {"rotodom.relative_rotation.inlier_px",
     "px",
     "outlier threshold of a match (Sampson distance)"},
    {"rotodom.relative_rotation.max_samples",
     "samples",
     "most samples for a pair of views; more tolerate more outliers"},
    {"rotodom.relative_rotation.baseline.false_alarm_rate",
     "share",
     "pairs without a baseline that pass for pairs with one"},
    {"rotodom.view_graph.window_frames", "frames", "frames before it that a frame gets edges to"},
    {"rotodom.view_graph.min_edge_inliers", "matches", "inliers that an edge needs"},
    {"rotodom.view_graph.max_keyframe_edges",
     "edges",
     "most edges of a frame to older keyframes; they limit drift"},
    {"rotodom.view_graph.keyframe_overlap",
     "share",
     "common points below which a new keyframe is taken"},
    {"rotodom.averaging.mode",
     "off, window, global",
     "orientations averaged when a frame has come"},
    {"rotodom.averaging.window", "frames", "newest ones that are averaged in mode window"},
    {"rotodom.averaging.loss_sigmas", "sigmas", "edge error at which the robust loss goes flat"},
    {"readout.enabled", "", "find the rolling shutter of cameras that do not say theirs"},
    {"readout.max_frames", "frames", "that search ends after so many frames"},
    {"loop.use_loops", "", "look for places seen before and spread the drift over the loop"},
    {"loop.place_overlap",
     "share",
     "common points below which a new place is remembered; more: more places"},
    {"loop.handover_frames",
     "frames",
     "time that averaging after a loop may take; 0: the stream waits"},
    {"loop.max_candidates", "places", "most older places that a new one is compared with"},
    {"loop.candidates.recent_frames", "frames", "places of the last so many frames are no loop"},
    {"loop.verification.min_inliers", "matches", "inliers that an edge to an older place needs"},
    {"loop.verification.max_drift_deg",
     "deg",
     "a loop that contradicts orientations by more is rejected"},
    {"pure_rotation_segments.enabled", "", "hold the position while the camera only rotates"},
    {"pure_rotation_segments.min_frames", "frames", "shorter pure rotations are left alone"},
    {"keyframes.min_parallax_deg",
     "deg",
     "parallax at which a keyframe is taken; less: more keyframes"},
    {"keyframes.min_shared_ratio",
     "share",
     "common tracks below which one is taken without parallax"},
    {"keyframes.min_keyframes", "keyframes", "where there are fewer, less parallax is asked for"},
    {"keyframes.every_frames",
     "frames",
     "a keyframe every n frames, whatever they show; 0: by parallax"},
    {"krot.start", "l1, bisection, positioning", "positions that bundle adjustment starts from"},
    {"krot.threshold_px", "px", "outlier threshold of known rotation; covers rotation errors, too"},
    {"krot.use_bracket", "", "bound the least possible largest residual (the certificate)"},
    {"krot.max_bracket_views", "views", "components with more views get no lower bound"},
    {"krot.max_lp_views", "views", "components with more views are solved in overlapping blocks"},
    {"krot.observations_per_view",
     "observations",
     "observations per view in the linear programs; more take time"},
    {"krot.min_point_angle_deg", "deg", "least angle between the rays of a point"},
    {"krot.use_epipolar_filter",
     "",
     "first remove matches that contradict the rotations pair by pair"},
    {"krot.bisection.relative_gap",
     "share",
     "the bracket is narrow enough at this share of its upper end"},
    {"krot.bisection.max_programs", "programs", "most linear programs for the bracket"},
    {"ba.coarse.max_error_px", "px", "outlier threshold of the first round with free rotations"},
    {"ba.fine.max_error_px", "px", "outlier threshold of the final rounds"},
    {"ba.preparing_observations",
     "observations",
     "observations per frame before the final rounds; 0: all"},
    {"ba.loss_spreads", "spreads", "residual at which the Huber loss leaves the quadratic"},
    {"ba.limit_spreads", "spreads", "residual beyond which an observation is an outlier"},
    {"ba.blur_s_per_px",
     "s/px",
     "keypoints' sigma along motion blur by the image's speed; 0: none"},
    {"ba.max_final_rounds", "rounds", "most final rounds"},
    {"ba.refine_rotations", "", "false: rotations come out as they went in"},
    {"ba.lens.refine_distortion", "", "refine the first two radial coefficients"},
    {"ba.lens.refine_focal", "", "refine the focal length"},
    {"ba.lens.refine_principal_point", "", "refine the principal point"},
    {"ba.lens.refine_higher_terms", "", "refine the other coefficients of the distortion"},
    {"ba.lens.distortion_sigma", "", "standard deviation of the coefficients given"},
    {"ba.lens.focal_sigma", "share", "standard deviation of the focal length given"},
    {"ba.lens.principal_sigma", "focal lengths", "standard deviation of the principal point given"},
    {"ba.find_covariance", "", "say how well each pose is known; takes time"},
    {"ba.min_angle_deg", "deg", "least angle between the rays of a point"},
    {"track_completion.enabled", "", "look for the map's points in all images again"},
    {"track_completion.reach_px", "px", "a point is found this near to where the map says"},
    {"track_completion.min_correlation",
     "0 to 1",
     "a patch is found where it correlates this much"},
    {"track_completion.max_views", "views", "most views that a point is sought in"},
    {"relocalisation.enabled", "", "find frames again that a map holds in a wrong place"},
    {"relocalisation.min_inliers", "corners", "corners that the new pose of a frame must explain"},
    {"resection.max_error_px", "px", "outlier threshold of frames between keyframes"},
    {"cloud_min_angle_deg", "deg", "points under a smaller angle stay out of cloud.ply"},
    {"cloud_outliers.remove", "", "points that stand alone stay out of cloud.ply"},
    {"cloud_outliers.max_sigmas",
     "sigmas",
     "mean distance to neighbours beyond which a point stands alone"},
};

std::string Shown(const OptionValue& value) {
  const auto shown = [](const auto& field) -> std::string {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, bool>) return field ? "true" : "false";
    if constexpr (std::is_same_v<Field, double>) {
      char text[32];
      const auto end = std::to_chars(std::begin(text), std::end(text), field).ptr;
      return {std::begin(text), end};
    }
    if constexpr (std::is_same_v<Field, std::string>) {
      return field;
    } else {
      return std::to_string(field);
    }
  };
  return std::visit(shown, value);
}

std::vector<std::string> PartsOf(const std::string& key) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  for (std::size_t dot = 0; (dot = key.find('.', begin)) != std::string::npos; begin = dot + 1) {
    parts.push_back(key.substr(begin, dot - begin));
  }
  parts.push_back(key.substr(begin));
  return parts;
}

std::string CommentOf(const OptionText& text) {
  const std::string unit = text.unit;
  return "# " + (unit.empty() ? "" : unit + ": ") + text.text;
}

}  // namespace

std::string OptionsAsYaml(const std::vector<OptionRef>& options) {
  const std::vector<OptionEntry> entries = ReadOptionValues(options);
  for (std::size_t n = 0; n < std::max(entries.size(), std::size(kOptionTexts)); ++n) {
    const std::string key = n < entries.size() ? entries[n].key : "(none)";
    const std::string explained = n < std::size(kOptionTexts) ? kOptionTexts[n].key : "(none)";
    if (key != explained) {
      std::string problem = "option_texts.cc explains ";
      problem += explained;
      problem += " where the option is ";
      problem += key;
      throw std::logic_error(problem);
    }
  }
  // Lines and, for options, their comments.
  std::vector<std::pair<std::string, std::string>> lines;
  std::size_t width = 0;
  std::vector<std::string> above;
  for (std::size_t n = 0; n < entries.size(); ++n) {
    std::vector<std::string> parts = PartsOf(entries[n].key);
    const std::string name = parts.back();
    parts.pop_back();
    const auto [fresh, ignored] =
        std::mismatch(parts.begin(), parts.end(), above.begin(), above.end());
    for (auto group = fresh; group != parts.end(); ++group) {
      const auto depth = static_cast<std::size_t>(group - parts.begin());
      lines.emplace_back(std::string(2 * depth, ' ') + *group + ":", "");
    }
    lines.emplace_back(std::string(2 * parts.size(), ' ') + name + ": " + Shown(entries[n].value),
                       CommentOf(kOptionTexts[n]));
    width = std::max(width, lines.back().first.size());
    above = std::move(parts);
  }
  std::string yaml;
  for (const auto& [line, comment] : lines) {
    yaml += line;
    if (!comment.empty()) yaml += std::string(width + 2 - line.size(), ' ') + comment;
    yaml += "\n";
  }
  return yaml;
}

}  // namespace rotslam
