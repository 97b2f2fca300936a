#include "apps/cli/terminal/slam_progress.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <vector>

#include "apps/cli/terminal/describe.h"
#include "apps/slam/connected_frames.h"
#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "apps/slam/working_size/original_size.h"
#include "apps/slam/zoom/follow_zooms.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

// Counts inliers, loops and segments for the line of progress.
class SlamProgress::Counters {
 public:
  explicit Counters(const PureRotationOptions& options) : options_(options) {}

  std::vector<std::string> Update(const LoopedEstimate& estimate, const OdometryResult& result) {
    num_loops_ += std::count_if(estimate.loops.begin(),
                                estimate.loops.end(),
                                [](const LoopCheck& check) { return check.accepted; });
    // Counting takes time in proportion to the frames read so far. The interval grows with them, so
    // that the time of all counts together stays in proportion to the length of the sequence.
    constexpr int kMinFramesBetweenCounts = 30;  // about a second of video
    if (estimate.frame.value >= next_count_) {
      num_segments_ = CountSegments(result);
      next_count_ =
          estimate.frame.value + std::max(kMinFramesBetweenCounts, estimate.frame.value / 10);
    }
    return {std::to_string(estimate.report.num_inliers) + " inliers",
            Counted(num_loops_, "loop"),
            Counted(num_segments_, "segment")};
  }

 private:
  static std::string Counted(std::int64_t count, const std::string& what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
  }

  // Segments on which the camera moves, or does not.
  std::int64_t CountSegments(const OdometryResult& result) const {
    const RotationMap& cam_from_world = result.cam_from_world;
    std::int64_t count = 0;
    int next = cam_from_world.begin()->first.value;
    for (const PureRotationSegment& segment :
         FindPureRotationSegments(result.graph, cam_from_world, options_)) {
      count += segment.first.value > next ? 2 : 1;
      next = segment.last.value + 1;
    }
    return count + (cam_from_world.rbegin()->first.value >= next ? 1 : 0);
  }

  PureRotationOptions options_;
  std::int64_t num_loops_ = 0;
  std::int64_t num_segments_ = 1;
  int next_count_ = 29;  // frame id; the 30th frame
};

