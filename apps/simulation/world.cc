#include "apps/simulation/world.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include <Eigen/Geometry>

namespace rotslam {
namespace {

constexpr int kLeafSize = 3;
// Tolerance of the borders of a surface, as a share of its edges: rays must not pass between
// adjacent surfaces.
constexpr double kBorderTolerance = 1e-9;

// Axis-aligned box around surfaces, a little larger than they are.
struct Bounds {
  Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d high = -low;

  void Add(const Surface& surface) {
    for (int corner = 0; corner < (surface.triangle ? 3 : 4); ++corner) {
      const Eigen::Array3d point =
          (surface.origin + (corner & 1) * surface.edge_u + (corner >> 1) * surface.edge_v).array();
      low = low.min(point - 1e-7);
      high = high.max(point + 1e-7);
    }
  }
  double HalfArea() const {
    const Eigen::Array3d size = high - low;
    return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
  }
};

}  // namespace

Surface MakeQuad(const Eigen::Vector3d& origin,
                 const Eigen::Vector3d& edge_s,
                 const Eigen::Vector3d& edge_t,
                 Material material) {
  Surface surface;
  surface.origin = origin;
  surface.edge_u = edge_s;
  surface.edge_v = edge_t;
  surface.st_u = {edge_s.norm(), 0.0};
  surface.st_v = {0.0, edge_t.norm()};
  material.size_s_m = static_cast<float>(edge_s.norm());
  material.size_t_m = static_cast<float>(edge_t.norm());
  surface.material = material;
  return surface;
}

void AddBox(std::vector<Surface>& surfaces, const Box& box) {
  const double c = std::cos(box.yaw_rad);
  const double s = std::sin(box.yaw_rad);
  const Eigen::Vector3d right = box.size_m.x() * Eigen::Vector3d(c, 0.0, -s);
  const Eigen::Vector3d up = box.size_m.y() * Eigen::Vector3d(0.0, -1.0, 0.0);
  const Eigen::Vector3d forward = box.size_m.z() * Eigen::Vector3d(s, 0.0, c);
  const Eigen::Vector3d corner = box.foot_in_world - 0.5 * right - 0.5 * forward;
  const auto face = [](Material material, std::uint64_t which) {
    material.seed = HashBits(material.seed, static_cast<std::int64_t>(which), 11);
    return material;
  };
  surfaces.push_back(MakeQuad(corner, right, up, face(box.sides, 0)));                     // back
  surfaces.push_back(MakeQuad(corner + right, forward, up, face(box.sides, 1)));           // right
  surfaces.push_back(MakeQuad(corner + right + forward, -right, up, face(box.sides, 2)));  // front
  surfaces.push_back(MakeQuad(corner + forward, -forward, up, face(box.sides, 3)));        // left
  surfaces.push_back(MakeQuad(corner + up, right, forward, face(box.top, 4)));
  surfaces.push_back(MakeQuad(corner, right, forward, face(box.top, 5)));
}

Box MovingBox::At(double time_s) const {
  Box moved = box;
  moved.foot_in_world += travel_m * std::sin(2.0 * std::numbers::pi * (time_s / period_s + phase));
  return moved;
}

World::World(std::vector<Surface> surfaces, const Light& light, const Material& sky)
    : surfaces_(std::move(surfaces)), light_(light), sky_(sky) {
  if (surfaces_.empty()) throw std::invalid_argument("World: no surfaces");
  const int count = static_cast<int>(surfaces_.size());
  plates_.reserve(surfaces_.size());
  std::vector<Eigen::Array3d> centers;
  centers.reserve(surfaces_.size());
  for (int index = 0; index < count; ++index) {
    const Surface& surface = surfaces_[index];
    const Eigen::Vector3d normal = surface.edge_u.cross(surface.edge_v);
    const double area = normal.norm();
    if (!(area > 0.0) || !std::isfinite(area) || !surface.origin.allFinite()) {
      throw std::invalid_argument("World: surface " + std::to_string(index) + " has no area");
    }
    Plate plate;
    plate.normal = normal / area;
    plate.offset = plate.normal.dot(surface.origin);
    plate.u_of_point = surface.edge_v.cross(plate.normal) / area;
    plate.v_of_point = plate.normal.cross(surface.edge_u) / area;
    plate.u_offset = plate.u_of_point.dot(surface.origin);
    plate.v_offset = plate.v_of_point.dot(surface.origin);
    plate.triangle = surface.triangle;
    plate.sheet = surface.sheet >= 0 ? count + surface.sheet : index;
    plates_.push_back(plate);
    centers.push_back(
        (surface.origin + (surface.edge_u + surface.edge_v) * (surface.triangle ? 1.0 / 3.0 : 0.5))
            .array());
  }
  order_.resize(surfaces_.size());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * surfaces_.size());
  BuildNode(0, count, centers);
}

