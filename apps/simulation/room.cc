#include <cmath>
#include <numbers>

#include "apps/simulation/world.h"

namespace rotslam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kHalfX = 3.0;
constexpr double kHalfZ = 2.25;
constexpr double kHeight = 2.7;

Painter PainterOf(std::uint64_t seed) { return Painter(HashBits(seed, 17, 3), {5, 6}); }

void AddTable(std::vector<Surface>& surfaces,
              Painter& painter,
              const Vector3d& foot,
              const Vector3d& size,
              double yaw) {
  const Material wood = painter.Paint(Pattern::kPlanks, 0.55f);
  const double board = 0.05;
  AddBox(
      surfaces,
      {foot - Vector3d(0.0, size.y() - board, 0.0), {size.x(), board, size.z()}, yaw, wood, wood});
  for (const double x : {-0.45, 0.45}) {
    for (const double z : {-0.44, 0.44}) {
      const Vector3d offset(std::cos(yaw) * x * size.x() + std::sin(yaw) * z * size.z(),
                            0.0,
                            -std::sin(yaw) * x * size.x() + std::cos(yaw) * z * size.z());
      AddBox(surfaces, {foot + offset, {0.06, size.y() - board, 0.06}, yaw, wood, wood});
    }
  }
}

// Small things standing on a plane of the given centre and extent.
void AddClutter(std::vector<Surface>& surfaces,
                Painter& painter,
                const Vector3d& center,
                const Vector2d& extent,
                int count) {
  const double extent_x = extent.x();
  const double extent_z = extent.y();
  constexpr Pattern kPatterns[] = {
      Pattern::kPoster, Pattern::kPanel, Pattern::kFabric, Pattern::kPoster, Pattern::kTiles};
  for (int k = 0; k < count; ++k) {
    // One cell of the row each, so that things do not run into one another.
    const double x = ((k + painter.Draw(0.35, 0.65)) / count - 0.5) * extent_x;
    const double z = painter.Draw(-0.25, 0.25) * extent_z;
    const double width = painter.Draw(0.4, 0.7) * extent_x / count;
    const Vector3d size(width, painter.Draw(0.08, 0.38), painter.Draw(0.3, 0.45) * extent_z);
    const Material sides =
        painter.Paint(kPatterns[k % 5], static_cast<float>(painter.Draw(0.35, 0.65)));
    AddBox(surfaces,
           {center + Vector3d(x, 0.0, z),
            size,
            painter.Draw(-0.4, 0.4),
            sides,
            painter.Paint(Pattern::kPoster, 0.5f)});
  }
}

// A wall: its left lower corner as one looks at it, its lower edge, and its normal.
struct Wall {
  Vector3d foot;
  Vector3d along;
  Vector3d into_room;
};

// Posters and frames in one row of a wall.
// @param heights  of the row's lower and upper end.
void AddPosters(std::vector<Surface>& surfaces,
                Painter& painter,
                const Wall& wall,
                const Vector2d& heights,
                int count) {
  const auto& [foot, along, into_room] = wall;
  const double low = heights.x();
  const double high = heights.y();
  const double length = along.norm();
  const Vector3d direction = along / length;
  for (int k = 0; k < count; ++k) {
    const double cell = length / count;
    const double width = painter.Draw(0.5, 0.85) * cell;
    const double height = painter.Draw(0.55, 0.95) * (high - low);
    const double start = cell * k + painter.Draw(0.05, 0.95) * (cell - width);
    const double bottom = low + painter.Draw(0.0, 1.0) * (high - low - height);
    surfaces.push_back(
        MakeQuad(foot + direction * start + 0.012 * into_room - Vector3d(0.0, bottom, 0.0),
                 direction * width,
                 Vector3d(0.0, -height, 0.0),
                 painter.Paint(Pattern::kPoster, static_cast<float>(painter.Draw(0.4, 0.6)))));
  }
}

const Vector3d kCorner(-kHalfX, 0.0, -kHalfZ);
const Vector3d kEdgeX(2.0 * kHalfX, 0.0, 0.0);
const Vector3d kEdgeZ(0.0, 0.0, 2.0 * kHalfZ);

