#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

#include "apps/simulation/world.h"

namespace rotslam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kGroundCell = 4.0;
constexpr double kGroundReach = 44.0;  // the ground ends this far from the path
constexpr double kStation = 1.0;       // spacing of the stations along the path

// The path on the ground, at equal steps: where the road is and which way it runs.
struct Station {
  Vector2d place;    // (x, z)
  double height;     // y of the road
  double yaw;        // of the direction of travel
  double way_m = 0;  // from the start
};

// Points of the plane, found by neighbourhood. Cells are visited in order: no hash order anywhere.
class PlaneIndex {
 public:
  explicit PlaneIndex(double cell) : cell_(cell) {}
  void Add(const Vector2d& place, int index) { cells_[CellOf(place)].push_back(index); }
  // Calls `visit(index)` for all points within the cells that touch the square of half side
  // `reach`.
  template <class Visit>
  void Near(const Vector2d& place, double reach, Visit&& visit) const {
    const auto low = CellOf(place - Vector2d::Constant(reach));
    const auto high = CellOf(place + Vector2d::Constant(reach));
    for (int i = low.first; i <= high.first; ++i) {
      for (int j = low.second; j <= high.second; ++j) {
        const auto cell = cells_.find({i, j});
        if (cell == cells_.end()) continue;
        for (const int index : cell->second) visit(index);
      }
    }
  }

 private:
  std::pair<int, int> CellOf(const Vector2d& place) const {
    return {static_cast<int>(std::floor(place.x() / cell_)),
            static_cast<int>(std::floor(place.y() / cell_))};
  }
  double cell_;
  std::map<std::pair<int, int>, std::vector<int>> cells_;
};

std::vector<Station> Stations(const Trajectory& path, double camera_height) {
  std::vector<Station> stations;
  const auto add = [&](const Vector3d& point, double way) {
    stations.push_back({{point.x(), point.z()}, point.y() + camera_height, 0.0, way});
  };
  // Lead in and out, along the first and last view, so that the street does not end at the camera.
  constexpr double kLead = 60.0;
  std::vector<Vector3d> points;
  const auto forward = [](const StampedPose& pose) {
    Vector3d axis = pose.world_from_cam * Vector3d::UnitZ();
    axis.y() = 0.0;
    return Vector3d(axis.normalized());
  };
  points.push_back(path.front().center_in_world - 12.0 * forward(path.front()));
  for (const StampedPose& pose : path) points.push_back(pose.center_in_world);
  // Where the car ends up going: the last stretch of road, not the last millimetre of the path.
  Vector3d ahead = forward(path.back());
  points.push_back(points.back() + kLead * ahead);
  double way = 0.0;
  double next = 0.0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const Vector3d step = points[k + 1] - points[k];
    const double length = std::hypot(step.x(), step.z());
    for (; next <= way + length && length > 0.0; next += kStation) {
      add(points[k] + step * ((next - way) / length), next);
    }
    way += length;
  }
  if (stations.empty()) add(points.front(), 0.0);
  const int count = static_cast<int>(stations.size());
  for (int k = 0; k < count; ++k) {
    const Station& before = stations[std::max(k - 2, 0)];
    const Station& after = stations[std::min(k + 2, count - 1)];
    const Vector2d along = after.place - before.place;
    stations[k].yaw = std::atan2(along.x(), along.y());
  }
  return stations;
}

struct Footprint {  // an upright box from above
  Vector2d center;
  Vector2d half;  // across and along
  double yaw;
  std::array<Vector2d, 2> Axes() const {
    return {Vector2d(std::cos(yaw), -std::sin(yaw)), Vector2d(std::sin(yaw), std::cos(yaw))};
  }
  double DistanceTo(const Vector2d& point) const {
    const auto axes = Axes();
    const Vector2d offset = point - center;
    return std::hypot(std::max(0.0, std::abs(axes[0].dot(offset)) - half.x()),
                      std::max(0.0, std::abs(axes[1].dot(offset)) - half.y()));
  }
};

// Separating axis test in the plane.
bool Overlap(const Footprint& a, const Footprint& b) {
  const auto axes_a = a.Axes();
  const auto axes_b = b.Axes();
  const Vector2d offset = b.center - a.center;
  for (const Vector2d& axis : {axes_a[0], axes_a[1], axes_b[0], axes_b[1]}) {
    double reach = 0.0;
    for (int k = 0; k < 2; ++k) {
      reach +=
          a.half[k] * std::abs(axes_a[k].dot(axis)) + b.half[k] * std::abs(axes_b[k].dot(axis));
    }
    if (std::abs(axis.dot(offset)) >= reach) return false;
  }
  return true;
}