namespace {

// "12, 40-52 and 3 more": the ranges of ids in a set, as many as a line has room for.
std::string FrameRanges(const std::set<FrameId>& frames) {
  constexpr int kMaxNamedRanges = 6;  // fit a line of a terminal with the rest of the sentence
  std::string text;
  int num_ranges = 0;
  int num_named = 0;
  for (auto first = frames.begin(); first != frames.end() && num_ranges < kMaxNamedRanges;
       ++num_ranges) {
    auto end = std::next(first);
    int last = first->value;
    for (; end != frames.end() && end->value == last + 1; ++end) ++last;
    num_named += last - first->value + 1;
    text += (text.empty() ? "" : ", ") + std::to_string(first->value) +
            (last > first->value ? "-" + std::to_string(last) : std::string());
    first = end;
  }
  const int num_more = static_cast<int>(frames.size()) - num_named;
  return text + (num_more > 0 ? " and " + std::to_string(num_more) + " more" : std::string());
}

// Warns of a video that was cut off. Containers often announce one or two frames too many.
void WarnOfMissingFrames(int num_frames, int num_announced, Progress& progress) {
  const int num_missing = num_announced - num_frames;
  if (num_missing <= std::max(2, num_announced / 100)) return;
  progress.Warn(
      "the video ends after " + std::to_string(num_frames) + " of the " +
      std::to_string(num_announced) +
      " frames it announces: the file is cut off or damaged. The result covers the frames "
      "before the end. If you need the rest, copy or export the video again");
}

void TellDetails(const LoopedEstimate& estimate, Progress& progress) {
  const FrameReport& report = estimate.report;
  progress.Detail("frame " + std::to_string(estimate.frame.value) + ": " +
                  std::to_string(report.num_tracked) + " points tracked, " +
                  std::to_string(report.num_inliers) + " inliers" +
                  (report.predicted_only ? ", no edge" : "") + (report.weak ? ", weak" : "") +
                  (report.searched_wide ? ", searched wide" : "") +
                  (estimate.has_averaged ? ", drift spread over all orientations" : ""));
  for (const LoopCheck& check : estimate.loops) {
    progress.Detail("frame " + std::to_string(check.frame.value) + " looks like frame " +
                    std::to_string(check.match.value) + ": " + std::to_string(check.num_inliers) +
                    " inliers, " + std::to_string(check.angle_deg) + " deg around the loop, " +
                    (check.accepted ? "accepted, " + std::to_string(check.num_edges) + " edges"
                                    : std::string("not accepted")));
  }
}

// A loop along which the camera turned right round measures the scale of all rotations.
void WarnOfRotationScale(const std::vector<LoopCheck>& loops, Progress& progress) {
  // Smallest relative error of the rotations that is worth a warning.
  constexpr double kNotable = 0.02;
  const RotationScale scale = RotationScaleOf(loops);
  if (std::abs(scale.factor - 1.0) < kNotable) return;
  const bool is_small = scale.factor > 1.0;
  std::array<char, 320> text = {};
  std::snprintf(text.data(),
                text.size(),
                "turns around closed loops come out %.1f %% too %s (%d loops): the focal length is "
                "probably too %s by that share, which bends the path and the map. Calibrate the "
                "camera (rotslam calibrate), or correct the focal length in the camera file",
                100.0 * std::abs(scale.factor - 1.0),
                is_small ? "small" : "large",
                scale.num_loops,
                is_small ? "long" : "short");
  progress.Warn(text.data());
}

// @param unreadable  frames that have had a warning of their own.
std::string DegText(double rad) { return FormatNumber("%.2f", rad * kDegFromRad) + " deg"; }

// Offset and mounting of given orientations, each with its deviation; empty where there is neither.
std::string DescribeAlignment(const SensorAlignment& alignment) {
  std::string text;
  if (alignment.has_offset) {
    text = FormatNumber("%.1f", 1e3 * std::abs(alignment.offset_s)) + " ms (+- " +
           FormatNumber("%.1f", 1e3 * alignment.offset_sigma_s) + ") " +
           (alignment.offset_s > 0.0 ? "late" : "early");
  }
  if (alignment.has_mounting) {
    // Of the angle: along the axis turned about.
    const Eigen::Vector3d turn = alignment.cam_from_sensor.Log();
    const Eigen::Vector3d axis = turn.normalized();
    const double sigma_rad = std::sqrt(axis.dot(alignment.mounting_covariance * axis));
    text += (text.empty() ? "" : " and ") + ("turned by " + DegText(turn.norm())) + " (+- " +
            FormatNumber("%.2f", sigma_rad * kDegFromRad) + ") against the camera";
  }
  return text;
}

void TellOfGiven(const GivenRotations& given, Progress& progress) {
  const SensorFusion& fusion = given.fusion;
  const std::string alignment = DescribeAlignment(fusion.alignment);
  int num_frames = 0;
  for (const OrientationSource source : fusion.source) {
    num_frames +=
        source == OrientationSource::kBoth || source == OrientationSource::kSensor ? 1 : 0;
  }
  const std::string worth = "they count with " + DegText(fusion.sigma_rad) + " and a drift of " +
                            FormatNumber("%.3f", fusion.drift_rad * kDegFromRad) + " deg a frame";
  const std::string what = "orientations from " + given.file + " for " +
                           std::to_string(num_frames) + " of " +
                           std::to_string(fusion.source.size()) + " frames";
  if (alignment.empty()) {
    progress.Say(what + ", in time and in the camera's axes: " + worth);
  } else if (given.is_aligned) {
    progress.Say(what + ", " + alignment + ", which is taken out: " + worth);
  } else {
    progress.Warn(what + " are " + alignment + ": as they stand " + worth +
                  ", instead of correcting the images. --align takes that out");
  }
}

void WarnOfInterpolatedFrames(const std::set<FrameId>& unconnected,
                              const std::set<FrameId>& unreadable,
                              Progress& progress) {
  std::set<FrameId> frames = unconnected;
  for (const FrameId frame : unreadable) frames.erase(frame);
  if (frames.empty()) return;
  progress.Warn(std::to_string(frames.size()) +
                (frames.size() == 1 ? " frame matches no other (" : " frames match no other (") +
                FrameRanges(frames) +
                "): blurred, covered or without texture. The orientation there is a guess, "
                "interpolated between the frames around. If there are many such frames, cut them "
                "out");
}

void WarnOfBreaks(const std::vector<FrameId>& breaks, Progress& progress) {
  for (const FrameId frame : breaks) {
    progress.Warn("frame " + std::to_string(frame.value) +
                  " matches none before it: the video has a cut there, or the view was lost. How "
                  "far the camera turned across this gap is a guess, and so is the direction of "
                  "everything after it. Split the video there and run the parts one by one");
  }
}

void WarnOfWeakTies(const std::vector<FrameId>& ties, Progress& progress) {
  for (const FrameId frame : ties) {
    progress.Warn("frame " + std::to_string(frame.value) +
                  " shares only a few matches with those before it: how far the camera turned "
                  "there can be wrong by degrees, and so can the direction of everything after "
                  "it. Film such changes of view more slowly, or run the parts one by one");
  }
}

// Warns of images of a fisheye lens whose calibration has another projection.
void WarnOfFisheye(const Orientations& orientations, Progress& progress) {
  const FisheyeCheck& check = orientations.fisheye;
  if (!check.IsFisheye()) return;
  const auto percent = [&](int count) {
    return std::to_string(std::lround(100.0 * count / check.num_points)) + " %";
  };
  progress.Warn("the images look like those of a fisheye lens, but the calibration is a " +
                std::string(Name(orientations.camera.model)) + " one: pairs of frames explain " +
                percent(check.num_by_camera) + " of their points with it and " +
                percent(check.num_by_fisheye) +
                " with a fisheye. Rotations, path and map are wrong then: calibrate the camera as "
                "`model: equidistant`");
}

// @param working_scale  working pixels per pixel of the images.
void TellOfZooms(const Orientations& orientations, double working_scale, Progress& progress) {
  double focal_px = orientations.camera.MeanFocal() / working_scale;
  for (const Zoom& zoom : orientations.zooms) {
    if (IsFollowed(zoom, orientations.focal_scales)) {
      const double before_px = focal_px;
      focal_px *= zoom.factor;
      progress.Say("a zoom from frame " + std::to_string(zoom.first.value) + " to " +
                   std::to_string(zoom.last.value) + ": focal length " +
                   FormatNumber("%.1f", before_px) + " -> " + FormatNumber("%.1f", focal_px) +
                   " px, followed");
      continue;
    }
    progress.Warn("frames " + std::to_string(zoom.first.value) + " to " +
                  std::to_string(zoom.last.value) + ": the lens zooms, the focal length becomes " +
                  FormatNumber("%.2f", zoom.factor) +
                  " times as long. From there on orientations, path and map are less certain: film "
                  "without zooming, or run the parts one by one with a calibration each");
  }
}

void TellRelocalised(const std::set<FrameId>& frames, Progress& progress) {
  constexpr std::size_t kMaxNamed = 12;
  if (frames.empty()) return;
  std::string names;
  std::size_t count = 0;
  for (const FrameId frame : frames) {
    if (count++ < kMaxNamed) names += " " + std::to_string(frame.value);
  }
  if (count > kMaxNamed) names += " and " + std::to_string(count - kMaxNamed) + " more";
  progress.Say("keyframes moved to another place of the map, where their view was recognised:" +
               names);
}

void TellCloud(const MapResult& result, double min_angle_deg, Progress& progress) {
  const int num_points = static_cast<int>(result.cloud.point_in_world.size());
  std::array<char, 160> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%d points; %d seen under less than %g deg and %d isolated ones left out",
                num_points,
                result.num_shallow_points,
                min_angle_deg,
                result.num_cloud_outliers);
  progress.EndStage(text.data());
  const int num_all = num_points + result.num_shallow_points + result.num_cloud_outliers;
  if (num_points > 0 && 2 * num_points >= num_all) return;
  progress.Warn(
      "the cloud holds " + std::to_string(num_points) + " of " + std::to_string(num_all) +
      " points: the camera has moved too little for more. Depth is seen only from different "
      "places: walk while you film, best sideways to what you film");
}