// Floor, ceiling, walls and a carpet. Wall edges run right as one looks at them from inside.
void AddShell(std::vector<Surface>& surfaces, Painter& painter) {
  const Vector3d up(0.0, -kHeight, 0.0);
  surfaces.push_back(MakeQuad(kCorner, kEdgeX, kEdgeZ, painter.Paint(Pattern::kPlanks, 0.45f)));
  surfaces.push_back(
      MakeQuad(kCorner + up, kEdgeX, kEdgeZ, painter.Paint(Pattern::kTiles, 0.68f, 0.7f)));
  surfaces.push_back(
      MakeQuad(kCorner + kEdgeZ, kEdgeX, up, painter.Paint(Pattern::kPlaster, 0.60f)));
  surfaces.push_back(
      MakeQuad(kCorner + kEdgeX + kEdgeZ, -kEdgeZ, up, painter.Paint(Pattern::kBricks, 0.52f)));
  surfaces.push_back(
      MakeQuad(kCorner + kEdgeX, -kEdgeX, up, painter.Paint(Pattern::kPlaster, 0.50f)));
  surfaces.push_back(MakeQuad(kCorner, kEdgeZ, up, painter.Paint(Pattern::kTiles, 0.56f)));
  surfaces.push_back(MakeQuad({-1.3, -0.012, -1.0},
                              {2.4, 0.0, 0.0},
                              {0.0, 0.0, 1.7},
                              painter.Paint(Pattern::kFabric, 0.45f)));
}

// What hangs on the walls.
void AddPosters(std::vector<Surface>& surfaces, Painter& painter) {
  AddPosters(surfaces, painter, {kCorner + kEdgeZ, kEdgeX, {0.0, 0.0, -1.0}}, {1.25, 2.4}, 6);
  AddPosters(
      surfaces, painter, {kCorner + kEdgeX + kEdgeZ, -kEdgeZ, {-1.0, 0.0, 0.0}}, {1.3, 2.4}, 4);
  AddPosters(surfaces, painter, {kCorner + kEdgeX, -kEdgeX, {0.0, 0.0, 1.0}}, {1.1, 2.3}, 5);
  AddPosters(surfaces, painter, {kCorner, kEdgeZ, {1.0, 0.0, 0.0}}, {1.2, 2.35}, 4);
}

// Furniture along the walls; the middle stays free for the camera.
void AddFurniture(std::vector<Surface>& surfaces, Painter& painter) {
  const Material shelf = painter.Paint(Pattern::kShelf, 0.5f);
  const Material shelf_top = painter.Paint(Pattern::kPlanks, 0.5f);
  AddBox(surfaces, {{-2.2, 0.0, 2.05}, {1.2, 2.0, 0.36}, 0.0, shelf, shelf_top});
  AddBox(
      surfaces,
      {{2.82, 0.0, 1.2}, {0.34, 1.85, 1.1}, 0.0, painter.Paint(Pattern::kShelf, 0.48f), shelf_top});
  const Material cabinet = painter.Paint(Pattern::kPanel, 0.6f);
  AddBox(surfaces, {{2.65, 0.0, -1.35}, {0.6, 1.15, 1.3}, 0.0, cabinet, cabinet});
  AddClutter(surfaces, painter, {2.65, -1.15, -1.35}, {0.5, 1.1}, 2);
  const Material drawers = painter.Paint(Pattern::kPanel, 0.45f);
  AddBox(
      surfaces,
      {{-2.7, 0.0, -1.4}, {0.55, 0.8, 1.4}, 0.0, drawers, painter.Paint(Pattern::kPlanks, 0.6f)});
  AddClutter(surfaces, painter, {-2.7, -0.8, -1.4}, {0.5, 1.2}, 2);
  const Material sofa = painter.Paint(Pattern::kFabric, 0.5f);
  AddBox(surfaces, {{0.2, 0.0, 1.75}, {1.9, 0.42, 0.8}, 0.0, sofa, sofa});
  AddBox(surfaces, {{0.2, -0.42, 2.08}, {1.9, 0.45, 0.2}, 0.0, sofa, sofa});
  for (const double x : {-0.5, 0.25, 0.85}) {
    const Material cushion = painter.Paint(Pattern::kFabric, 0.55f);
    AddBox(surfaces,
           {{x, -0.42, 1.85}, {0.4, 0.36, 0.16}, painter.Draw(-0.4, 0.4), cushion, cushion});
  }
}