// The ground around the path.
class Ground {
 public:
  Ground(const Trajectory& path, double camera_height_m)
      : stations_(Stations(path, camera_height_m)), station_index_(20.0) {
    for (std::size_t k = 0; k < stations_.size(); ++k) {
      station_index_.Add(stations_[k].place, static_cast<int>(k));
    }
  }

  const std::vector<Station>& stations() const { return stations_; }

  // Height of the ground: the stations' heights, weighted by nearness.
  double HeightAt(const Vector2d& place) const {
    double sum = 0.0;
    double weights = 0.0;
    station_index_.Near(place, kGroundReach + 8.0, [&](int k) {
      const double squared = (stations_[k].place - place).squaredNorm();
      const double weight =
          std::exp(-squared / (2.0 * 5.0 * 5.0)) + 1e-6 / (1.0 + squared * squared);
      sum += weight * stations_[k].height;
      weights += weight;
    });
    return weights > 0.0 ? sum / weights : stations_.front().height;
  }

  void AddTo(std::vector<Surface>& surfaces, const Material& asphalt) const {
    std::map<std::pair<int, int>, double> heights;  // of the corners of the cells that exist
    std::map<std::pair<int, int>, bool> cells;
    const int reach = static_cast<int>(kGroundReach / kGroundCell);
    for (std::size_t k = 0; k < stations_.size(); k += 8) {
      const int i = static_cast<int>(std::floor(stations_[k].place.x() / kGroundCell));
      const int j = static_cast<int>(std::floor(stations_[k].place.y() / kGroundCell));
      for (int a = -reach; a <= reach; ++a) {
        for (int b = -reach; b <= reach; ++b) {
          if (a * a + b * b <= reach * reach) cells[{i + a, j + b}] = true;
        }
      }
    }
    const auto corner = [&](int i, int j) {
      const Vector2d place(i * kGroundCell, j * kGroundCell);
      auto found = heights.find({i, j});
      if (found == heights.end()) found = heights.emplace(std::pair(i, j), HeightAt(place)).first;
      return Vector3d(place.x(), found->second, place.y());
    };
    for (const auto& [cell, exists] : cells) {
      const auto [i, j] = cell;
      for (const bool upper : {false, true}) {
        const Vector3d origin = upper ? corner(i + 1, j + 1) : corner(i, j);
        Surface surface;
        surface.origin = origin;
        surface.edge_u = (upper ? corner(i, j + 1) : corner(i + 1, j)) - origin;
        surface.edge_v = (upper ? corner(i + 1, j) : corner(i, j + 1)) - origin;
        surface.triangle = true;
        surface.st_origin = {origin.x(), origin.z()};
        surface.st_u = {surface.edge_u.x(), surface.edge_u.z()};
        surface.st_v = {surface.edge_v.x(), surface.edge_v.z()};
        surface.material = asphalt;
        surface.sheet = 0;
        surfaces.push_back(surface);
      }
    }
  }

  // Height of the ground as it is drawn: on the triangles, not on the smooth function.
  double DrawnHeightAt(const Vector2d& place) const {
    const Vector2d scaled = place / kGroundCell;
    const double i = std::floor(scaled.x());
    const double j = std::floor(scaled.y());
    const double x = scaled.x() - i;
    const double y = scaled.y() - j;
    const auto height = [&](double a, double b) {
      return HeightAt(kGroundCell * Vector2d(i + a, j + b));
    };
    if (x + y <= 1.0) {
      const double h = height(0, 0);
      return h + x * (height(1, 0) - h) + y * (height(0, 1) - h);
    }
    const double h = height(1, 1);
    return h + (1.0 - x) * (height(0, 1) - h) + (1.0 - y) * (height(1, 0) - h);
  }

  // No station of the path lies within `margin` of the footprint.
  bool Clear(const Footprint& footprint, double margin) const {
    bool clear = true;
    station_index_.Near(footprint.center, footprint.half.norm() + margin, [&](int k) {
      clear = clear && footprint.DistanceTo(stations_[k].place) > margin;
    });
    return clear;
  }

 private:
  std::vector<Station> stations_;
  PlaneIndex station_index_;
};