std::string DescribeKeyframes(const MapResult& map) {
  return std::to_string(map.keyframes.size()) + " keyframes, " +
         std::to_string(map.keyframe_tracks.size()) + " tracks, " +
         std::to_string(map.segments.size()) + " pure-rotation segment" +
         (map.segments.size() == 1 ? "" : "s");
}

}  // namespace

SlamProgress::SlamProgress(const SlamOptions& options,
                           const WorkingSize& working,
                           const Interruption& interruption,
                           Progress& progress)
    : options_(options), working_(working), interruption_(interruption), progress_(progress) {}

SlamProgress::~SlamProgress() = default;

std::vector<BundleSummary> SlamProgress::OriginalBundles(std::vector<BundleSummary> bundles) const {
  for (BundleSummary& bundle : bundles) ToOriginalSize(working_, bundle);
  return bundles;
}

void SlamProgress::OnBegin(SlamStage stage, int num_steps) {
  if (stage == SlamStage::kOrientations) {
    num_announced_ = num_steps;
    counters_ = std::make_unique<Counters>(options_.pure_rotation_segments);
  }
  progress_.StartStage(ToString(stage), num_steps);
}

void SlamProgress::OnFrame(const FrameProgress& progress) {
  const Frame& frame = progress.frame;
  if (!frame.problem.empty()) {
    unreadable_.insert(frame.id);
    progress_.Warn("frame " + std::to_string(frame.id.value) + " skipped: " + frame.problem +
                   ". Its pose is interpolated between its neighbours. If many frames are "
                   "skipped, copy or export the images again");
  }
  TellDetails(progress.estimate, progress_);
  progress_.Step(frame.id.value + 1, counters_->Update(progress.estimate, progress.odometry));
}

