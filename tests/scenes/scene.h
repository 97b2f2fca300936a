#pragma once

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/splitmix64.h"
#include "rotodom/types/track.h"

namespace rotslam {

enum class ScenePath {
  kRing,    // cameras on a circle of radius 6 around the points, looking in
  kStreet,  // driving: forward motion past points on both sides, tracks a few views long
  kRandom,  // centres in a box of side 4, looking at a cloud 6 away
  kPivot,   // every camera at the origin, yaw swept: pure rotation
  kOrbit,   // as kRing, but sights come and go: 11.4 views a point, long tracks among them, a tenth
            // of the points seen from anywhere, so that every two of some 170 cameras share some
};

/// A synthetic world: who sees what, and how wrong.
struct SceneOptions {
  int num_views = 10;
  int num_points = 200;
  double noise_px = 0.0;            // standard deviation of each image coordinate
  double outlier_ratio = 0.0;       // share of observations replaced by a uniform pixel
  double rotation_noise_deg = 0.0;  // length scale of the error of each given rotation, per axis
  // Points are seen by the views nearest to them only, so that tracks have about this length on
  // kRing and kRandom; 0: by every view that can. A street's tracks end by themselves.
  int max_track_length = 0;
  ScenePath path = ScenePath::kRing;
  std::uint64_t seed = 1;
};

/// Truth and what is measured of it. Frames are 0 .. num_views - 1, tracks 0 .. num_points - 1 less
/// those seen fewer than twice.
struct Scene {
  Camera camera;  // pinhole, f = 700, 1241 x 376 on a street, else 1280 x 960
  RotationMap true_cam_from_world;
  CenterMap true_center_in_world;
  PointMap true_point_in_world;
  RotationMap cam_from_world;  // with rotation noise: what a solver is given
  std::vector<Track> tracks;   // with pixel noise and outliers
  std::set<std::pair<TrackId, FrameId>> outliers;
};

/// Same options, same scene, on every machine with IEEE doubles (own generator, no std
/// distributions).
Scene MakeScene(const SceneOptions& options);

/// Options of the scenes by which the known-rotation solver is measured: 0.7 px of noise at f =
/// 700, 0.03 deg of rotation error; 6.4 views a point on the street, 172 cameras around 14,828
/// points on the orbit.
SceneOptions DrivingOptions(int num_views, int num_points, std::uint64_t seed);
SceneOptions DenseOrbitOptions(std::uint64_t seed);

/// Uniform and normal numbers with the same sequence everywhere.
class SceneRandom {
 public:
  explicit SceneRandom(std::uint64_t seed) : random_(seed * 0x9E3779B97F4A7C15ull + 1) {}
  double Uniform(double low, double high);
  double Normal(double sigma);
  Eigen::Vector3d NormalVector(double sigma);
  int Index(int count);  // in [0, count)

 private:
  SplitMix64 random_;
};

}  // namespace rotslam