Vector2d Aside(const Station& station, double lateral, double along = 0.0) {
  const Vector2d right(std::cos(station.yaw), -std::sin(station.yaw));
  const Vector2d forward(std::sin(station.yaw), std::cos(station.yaw));
  return station.place + lateral * right + along * forward;
}

class StreetBuilder {
 public:
  StreetBuilder(const Trajectory& path, const StreetOptions& options)
      : options_(options),
        ground_(path, options.camera_height_m),
        footprint_index_(20.0),
        painter_(options.seed, {102, 101}) {}

  World Build() {
    ground_.AddTo(surfaces_, painter_.Paint(Pattern::kAsphalt, 0.42f));
    AddMarkings();
    for (const int side : {-1, 1}) AddHouses(side);
    for (const int side : {-1, 1}) AddParkedCars(side);
    for (const int side : {-1, 1}) AddPolesAndTrees(side);
    Light light;
    light.ambient = 0.68f;
    light.diffuse = 0.42f;
    return World(std::move(surfaces_), light, painter_.Paint(Pattern::kSky, 0.82f));
  }

 private:
  float Tone(double low, double high) { return static_cast<float>(painter_.Draw(low, high)); }

  // A thin slab on the road whose top lies `raise` above the highest ground under it.
  // @param size  width across the road, length along it.
  void AddSlab(const Station& station,
               double lateral,
               const Vector2d& size,
               double raise,
               const Material& material) {
    const Vector2d place = Aside(station, lateral);
    double top = 1e9;
    for (const double a : {-0.5, 0.5}) {
      for (const double b : {-0.5, 0.5}) {
        top = std::min(top,
                       ground_.DrawnHeightAt(Aside(station, lateral + a * size.x(), b * size.y())));
      }
    }
    const double thickness = raise + 0.5;
    AddBox(surfaces_,
           {Vector3d(place.x(), top - raise + thickness, place.y()),
            {size.x(), thickness, size.y()},
            station.yaw,
            material,
            material});
  }

  // Dashes along the road, drain covers, and slabs of pavement on both sides.
  void AddMarkings() {
    const int count = static_cast<int>(ground_.stations().size());
    for (int k = 0; k < count; k += 6) {
      const Station& station = ground_.stations()[k];
      if (k % 12 == 0 && ground_.Clear({Aside(station, -2.1), {0.1, 1.0}, station.yaw}, 1.2)) {
        AddSlab(station, -2.1, {0.14, 2.0}, 0.012, painter_.Paint(Pattern::kPlaster, 0.85f));
      }
      if (painter_.Draw(0.0, 1.0) < 0.35) {
        const double lateral = painter_.Draw(-1.4, 1.4);
        AddSlab(station, lateral, {0.6, 0.6}, 0.01, painter_.Paint(Pattern::kTiles, 0.25f, 1.4f));
      }
    }
    constexpr int kPavement = 4;
    for (const int side : {-1, 1}) {
      for (int k = 0; k < count; k += kPavement) {
        const Station& station = ground_.stations()[k];
        const double lateral = side * (options_.road_half_width_m + 1.4);
        const Footprint footprint{Aside(station, lateral), {1.0, 0.5 * kPavement}, station.yaw};
        if (!ground_.Clear(footprint, options_.road_half_width_m - 0.3)) continue;
        AddSlab(station, lateral, {2.0, kPavement}, 0.14, painter_.Paint(Pattern::kTiles, 0.6f));
      }
    }
  }

  // Takes the ground for a solid thing where it blocks neither road nor neighbour.
  bool Claim(const Footprint& footprint, double margin) {
    if (!ground_.Clear(footprint, margin)) return false;
    bool free = true;
    footprint_index_.Near(footprint.center, footprint.half.norm() + 12.0, [&](int k) {
      free = free && !Overlap(footprint, footprints_[k]);
    });
    if (!free) return false;
    footprint_index_.Add(footprint.center, static_cast<int>(footprints_.size()));
    footprints_.push_back(footprint);
    return true;
  }

  const Station& StationAt(double way) const {
    const auto index = static_cast<std::size_t>(std::max(0.0, way / kStation));
    return ground_.stations()[std::min(index, ground_.stations().size() - 1)];
  }