void AddTablesAndSeats(std::vector<Surface>& surfaces, Painter& painter) {
  AddTable(surfaces, painter, {-0.6, 0.0, -1.85}, {1.6, 0.74, 0.7}, 0.0);
  AddClutter(surfaces, painter, {-0.6, -0.74, -1.85}, {1.5, 0.6}, 5);
  AddTable(surfaces, painter, {0.1, 0.0, 0.75}, {0.9, 0.42, 0.5}, 0.12);
  AddClutter(surfaces, painter, {0.1, -0.42, 0.75}, {0.8, 0.4}, 3);
  AddTable(surfaces, painter, {1.2, 0.0, -1.85}, {1.1, 0.74, 0.65}, -0.05);
  AddClutter(surfaces, painter, {1.2, -0.74, -1.85}, {1.0, 0.5}, 4);
  const Vector3d seats[] = {{-1.0, 0.0, -1.25}, {1.3, 0.0, -1.2}, {-2.3, 0.0, 0.4}};
  for (const Vector3d& seat : seats) {
    const double yaw = painter.Draw(-0.7, 0.7);
    AddTable(surfaces, painter, seat, {0.42, 0.45, 0.42}, yaw);
    const Material back = painter.Paint(Pattern::kFabric, 0.5f);
    AddBox(surfaces,
           {seat + Vector3d(-0.19 * std::sin(yaw), -0.45, -0.19 * std::cos(yaw)),
            {0.42, 0.42, 0.04},
            yaw,
            back,
            back});
  }
}

// Crates in the corners and against the walls, and a standing lamp.
void AddCrates(std::vector<Surface>& surfaces, Painter& painter) {
  const struct {
    double x, z, size, yaw;
  } crates[] = {{1.7, 1.95, 0.5, 0.2},
                {1.75, 1.9, 0.34, 0.7},
                {-2.7, 1.3, 0.45, 0.1},
                {-2.65, 0.95, 0.3, -0.3},
                {2.7, 0.2, 0.45, 0.15},
                {2.68, -0.3, 0.36, -0.4},
                {2.2, -2.0, 0.4, 0.3}};
  for (int k = 0; k < 7; ++k) {
    const auto& crate = crates[k];
    const Material sides = painter.Paint(k % 2 == 0 ? Pattern::kPanel : Pattern::kPoster, 0.5f);
    const double foot = k == 1 ? -0.5 : 0.0;  // the second stands on the first
    AddBox(surfaces,
           {{crate.x, foot, crate.z}, Vector3d::Constant(crate.size), crate.yaw, sides, sides});
  }
  const Material metal = painter.Paint(Pattern::kPlaster, 0.25f);
  AddBox(surfaces, {{-1.3, 0.0, 1.95}, {0.05, 1.7, 0.05}, 0.3, metal, metal});
  const Material shade = painter.Paint(Pattern::kFabric, 0.75f);
  AddBox(surfaces, {{-1.3, -1.55, 1.95}, {0.34, 0.34, 0.34}, 0.3, shade, shade});
}

}  // namespace

World MakeRoom(std::uint64_t seed) {
  Painter painter = PainterOf(seed);
  std::vector<Surface> surfaces;
  AddShell(surfaces, painter);
  AddPosters(surfaces, painter);
  AddFurniture(surfaces, painter);
  AddTablesAndSeats(surfaces, painter);
  AddCrates(surfaces, painter);

  Light light;
  light.lamp = true;
  light.place = {0.3, -2.5, -0.2};
  light.ambient = 0.62f;
  light.diffuse = 0.75f;
  return World(std::move(surfaces), light, painter.Paint(Pattern::kSky, 0.7f));
}

std::vector<MovingBox> RoomDistractors(int count, std::uint64_t seed) {
  Painter painter = PainterOf(HashBits(seed, 23, 9));
  std::vector<MovingBox> boxes;
  for (int k = 0; k < count; ++k) {
    const double angle = 2.0 * std::numbers::pi * (k * 0.618 + painter.Draw(0.0, 0.1));
    const Vector3d outward(std::sin(angle), 0.0, std::cos(angle));
    const Vector3d across(outward.z(), 0.0, -outward.x());
    MovingBox moving;
    moving.box.foot_in_world =
        Vector3d(2.0 * outward.x(), -painter.Draw(0.0, 0.9), 1.5 * outward.z());
    moving.box.size_m = {painter.Draw(0.25, 0.5), painter.Draw(0.4, 0.9), painter.Draw(0.25, 0.5)};
    moving.box.yaw_rad = painter.Draw(-1.5, 1.5);
    moving.box.sides = painter.Paint(k % 2 == 0 ? Pattern::kPoster : Pattern::kPanel, 0.5f);
    moving.box.top = moving.box.sides;
    moving.travel_m = painter.Draw(0.4, 0.8) * across;
    moving.period_s = painter.Draw(3.0, 6.0);
    moving.phase = painter.Draw(0.0, 1.0);
    boxes.push_back(moving);
  }
  return boxes;
}

}  // namespace rotslam
