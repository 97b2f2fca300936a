#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "apps/simulation/texture.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

// Worlds have x right, y down, z forward at the start; metres. Floors lie in planes of constant y.

/// A flat piece of the world: the parallelogram origin + u edge_u + v edge_v, 0 <= u, v <= 1, or
/// the half of it with u + v <= 1. Seen from both sides.
struct Surface {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d edge_u = Eigen::Vector3d::UnitX();
  Eigen::Vector3d edge_v = Eigen::Vector3d::UnitY();
  bool triangle = false;
  /// Texture coordinates in metres: st_origin + u st_u + v st_v.
  Eigen::Vector2d st_origin = Eigen::Vector2d::Zero();
  Eigen::Vector2d st_u = Eigen::Vector2d::UnitX();
  Eigen::Vector2d st_v = Eigen::Vector2d::UnitY();
  Material material;
  /// Pieces with one sheet carry one continuous texture (the triangles of the ground): no edge is
  /// drawn between them. Negative: a sheet of its own.
  int sheet = -1;
};

/// A quad whose texture coordinates are metres from `origin` along its (orthogonal) edges; fills in
/// the material's size.
Surface MakeQuad(const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& edge_s,
                 const Eigen::Vector3d& edge_t,
                 Material material);

/// An upright box, turned about the vertical.
struct Box {
  Eigen::Vector3d foot_in_world = Eigen::Vector3d::Zero();  // centre of the bottom face
  Eigen::Vector3d size_m = Eigen::Vector3d::Ones();         // along right, up, forward at yaw zero
  double yaw_rad = 0.0;                                     // from forward (+z) towards right (+x)
  Material sides;
  Material top;
};

/// Adds the six faces; each has a seed of its own, drawn from the material's.
void AddBox(std::vector<Surface>& surfaces, const Box& box);

/// A box that moves through the scene: foot = foot_in_world + travel * sin(2 pi (time / period +
/// phase)).
struct MovingBox {
  Box box;
  Eigen::Vector3d travel_m = Eigen::Vector3d::Zero();
  double period_s = 4.0;
  double phase = 0.0;

  Box At(double time_s) const;
};

/// Diffuse light: ambient + diffuse * |cos(angle of incidence)|. The light of a lamp decreases with
/// the distance.
struct Light {
  bool lamp = false;  // a lamp at `place`, else parallel light from the direction `place`
  Eigen::Vector3d place = Eigen::Vector3d(0.4, -0.8, -0.45);
  float ambient = 0.55f;
  float diffuse = 0.5f;
};

/// Hands out materials, each with a seed of its own, and numbers.
class Painter {
 public:
  struct Streams {
    int materials = 0;
    int numbers = 0;
  };

  Painter(std::uint64_t seed, const Streams& streams) : seed_(seed), streams_(streams) {}

  Material Paint(Pattern pattern, float tone, float contrast = 1.0f) {
    Material material;
    material.pattern = pattern;
    material.seed = HashBits(seed_, ++count_, streams_.materials);
    material.tone = tone;
    material.contrast = contrast;
    return material;
  }
  /// A number in [low, high).
  double Draw(double low, double high) {
    return low + (high - low) * UnitFrom(HashBits(seed_, ++count_, streams_.numbers), 0, 24);
  }

 private:
  std::uint64_t seed_;
  Streams streams_;
  std::int64_t count_ = 0;
};

/// Surfaces with a bounding volume hierarchy for ray casting.
class World {
 public:
  struct Hit {
    int surface = -1;                                           // -1: the sky
    double distance = std::numeric_limits<double>::infinity();  // in lengths of the direction
  };

  /// @param surfaces  at least one, with finite edges of non-zero area; throws
  ///                  std::invalid_argument otherwise.
  World(std::vector<Surface> surfaces, const Light& light, const Material& sky);

  const std::vector<Surface>& Surfaces() const { return surfaces_; }
  const Light& Lighting() const { return light_; }
  const Material& Sky() const { return sky_; }

  /// First surface along a ray. The time is logarithmic in the number of surfaces.
  /// @param guess  a surface that is likely hit, e.g. by the neighbouring ray; -1: none. It saves
  ///               time and changes the result only between surfaces at exactly the same distance.
  Hit Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, int guess = -1) const;

  /// Distance at which the ray meets the plane of a surface, whether inside its borders or not.
  double DistanceToPlane(int surface,
                         const Eigen::Vector3d& origin,
                         const Eigen::Vector3d& direction) const;
  /// Texture coordinates of a point of the surface's plane.
  Eigen::Vector2d TextureCoordinates(int surface, const Eigen::Vector3d& point) const;
  const Eigen::Vector3d& Normal(int surface) const { return plates_[surface].normal; }
  /// Equal for surfaces that share a sheet, different otherwise; -1 for the sky.
  int Sheet(int surface) const { return surface < 0 ? -1 : plates_[surface].sheet; }

 private:
  struct Plate {  // a surface, prepared for intersection
    Eigen::Vector3d normal;
    double offset;               // normal . point on the plane
    Eigen::Vector3d u_of_point;  // u = u_of_point . point - u_offset
    Eigen::Vector3d v_of_point;
    double u_offset;
    double v_offset;
    bool triangle;
    int sheet;
  };
  struct Node {
    Eigen::Array3d low;
    Eigen::Array3d high;
    int first;  // inner node: index of the second child (the first follows); leaf: into order_
    int count;  // 0: inner node
    int axis;
  };

  void BuildNode(int begin, int end, const std::vector<Eigen::Array3d>& centers);
  // Sorts order_[begin, end) along an axis and returns the index at which to split it.
  int Split(int begin, int end, int axis, const std::vector<Eigen::Array3d>& centers);
  bool HitPlate(int surface,
                const Eigen::Vector3d& origin,
                const Eigen::Vector3d& direction,
                Hit& hit) const;

  std::vector<Surface> surfaces_;
  std::vector<Plate> plates_;
  std::vector<Node> nodes_;
  std::vector<int> order_;
  Light light_;
  Material sky_;
};

/// A furnished room, 6 x 4.5 x 2.7 m; floor at y = 0, centre at the origin. Free for a camera:
/// |x| < 1.5, |z| < 0.9, 1.0 m to 2.3 m above the floor.
World MakeRoom(std::uint64_t seed);

/// Options of the objects along a simulated street.
struct StreetOptions {
  double camera_height_m = 1.65;
  double road_half_width_m = 4.6;  // nothing solid stands nearer to the path
  double house_setback_m = 8.0;    // from the path to the house fronts, at least
  double mean_gap_m = 2.0;         // between houses
  double car_density = 0.45;       // share of the parking places that are taken
  std::uint64_t seed = 1;
};

/// A street of houses, parked cars, poles and trees along a path; the ground follows its height.
/// @param path  camera poses, at least one; consecutive centres a few metres apart at most.
World MakeStreet(const Trajectory& path, const StreetOptions& options);

/// Boxes that wander through the room (see MakeRoom), textured like the furniture.
std::vector<MovingBox> RoomDistractors(int count, std::uint64_t seed);

/// Vehicles that drive to and fro across the first, second ... part of the path.
std::vector<MovingBox> StreetDistractors(int count,
                                         const Trajectory& path,
                                         const StreetOptions& options);

}  // namespace rotslam