  void AddHouses(int side) {
    const double end = ground_.stations().back().way_m;
    for (double way = painter_.Draw(0.0, 4.0); way < end;) {
      const double front = painter_.Draw(7.0, 14.0);
      const double depth = painter_.Draw(7.0, 11.0);
      const double setback = options_.house_setback_m + painter_.Draw(0.0, 2.5);
      const double gap =
          painter_.Draw(0.0, 1.0) < 0.4 ? 0.05 : painter_.Draw(0.5, 3.0 * options_.mean_gap_m);
      const Station& station = StationAt(way + 0.5 * front);
      const Vector2d place = Aside(station, side * (setback + 0.5 * depth));
      const Footprint footprint{place, {0.5 * depth, 0.5 * front}, station.yaw};
      if (!Claim(footprint, options_.road_half_width_m + 1.5)) {
        way += 3.0;  // a side road, a bend: try a little further on
        continue;
      }
      AddHouse(footprint, station);
      way += front + gap;
    }
  }

  void AddHouse(const Footprint& footprint, const Station& station) {
    const double ground = std::min(station.height, ground_.HeightAt(footprint.center));
    const double buried = 0.25 + std::abs(station.height - ground_.HeightAt(footprint.center));
    const double height = painter_.Draw(5.5, 13.0);
    const Vector3d foot(footprint.center.x(), ground + buried, footprint.center.y());
    const Vector3d size(2.0 * footprint.half.x(), height + buried, 2.0 * footprint.half.y());
    const Material front = painter_.Paint(Pattern::kFacade, Tone(0.42, 0.68));
    const Material roof = painter_.Paint(Pattern::kTiles, Tone(0.25, 0.4));
    AddBox(surfaces_, {foot, size, footprint.yaw, front, roof});
    // The eaves stand out a little, and a smaller storey or chimney sits on top.
    const Vector3d top = foot - Vector3d(0.0, size.y(), 0.0);
    AddBox(surfaces_, {top, {size.x() + 0.5, 0.3, size.z() + 0.04}, footprint.yaw, roof, roof});
    if (painter_.Draw(0.0, 1.0) < 0.6) {
      const Material upper = painter_.Paint(Pattern::kFacade, Tone(0.35, 0.6));
      AddBox(surfaces_,
             {top - Vector3d(0.0, 0.3, 0.0),
              {0.7 * size.x(), painter_.Draw(1.2, 2.6), painter_.Draw(0.4, 0.8) * size.z()},
              footprint.yaw,
              upper,
              roof});
    }
  }

  void AddParkedCars(int side) {
    const double end = ground_.stations().back().way_m;
    for (double way = 3.0; way < end; way += 6.0) {
      if (painter_.Draw(0.0, 1.0) > options_.car_density) continue;
      const Station& station = StationAt(way);
      const double lateral = side * (options_.road_half_width_m - 0.75 + painter_.Draw(-0.1, 0.2));
      const Vector2d place = Aside(station, lateral, painter_.Draw(-0.5, 0.5));
      const double length = painter_.Draw(3.7, 4.7);
      const Footprint footprint{
          place, {0.87, 0.5 * length}, station.yaw + painter_.Draw(-0.03, 0.03)};
      if (!Claim(footprint, options_.road_half_width_m - 1.9)) continue;
      AddCar({place.x(), ground_.DrawnHeightAt(place), place.y()}, length, footprint.yaw);
    }
  }

  void AddCar(const Vector3d& foot, double length, double yaw) {
    const Material body = painter_.Paint(Pattern::kPanel, Tone(0.25, 0.75), 0.8f);
    const Material glass = painter_.Paint(Pattern::kPanel, Tone(0.2, 0.3), 0.9f);
    const Material rubber = painter_.Paint(Pattern::kPlaster, 0.1f);
    const double belt = painter_.Draw(0.7, 0.85);
    AddBox(surfaces_, {foot - Vector3d(0, 0.22, 0), {1.74, belt - 0.22, length}, yaw, body, body});
    const double cabin = painter_.Draw(0.5, 0.7) * length;
    const Vector3d forward(std::sin(yaw), 0.0, std::cos(yaw));
    const Vector3d right(std::cos(yaw), 0.0, -std::sin(yaw));
    AddBox(surfaces_,
           {foot - Vector3d(0, belt, 0) - 0.08 * length * forward,
            {1.5, painter_.Draw(0.5, 0.75), cabin},
            yaw,
            glass,
            body});
    for (const double along : {-0.31, 0.31}) {
      AddBox(surfaces_,
             {foot + along * length * forward + Vector3d(0, 0.05, 0),
              {1.78, 0.6, 0.58},
              yaw,
              rubber,
              rubber});
    }
  }

