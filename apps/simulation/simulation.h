#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "apps/simulation/paths.h"
#include "apps/simulation/render.h"
#include "apps/simulation/world.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

enum class SimulationKind {
  kGimbal,    // a room: translate, stop, rotate in place, translate on
  kHandheld,  // a room: a walk with the camera in the hand
  kStreet,    // a street along a built-in path or KITTI poses
};

/// `gimbal`, `handheld` or `street`.
const char* Name(SimulationKind kind);

/// Options of a simulated sequence: camera, image noise, blur and moving objects.
struct SimulationOptions {
  SimulationKind kind = SimulationKind::kGimbal;
  // Frames of the whole path; 0: as many as the kind brings (gimbal 120, handheld 150, a street to
  // its end). A gimbal path is stretched over them, the others are cut.
  int frames = 0;
  // First and last frame to render, within the whole path; negative last: to the end. Frames keep
  // number, timestamp and picture whatever the range.
  int first = 0;
  int last = -1;
  double fps = 0.0;                     // frames a second; 0: 30 in the room, 10 in the street
  double speed_scale = 1.0;             // the same way in fewer (> 1) or more (< 1) frames
  TurnAxis turn_axis = TurnAxis::kYaw;  // gimbal: what the camera turns about in place
  double turn_deg = 120.0;              // gimbal: angle turned in place; negative turns left
  double lever_arm_m = 0.0;  // gimbal: from the axis of the turn forward to the camera's centre
  std::string poses;         // street: KITTI pose file; empty: the built-in path
  int distractors = 0;       // boxes moving through the scene
  // Size 0 by 0 or no focal length: 640 x 480 with a horizontal view of 65 deg.
  Camera camera;
  RenderOptions render;
  std::uint64_t seed = 1;   // of the world, the path and the noise
  double start_s = 1000.0;  // timestamp of frame 0

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("frames", frames);
    visit("first", first);
    visit("last", last);
    visit("fps", fps);
    visit("speed_scale", speed_scale);
    visit("turn_deg", turn_deg);
    visit("lever_arm_m", lever_arm_m);
    visit("poses", poses);
    visit("distractors", distractors);
    visit("render", render);
    visit("seed", seed);
    visit("start_s", start_s);
  }
};

/// Pinhole camera of a size and horizontal field of view, principal point in the middle.
Camera CameraWithView(int width, int height, double hfov_deg);

/// A world, a path through it and a camera. Every picture of the sequence can be rendered, in any
/// order and from any thread.
class Simulation {
 public:
  /// Throws std::invalid_argument where options.Problem(), std::runtime_error on a bad pose file.
  explicit Simulation(const SimulationOptions& options);

  int NumFrames() const { return static_cast<int>(truth_.size()); }
  const Camera& GetCamera() const { return camera_; }
  const World& GetWorld() const { return *world_; }
  double Fps() const { return path_.fps; }
  /// Pose of each frame, camera->world. Timestamps are whole microseconds.
  const Trajectory& Truth() const { return truth_; }
  /// Segments of the path, numbered by the frames rendered; empty but for a gimbal path.
  const std::vector<PathSegment>& Segments() const { return segments_; }
  /// Pose at any time of the sequence's clock; equals Truth() at the frames' timestamps.
  StampedPose PoseAt(double timestamp_s) const;

  /// Frame 0 <= k < NumFrames(), CV_8UC1 or CV_8UC3.
  cv::Mat Render(int k) const;

 private:
  SimulationOptions options_;
  CameraPath path_;
  Camera camera_;
  std::unique_ptr<World> world_;
  std::vector<MovingBox> moving_;
  std::unique_ptr<PixelRays> rays_;
  Trajectory truth_;
  std::vector<PathSegment> segments_;
};

/// A whole sequence in memory, for tests.
struct SimulatedSequence {
  Camera camera;
  std::vector<cv::Mat> images;
  Trajectory truth;  // one pose an image
  std::vector<PathSegment> segments;
};

/// The same bytes at any `num_threads`.
SimulatedSequence RenderSequence(const SimulationOptions& options, int num_threads = 1);

}  // namespace rotslam
