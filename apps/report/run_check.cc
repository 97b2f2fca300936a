#include "apps/report/run_check.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/report/run_summary.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;
using Reason = std::optional<CheckReason>;
using ReasonOf = Reason (*)(const RunFacts&);

constexpr const char* kAllFrames = "all frames";

// First and last of runs of frames, both included, ascending.
using FrameRanges = std::vector<std::pair<int, int>>;

void AddFrames(int first, int last, FrameRanges& ranges) {
  if (!ranges.empty() && ranges.back().second >= first - 1) {
    ranges.back().second = std::max(ranges.back().second, last);
  } else {
    ranges.emplace_back(first, last);
  }
}

int Count(const FrameRanges& ranges) {
  int count = 0;
  for (const auto& [first, last] : ranges) count += last - first + 1;
  return count;
}

// "frames 0-39, 83"; of many ranges the first five.
std::string DescribeFrames(const FrameRanges& ranges) {
  constexpr std::size_t kMaxRanges = 5;
  std::string text;
  for (std::size_t k = 0; k < std::min(kMaxRanges, ranges.size()); ++k) {
    const auto& [first, last] = ranges[k];
    text += (k == 0 ? "frames " : ", ") + std::to_string(first);
    if (last > first) text += "-" + std::to_string(last);
  }
  return text + (ranges.size() > kMaxRanges ? ", ..." : "");
}

FrameRanges FramesIn(const RunFacts& facts, PoseState state) {
  FrameRanges frames;
  for (const PoseRow& row : facts.poses) {
    if (row.state == state) AddFrames(row.frame, row.frame, frames);
  }
  return frames;
}

FrameRanges FramesNoted(const RunFacts& facts, const std::string& beginning) {
  FrameRanges frames;
  for (const PoseRow& row : facts.poses) {
    if (row.note.starts_with(beginning)) AddFrames(row.frame, row.frame, frames);
  }
  return frames;
}

// A number of summary.json by its path ("/counts/frames"); `if_none` where it is missing.
double NumberIn(const RunFacts& facts, const char* path, double if_none = 0.0) {
  const Json::json_pointer pointer(path);
  if (!facts.summary.contains(pointer) || !facts.summary.at(pointer).is_number()) return if_none;
  return facts.summary.at(pointer).get<double>();
}

// The same as a whole number.
int IntegerIn(const RunFacts& facts, const char* path) {
  constexpr double kLargest = 1e9;
  return static_cast<int>(std::clamp(NumberIn(facts, path), -kLargest, kLargest));
}

std::string TextIn(const RunFacts& facts, const char* path) {
  const Json::json_pointer pointer(path);
  if (!facts.summary.contains(pointer) || !facts.summary.at(pointer).is_string()) return {};
  return facts.summary.at(pointer).get<std::string>();
}

std::string Rounded(const char* format, double value) {
  std::array<char, 64> text = {};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

Reason Interrupted(const RunFacts& facts) {
  if (!facts.summary.contains("interrupted")) return {};
  return CheckReason{Verdict::kLookAt,
                     kAllFrames,
                     "the run was interrupted; frames after these are missing, and so are "
                     "positions. Finish it with --resume"};
}

Reason UnplacedFrames(const RunFacts& facts) {
  const FrameRanges frames = FramesIn(facts, PoseState::kUnplaced);
  if (frames.empty()) return {};
  const auto num_frames = static_cast<int>(facts.poses.size());
  if (Count(frames) == num_frames) {
    return CheckReason{Verdict::kDoNotUse,
                       kAllFrames,
                       "there is no map: no frame has a position. Orientations may be right"};
  }
  const bool is_most = 2 * Count(frames) > num_frames;
  return CheckReason{is_most ? Verdict::kDoNotUse : Verdict::kLookAt,
                     DescribeFrames(frames),
                     "nothing ties these frames to the map; their positions mean nothing. Leave "
                     "them out, or film the place between again",
                     true};
}

Reason ExtrapolatedFrames(const RunFacts& facts) {
  const FrameRanges frames = FramesIn(facts, PoseState::kExtrapolated);
  if (frames.empty()) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "the map does not reach these frames; they have the position of the nearest "
                     "frame that it reaches"};
}

Reason InterpolatedFrames(const RunFacts& facts) {
  FrameRanges frames = FramesIn(facts, PoseState::kInterpolated);
  std::erase_if(frames, [](const auto& range) {
    // Up to three frames are as good as measured: a hand-held camera moves evenly for as long.
    return range.second - range.first < 3;
  });
  if (frames.empty()) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "these frames see too few points of the map; their positions are "
                     "interpolated between the frames around them"};
}

Reason UntiedScale(const RunFacts& facts) {
  FrameRanges frames;
  for (const Segment& segment : facts.segments) {
    if (segment.scale == "continuity") AddFrames(segment.first_frame, segment.last_frame, frames);
  }
  if (frames.empty()) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "no points tie this part of the map to the part before; its scale and place "
                     "are guesses. Distances within it are right among themselves"};
}