  void AddPolesAndTrees(int side) {
    const double end = ground_.stations().back().way_m;
    for (double way = 5.0 + 3.0 * side; way < end; way += painter_.Draw(7.0, 14.0)) {
      const Station& station = StationAt(way);
      const double lateral = side * (options_.road_half_width_m + 0.75);
      const Vector2d place = Aside(station, lateral);
      const bool tree = painter_.Draw(0.0, 1.0) < 0.4;
      const Footprint footprint{place, Vector2d::Constant(tree ? 0.15 : 0.08), station.yaw};
      if (!Claim(footprint, options_.road_half_width_m)) continue;
      const Vector3d foot(place.x(), ground_.DrawnHeightAt(place) + 0.05, place.y());
      if (tree) {
        const Material bark = painter_.Paint(Pattern::kLeaves, 0.3f);
        const Material leaves = painter_.Paint(Pattern::kLeaves, 0.4f);
        const double trunk = painter_.Draw(2.2, 3.0);
        AddBox(surfaces_, {foot, {0.28, trunk, 0.28}, painter_.Draw(0.0, 1.5), bark, bark});
        const double crown = painter_.Draw(1.4, 2.2);
        const Vector3d middle = foot - Vector3d(0.0, trunk, 0.0);
        AddBox(surfaces_,
               {middle, {crown, 1.1 * crown, crown}, painter_.Draw(0.0, 1.5), leaves, leaves});
        AddBox(surfaces_,
               {middle - Vector3d(0.2, 0.7 * crown, -0.2),
                {0.7 * crown, crown, 0.7 * crown},
                painter_.Draw(0.0, 1.5),
                leaves,
                leaves});
        continue;
      }
      const Material metal = painter_.Paint(Pattern::kPlaster, Tone(0.2, 0.7));
      const double height = painter_.Draw(2.4, 6.0);
      AddBox(surfaces_, {foot, {0.12, height, 0.12}, station.yaw, metal, metal});
      const Material sign = painter_.Paint(Pattern::kPoster, 0.5f);
      AddBox(surfaces_,
             {foot - Vector3d(0.0, std::min(height, 3.0) - 0.7, 0.0),
              {painter_.Draw(0.5, 0.8), painter_.Draw(0.5, 0.8), 0.16},
              station.yaw + painter_.Draw(-0.2, 0.2),
              sign,
              sign});
    }
  }

  const StreetOptions options_;
  const Ground ground_;
  std::vector<Footprint> footprints_;
  PlaneIndex footprint_index_;
  std::vector<Surface> surfaces_;
  Painter painter_;
};

}  // namespace

World MakeStreet(const Trajectory& path, const StreetOptions& options) {
  if (path.empty()) throw std::invalid_argument("MakeStreet: the path has no poses");
  return StreetBuilder(path, options).Build();
}

std::vector<MovingBox> StreetDistractors(int count,
                                         const Trajectory& path,
                                         const StreetOptions& options) {
  if (path.empty()) throw std::invalid_argument("StreetDistractors: the path has no poses");
  const std::vector<Station> stations = Stations(path, options.camera_height_m);
  std::vector<MovingBox> boxes;
  for (int k = 0; k < count; ++k) {
    const double share = (k + 0.7) / (count + 0.7);
    const Station& station =
        stations[static_cast<std::size_t>(share * static_cast<double>(stations.size() - 1))];
    const std::uint64_t hash = HashBits(options.seed, k, 103);
    const Vector2d place =
        station.place + 2.9 * Vector2d(-std::cos(station.yaw), std::sin(station.yaw));
    MovingBox moving;
    moving.box.foot_in_world = {place.x(), station.height, place.y()};
    moving.box.size_m = {1.7, 1.4 + 0.8 * UnitFrom(hash, 0), 3.6 + UnitFrom(hash, 8)};
    moving.box.yaw_rad = station.yaw;
    moving.box.sides.pattern = Pattern::kPanel;
    moving.box.sides.seed = hash;
    moving.box.top = moving.box.sides;
    moving.travel_m = 12.0 * Vector3d(std::sin(station.yaw), 0.0, std::cos(station.yaw));
    moving.period_s = 9.0 + 4.0 * UnitFrom(hash, 16);
    moving.phase = UnitFrom(hash, 24);
    boxes.push_back(moving);
  }
  return boxes;
}

}  // namespace rotslam