int World::Split(int begin, int end, int axis, const std::vector<Eigen::Array3d>& centers) {
  const auto before = [&](int a, int b) {
    const double ca = centers[a][axis];
    const double cb = centers[b][axis];
    return ca != cb ? ca < cb : a < b;
  };
  std::sort(order_.begin() + begin, order_.begin() + end, before);
  // Where the two halves' areas, weighted by their counts, are least: a ray then meets few of both.
  const int count = end - begin;
  std::vector<double> cost(static_cast<std::size_t>(count), 0.0);
  for (const bool from_end : {false, true}) {
    Bounds bounds;
    for (int k = 1; k < count; ++k) {
      bounds.Add(surfaces_[order_[from_end ? end - k : begin + k - 1]]);
      cost[from_end ? count - k : k] += k * bounds.HalfArea();
    }
  }
  // Each side keeps a quarter, which bounds the depth of the tree: Cast has a stack of fixed size.
  const int margin = std::max(1, count / 4);
  const auto best = std::min_element(cost.begin() + margin, cost.end() - margin + 1);
  return begin + static_cast<int>(best - cost.begin());
}

void World::BuildNode(int begin, int end, const std::vector<Eigen::Array3d>& centers) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  Bounds bounds;
  Eigen::Array3d center_low = bounds.low;
  Eigen::Array3d center_high = bounds.high;
  for (int k = begin; k < end; ++k) {
    bounds.Add(surfaces_[order_[k]]);
    center_low = center_low.min(centers[order_[k]]);
    center_high = center_high.max(centers[order_[k]]);
  }
  node.low = bounds.low;
  node.high = bounds.high;
  (center_high - center_low).maxCoeff(&node.axis);
  if (end - begin <= kLeafSize) {
    node.first = begin;
    node.count = end - begin;
    nodes_[index] = node;
    return;
  }
  const int middle = Split(begin, end, node.axis, centers);
  BuildNode(begin, middle, centers);
  node.first = static_cast<int>(nodes_.size());
  node.count = 0;
  BuildNode(middle, end, centers);
  nodes_[index] = node;
}

bool World::HitPlate(int surface,
                     const Eigen::Vector3d& origin,
                     const Eigen::Vector3d& direction,
                     Hit& hit) const {
  constexpr double kNearest = 1e-3;  // nothing is seen closer than a millimetre
  const Plate& plate = plates_[surface];
  const double distance = (plate.offset - plate.normal.dot(origin)) / plate.normal.dot(direction);
  if (!(distance > kNearest && distance < hit.distance)) return false;
  const Eigen::Vector3d point = origin + distance * direction;
  const double u = plate.u_of_point.dot(point) - plate.u_offset;
  if (u < -kBorderTolerance || u > 1.0 + kBorderTolerance) return false;
  const double v = plate.v_of_point.dot(point) - plate.v_offset;
  if (v < -kBorderTolerance || (plate.triangle ? u + v : v) > 1.0 + kBorderTolerance) return false;
  hit = {surface, distance};
  return true;
}

World::Hit World::Cast(const Eigen::Vector3d& origin,
                       const Eigen::Vector3d& direction,
                       int guess) const {
  Hit hit;
  if (guess >= 0) HitPlate(guess, origin, direction, hit);
  const Eigen::Array3d inverse = direction.array().inverse();
  const Eigen::Array3d start = origin.array();
  int stack[64];
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const int index = stack[--depth];
    const Node& node = nodes_[index];
    const Eigen::Array3d a = (node.low - start) * inverse;
    const Eigen::Array3d b = (node.high - start) * inverse;
    const double enter = a.min(b).maxCoeff();
    const double leave = a.max(b).minCoeff();
    if (!(enter <= leave && leave > 0.0 && enter < hit.distance)) continue;
    if (node.count > 0) {
      for (int k = node.first; k < node.first + node.count; ++k) {
        if (order_[k] != guess) HitPlate(order_[k], origin, direction, hit);
      }
      continue;
    }
    const bool backward = direction[node.axis] < 0.0;
    stack[depth++] = backward ? index + 1 : node.first;
    stack[depth++] = backward ? node.first : index + 1;
  }
  return hit;
}

double World::DistanceToPlane(int surface,
                              const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction) const {
  const Plate& plate = plates_[surface];
  return (plate.offset - plate.normal.dot(origin)) / plate.normal.dot(direction);
}

Eigen::Vector2d World::TextureCoordinates(int surface, const Eigen::Vector3d& point) const {
  const Plate& plate = plates_[surface];
  const Surface& s = surfaces_[surface];
  return s.st_origin + (plate.u_of_point.dot(point) - plate.u_offset) * s.st_u +
         (plate.v_of_point.dot(point) - plate.v_offset) * s.st_v;
}

}  // namespace rotslam