Reason BreaksInTheGraph(const RunFacts& facts) {
  const int breaks = IntegerIn(facts, "/counts/breaks");
  if (breaks == 0) return {};
  return CheckReason{Verdict::kLookAt,
                     kAllFrames,
                     "the images fall into " + std::to_string(breaks + 1) +
                         " pieces that no match ties (cuts, or a covered lens); the rotation from "
                         "one to the next is a guess. `break` in rotations.csv marks where they "
                         "begin"};
}

Reason WeakTies(const RunFacts& facts) {
  const int ties = IntegerIn(facts, "/counts/weak_ties");
  if (ties == 0) return {};
  return CheckReason{Verdict::kLookAt,
                     kAllFrames,
                     "a few matches alone tie the frames before and after a change of view, " +
                         std::to_string(ties) + (ties == 1 ? " time" : " times") +
                         "; the rotation across can be wrong by degrees. `weak|searched_wide` in "
                         "rotations.csv marks where"};
}

Reason OtherFocalLength(const RunFacts& facts) {
  const nlohmann::ordered_json::json_pointer place("/lens_checks/focal/contradicts");
  if (!facts.summary.contains(place) || !facts.summary.at(place).get<bool>()) return {};
  CheckReason reason{
      Verdict::kLookAt,
      kAllFrames,
      "the images say a focal length of about " +
          Rounded("%.0f px", NumberIn(facts, "/lens_checks/focal/by_images_px")) +
          ", the calibration says " +
          Rounded("%.0f px", NumberIn(facts, "/lens_checks/focal/calibrated_px")) +
          ": is it of this camera, at this zoom and size? --camera none estimates the lens from "
          "the images"};
  reason.warns = true;
  return reason;
}

Reason NotCalibrated(const RunFacts& facts) {
  const std::string source = TextIn(facts, "/calibration/source");
  if (source == "images") {
    return CheckReason{Verdict::kLookAt,
                       kAllFrames,
                       "the lens is estimated from the images, not calibrated; angles and shapes "
                       "may be off by some tenths of a percent"};
  }
  if (source != "guess") return {};
  return CheckReason{Verdict::kLookAt,
                     kAllFrames,
                     "there is no calibration and the images do not tell the lens; angles and "
                     "shapes may be off by tens of percent. Use `rotslam calibrate`"};
}

Reason OtherProjection(const RunFacts& facts) {
  const nlohmann::ordered_json::json_pointer place("/lens_checks/is_fisheye");
  if (!facts.summary.contains(place) || !facts.summary.at(place).get<bool>()) return {};
  return CheckReason{Verdict::kDoNotUse,
                     kAllFrames,
                     "the images look like those of a fisheye lens, the calibration has another "
                     "projection; calibrate the camera as `model: equidistant`"};
}

Reason Zooms(const RunFacts& facts) {
  if (IntegerIn(facts, "/lens_checks/zooms") == 0) return {};
  FrameRanges frames;
  AddFrames(IntegerIn(facts, "/lens_checks/zoom/first_frame"),
            IntegerIn(facts, "/lens_checks/zoom/last_frame"),
            frames);
  const nlohmann::ordered_json::json_pointer followed("/lens_checks/zooms_followed");
  const bool is_followed = facts.summary.contains(followed) && facts.summary.at(followed);
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "the lens zooms: the focal length becomes " +
                         Rounded("%.2f", NumberIn(facts, "/lens_checks/zoom/factor")) +
                         (is_followed ? " times as long. It is followed, to a percent or so"
                                      : " times as long, and orientations, path and map are less "
                                        "certain from there on")};
}

Reason ShutterGuessed(const RunFacts& facts) {
  if (TextIn(facts, "/readout/source") != "images") return {};
  return CheckReason{Verdict::kLookAt,
                     kAllFrames,
                     "the rolling shutter's readout, " +
                         Rounded("%.1f ms", 1e3 * NumberIn(facts, "/readout/readout_s")) +
                         ", is estimated from the images. Put readout_s into the calibration if "
                         "you know it"};
}

Reason FewPoints(const RunFacts& facts) {
  // A frame needs a dozen points for its pose, and a map of fewer than a hundred a keyframe stands
  // and falls with single matches.
  constexpr double kFew = 100.0;
  constexpr double kTooFew = 30.0;
  const double keyframes = NumberIn(facts, "/counts/keyframes");
  if (!facts.summary.contains("ba") || keyframes < 1.0) return {};
  const double seen = NumberIn(facts, "/ba/observations") / keyframes;
  if (seen >= kFew) return {};
  return CheckReason{seen < kTooFew ? Verdict::kDoNotUse : Verdict::kLookAt,
                     kAllFrames,
                     "a keyframe sees " + Rounded("%.0f", seen) +
                         " points of the map on average, which is few; use larger or sharper "
                         "images, or a scene with more texture"};
}