void SlamProgress::OnReadoutFound(const ReadoutEstimate& readout) {
  progress_.EndStage("rolling shutter, read out in " + DescribeReadout(readout));
  progress_.Warn(
      "the camera has a rolling shutter and its readout time was not given, so it was measured "
      "from "
      "the images: the run starts again from the first frame with " +
      CameraLines(readout) + ". Write that into the camera file, and later runs start only once");
}

void SlamProgress::OnStaticContent(const StaticContent& content) {
  if (content.kind == StaticContentKind::kStanding) {
    progress_.Warn(
        "the camera stands, and things move in front of it: the result has one orientation, no "
        "positions and no points. If the camera moved and what does not move is on the picture, "
        "mask that with --mask FILE");
    return;
  }
  progress_.EndStage("static content on the picture");
  const std::string what =
      PercentText(content.mask.Share()) + " of the picture never moves while the rest does";
  if (content.kind == StaticContentKind::kUndecided) {
    progress_.Warn(what +
                   ". Either something lies on the picture (text, drops, dirt, a border): it is "
                   "ignored, and the run starts again. Or the camera stands and things move in "
                   "front of it: then the path is not real, and --no-auto-mask takes it back");
    return;
  }
  progress_.Warn(what +
                 " (text, drops, dirt, a border): it is ignored, and the run starts again from the "
                 "first frame. --no-auto-mask keeps it");
}

void SlamProgress::OnMissingImage(const std::string& problem) {
  progress_.Warn(problem +
                 ": the image could be read before, and now it cannot. The map is finished without "
                 "a second look at this image and may have fewer points there. Keep the files in "
                 "their place until the run has ended");
}

void SlamProgress::OnLensRound(int round, const Camera& camera) {
  if (round == 0) {
    progress_.Say("lens: the first frames, to estimate it from the images");
    return;
  }
  std::array<char, 64> text = {};
  std::snprintf(text.data(),
                text.size(),
                "lens: round %d, from %s, f = %.1f px",
                round,
                Name(camera.model),
                camera.MeanFocal() / working_.scale());
  progress_.Say(text.data());
}

void SlamProgress::OnEnd(SlamStage /*stage*/, const Orientations& orientations) {
  const int num_frames = static_cast<int>(orientations.timestamps_s.size());
  if (!orientations.interrupted) WarnOfMissingFrames(num_frames, num_announced_, progress_);
  progress_.EndStage(std::to_string(num_frames) + " frames, " +
                     std::to_string(orientations.graph.edges().size()) + " edges");
  std::set<FrameId> interpolated = orientations.unconnected;
  if (orientations.given) {
    TellOfGiven(*orientations.given, progress_);
    std::erase_if(interpolated,
                  [&](FrameId frame) { return orientations.given->CountsFor(frame); });
  }
  WarnOfInterpolatedFrames(interpolated, unreadable_, progress_);
  WarnOfFisheye(orientations, progress_);
  TellOfZooms(orientations, working_.scale(), progress_);
  WarnOfRotationScale(orientations.loops, progress_);
  WarnOfBreaks(orientations.breaks, progress_);
  WarnOfWeakTies(FindWeakTies(orientations), progress_);
}

void SlamProgress::OnEnd(SlamStage stage, const MapResult& map) {
  switch (stage) {
    case SlamStage::kTracks:
      progress_.EndStage(DescribeKeyframes(map));
      break;
    case SlamStage::kKnownRotation:
      progress_.EndStage(map.krot.message);
      break;
    case SlamStage::kBundleAdjustment:
      progress_.EndStage(std::to_string(map.map.point_in_world.size()) + " points, " +
                         DescribeMeanError(OriginalBundles(map.bundles)) + ", " +
                         DescribeRounded(working_.Original(map.camera)));
      TellRelocalised(map.relocalised, progress_);
      break;
    case SlamStage::kPureRotation:
      progress_.EndStage("explains " + std::to_string(map.num_rotation_observations) +
                         " observations, " + DescribeRounded(working_.Original(map.camera)));
      break;
    case SlamStage::kFrameRegistration:
      progress_.EndStage(std::to_string(map.num_resected) + " resected, " +
                         std::to_string(map.num_interpolated) + " interpolated");
      if (map.sensor_alignment) {
        const std::string alignment = DescribeAlignment(*map.sensor_alignment);
        progress_.Say("the given orientations against the map's: " +
                      (alignment.empty() ? "in time and in the camera's axes" : alignment));
      }
      break;
    case SlamStage::kCloud:
      TellCloud(map, options_.cloud_min_angle_deg, progress_);
      break;
    case SlamStage::kOrientations:
      break;
  }
}

bool SlamProgress::ShouldStop() {
  if (!interruption_.IsRequested()) return false;
  progress_.Say(
      "interrupted: the frames read so far are finished and written; press Ctrl-C once more to end "
      "at once, without results");
  return true;
}

}  // namespace rotslam
