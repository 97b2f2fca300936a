#include "apps/simulation/simulation.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

CameraPath MakePath(const SimulationOptions& options) {
  const double fps = options.fps;
  switch (options.kind) {
    case SimulationKind::kGimbal: {
      GimbalPathOptions gimbal;
      if (fps > 0.0) gimbal.fps = fps;
      gimbal.num_frames =
          options.frames > 0
              ? options.frames
              : std::max(10,
                         static_cast<int>(std::lround(gimbal.num_frames / options.speed_scale)));
      gimbal.axis = options.turn_axis;
      gimbal.turn_deg = options.turn_deg;
      gimbal.lever_arm_m = options.lever_arm_m;
      return GimbalPath(gimbal);
    }
    case SimulationKind::kHandheld: {
      HandheldPathOptions handheld;
      if (fps > 0.0) handheld.fps = fps;
      if (options.frames > 0) handheld.num_frames = options.frames;
      handheld.speed_scale = options.speed_scale;
      handheld.seed = options.seed;
      return HandheldPath(handheld);
    }
    case SimulationKind::kStreet:
      break;
  }
  StreetPathOptions street;
  if (fps > 0.0) street.fps = fps;
  street.speed_scale = options.speed_scale;
  CameraPath path =
      options.poses.empty()
          ? StreetPath(street)
          : PathThroughPoses(ReadKittiPoses(options.poses), street.fps, options.speed_scale);
  if (options.frames > 0) path.num_frames = std::min(path.num_frames, options.frames);
  return path;
}

// Time of a frame since the start, rounded to what file names can say.
double FrameTime(int frame, double fps) { return std::round(1e6 * frame / fps) * 1e-6; }

// The whole path, one pose about every `step_s`, whatever part of it is rendered: the world must
// not depend on the part.
Trajectory WholePath(const SimulationOptions& options) {
  SimulationOptions whole = options;
  whole.frames = 0;
  whole.speed_scale = 1.0;
  whole.fps = 0.0;
  const CameraPath path = MakePath(whole);
  Trajectory poses;
  for (int k = 0; k < path.num_frames; ++k) poses.push_back(path.at(k / path.fps));
  return poses;
}

}  // namespace

const char* Name(SimulationKind kind) {
  switch (kind) {
    case SimulationKind::kGimbal:
      return "gimbal";
    case SimulationKind::kHandheld:
      return "handheld";
    case SimulationKind::kStreet:
      return "street";
  }
  return "";
}

std::optional<std::string> SimulationOptions::Problem() const {
  if (frames < 0) return OutOfRange("frames", frames, "at least 0 (0: all the path has)");
  if (kind == SimulationKind::kGimbal && frames > 0 && frames < 10) {
    return OutOfRange("frames", frames, "at least 10 for a gimbal path");
  }
  if (first < 0) return OutOfRange("first", first, "at least 0");
  if (last >= 0 && last < first) return OutOfRange("last", last, "not before first");
  if (!(fps >= 0.0 && fps <= 100000.0)) return OutOfRange("fps", fps, "in [0, 100000]");
  if (!(speed_scale >= 1e-3 && speed_scale <= 1e3)) {
    return OutOfRange("speed_scale", speed_scale, "in [0.001, 1000]");
  }
  if (!(std::abs(turn_deg) <= 3600.0)) return OutOfRange("turn_deg", turn_deg, "within +-3600");
  if (!(std::abs(lever_arm_m) <= 0.4)) {
    return OutOfRange("lever_arm_m", lever_arm_m, "within +-0.4, to stay clear of the furniture");
  }
  if (!poses.empty() && kind != SimulationKind::kStreet) {
    return std::string("poses are for a street only");
  }
  if (distractors < 0 || distractors > 1000) {
    return OutOfRange("distractors", distractors, "in [0, 1000]");
  }
  if (!(start_s >= 0.0 && start_s < 4e9)) return OutOfRange("start_s", start_s, "in [0, 4e9)");
  if (camera.fx > 0.0) {
    if (const auto problem = camera.Problem()) return "camera: " + *problem;
  }
  return render.Problem();
}

Camera CameraWithView(int width, int height, double hfov_deg) {
  if (width < 1 || height < 1)
    throw std::invalid_argument("camera: width and height must be positive");
  if (!(hfov_deg > 0.0 && hfov_deg < 179.0)) {
    throw std::invalid_argument("camera: horizontal view must lie in (0, 179) deg");
  }
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = 0.5 * width / std::tan(0.5 * hfov_deg * kRadFromDeg);
  camera.fy = camera.fx;
  camera.cx = 0.5 * (width - 1);
  camera.cy = 0.5 * (height - 1);
  return camera;
}

Simulation::Simulation(const SimulationOptions& options) : options_(options) {
  if (const auto problem = options.Problem()) throw std::invalid_argument("simulate: " + *problem);
  options_.render.seed = HashBits(options.seed, 1, 51);
  camera_ = options.camera;
  if (camera_.fx <= 0.0) camera_ = CameraWithView(640, 480, 65.0);
  path_ = MakePath(options);
  const int last =
      options.last < 0 ? path_.num_frames - 1 : std::min(options.last, path_.num_frames - 1);
  if (options.first > last) {
    throw std::invalid_argument("simulate: first is " + std::to_string(options.first) +
                                ", but the path has " + std::to_string(path_.num_frames) +
                                " frames");
  }
  for (int frame = options.first; frame <= last; ++frame) {
    const double time_s = FrameTime(frame, path_.fps);
    truth_.push_back(path_.at(time_s));
    truth_.back().timestamp_s = options.start_s + time_s;
  }
  for (PathSegment segment : path_.segments) {
    segment.first_frame = std::max(segment.first_frame, options.first) - options.first;
    segment.last_frame = std::min(segment.last_frame, last) - options.first;
    if (segment.first_frame <= segment.last_frame) segments_.push_back(segment);
  }
  if (options.kind == SimulationKind::kStreet) {
    StreetOptions street;
    street.seed = options.seed;
    const Trajectory whole = WholePath(options);
    world_ = std::make_unique<World>(MakeStreet(whole, street));
    moving_ = StreetDistractors(options.distractors, whole, street);
  } else {
    world_ = std::make_unique<World>(MakeRoom(options.seed));
    moving_ = RoomDistractors(options.distractors, options.seed);
  }
  rays_ = std::make_unique<PixelRays>(camera_);
}

StampedPose Simulation::PoseAt(double timestamp_s) const {
  StampedPose pose = path_.at(timestamp_s - options_.start_s);
  pose.timestamp_s = timestamp_s;
  return pose;
}

cv::Mat Simulation::Render(int k) const {
  if (k < 0 || k >= NumFrames()) {
    throw std::invalid_argument("Simulation: no frame " + std::to_string(k));
  }
  const int frame = options_.first + k;
  return RenderFrame(
      {*world_, moving_}, *rays_, path_.at, {FrameTime(frame, path_.fps), frame}, options_.render);
}

SimulatedSequence RenderSequence(const SimulationOptions& options, int num_threads) {
  const Simulation simulation(options);
  SimulatedSequence sequence;
  sequence.camera = simulation.GetCamera();
  sequence.truth = simulation.Truth();
  sequence.segments = simulation.Segments();
  sequence.images.resize(static_cast<std::size_t>(simulation.NumFrames()));
  ParallelFor(simulation.NumFrames(), num_threads, [&](int k) {
    sequence.images[k] = simulation.Render(k);
  });
  return sequence;
}

}  // namespace rotslam