Reason StaticContent(const RunFacts& facts) {
  const auto masks = facts.summary.find("masks");
  if (masks == facts.summary.end() || masks->is_null()) return {};
  const std::string kind = masks->value("static_content", "none");
  if (kind == "on_picture") {
    return CheckReason{
        Verdict::kLookAt,
        kAllFrames,
        "parts of the picture do not move with the scene (text, dirt or drops); they "
        "were left out, mask.png shows them. --no-auto-mask keeps them, --mask FILE "
        "names your own"};
  }
  if (kind == "undecided") {
    return CheckReason{Verdict::kLookAt,
                       kAllFrames,
                       "much of the picture never moves: either the camera stands and things pass, "
                       "or something is on the picture and the camera moves. The images do not "
                       "decide; --mask FILE leaves parts of the picture out"};
  }
  return {};
}

Reason HeldToOdometry(const RunFacts& facts) {
  const FrameRanges frames = FramesNoted(facts, "orientation held to the odometry");
  if (frames.empty()) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "the map's points and the odometry disagree about the orientation; these "
                     "frames have the odometry's, and positions that fit it (poses.csv says by "
                     "how much they disagree)",
                     true};
}

Reason LeavesOdometry(const RunFacts& facts) {
  const FrameRanges frames = FramesNoted(facts, "orientation leaves the odometry");
  if (frames.empty()) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(frames),
                     "the map turns these frames by another angle than the odometry does, by more "
                     "than both deviations allow (poses.csv says by how much); a zoom, a wrong "
                     "calibration or wrong matches do that",
                     true};
}

Reason LargeResiduals(const RunFacts& facts) {
  // Good corners fit to half a pixel of the images that were worked with; two pixels is where
  // bundle adjustment calls them outliers.
  constexpr double kLarge_px = 1.0;
  constexpr double kTooLarge_px = 2.0;
  const double mean_px = NumberIn(facts, "/ba/mean_error_px");
  const double worked_px = mean_px * NumberIn(facts, "/sequence/working_scale", 1.0);
  if (worked_px <= kLarge_px) return {};
  return CheckReason{worked_px > kTooLarge_px ? Verdict::kDoNotUse : Verdict::kLookAt,
                     kAllFrames,
                     "points miss their places in the images by " + Rounded("%.1f px", mean_px) +
                         " on average; check the calibration"};
}

Reason LoopsRefused(const RunFacts& facts) {
  // So many matches agree by chance nowhere.
  constexpr int kMinInliers = 30;
  FrameRanges refused;
  int num_refused = 0;
  int num_accepted = 0;
  for (const LoopRow& loop : facts.loops) {
    if (loop.accepted) {
      ++num_accepted;
    } else if (loop.inliers >= kMinInliers) {
      ++num_refused;
      AddFrames(loop.frame, loop.frame, refused);
    }
  }
  if (num_refused <= num_accepted) return {};
  return CheckReason{Verdict::kLookAt,
                     DescribeFrames(refused),
                     "these frames look like older ones and match them, but the path in between "
                     "disagrees, so they were not tied; drift stays in the result (loops.csv)"};
}

// One reason each; the order is that of the output among equal verdicts.
constexpr std::array<ReasonOf, 18> kReasons = {Interrupted,
                                               UnplacedFrames,
                                               UntiedScale,
                                               BreaksInTheGraph,
                                               WeakTies,
                                               LeavesOdometry,
                                               HeldToOdometry,
                                               ExtrapolatedFrames,
                                               InterpolatedFrames,
                                               StaticContent,
                                               FewPoints,
                                               LargeResiduals,
                                               OtherProjection,
                                               Zooms,
                                               OtherFocalLength,
                                               NotCalibrated,
                                               ShutterGuessed,
                                               LoopsRefused};

}  // namespace

const char* Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kGreen:
      return "green";
    case Verdict::kLookAt:
      return "look at";
    case Verdict::kDoNotUse:
      return "do not use";
  }
  return "";
}

RunCheck CheckFacts(const RunFacts& facts) {
  RunCheck check;
  for (const ReasonOf reason_of : kReasons) {
    if (auto reason = reason_of(facts)) check.reasons.push_back(*std::move(reason));
  }
  std::stable_sort(
      check.reasons.begin(), check.reasons.end(), [](const CheckReason& a, const CheckReason& b) {
        return a.verdict > b.verdict;
      });
  if (!check.reasons.empty()) check.verdict = check.reasons.front().verdict;
  return check;
}

RunCheck CheckRun(const std::filesystem::path& run) {
  RunFacts facts;
  facts.summary = ReadSummaryOf(run);
  const auto is_there = [&](const char* name) { return std::filesystem::exists(run / name); };
  if (is_there("loops.csv")) facts.loops = ReadLoopsCsv(run / "loops.csv");
  // Other files in the folder are then from an older run.
  if (facts.summary.value("command", "") == "rotations" ||
      facts.summary.value("interrupted", false)) {
    return CheckFacts(facts);
  }
  if (is_there("poses.csv")) facts.poses = ReadPosesCsv(run / "poses.csv");
  if (is_there("segments.csv")) facts.segments = ReadSegmentsCsv(run / "segments.csv");
  return CheckFacts(facts);
}

std::string Describe(const RunCheck& check) {
  const std::string text = Name(check.verdict);
  if (check.reasons.empty()) return text + ": nothing speaks against this run";
  return text + ": " + std::to_string(check.reasons.size()) +
         (check.reasons.size() == 1 ? " reason" : " reasons");
}

}  // namespace rotslam
