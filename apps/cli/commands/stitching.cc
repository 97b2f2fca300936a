#include "apps/cli/commands/stitching.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <Eigen/Dense>

#include "rotodom/types/options.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

constexpr double kPi = std::numbers::pi;

// The sphere's axes: level with the views' pan, forward where the first view looks.
Rotation SphereFromWorld(const std::vector<Rotation>& world_from_cam) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Eigen::Vector3d mean_down = Eigen::Vector3d::Zero();
  for (const Rotation& rotation : world_from_cam) {
    const Eigen::Matrix3d R_w_c = rotation.Matrix();
    spread += R_w_c.col(0) * R_w_c.col(0).transpose();
    mean_down += R_w_c.col(1);
  }
  const auto count = static_cast<double>(world_from_cam.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread / count);
  const Eigen::Matrix3d first = world_from_cam.front().Matrix();
  Eigen::Vector3d down = first.col(1);
  const Eigen::Vector3d axis = solver.eigenvectors().col(0);
  // The horizontal axes must span a plane, and the views must stand upright on it.
  constexpr double kPans = 0.01;
  constexpr double kUpright = 0.5;
  const double upright = axis.dot(mean_down) / count;
  if (solver.eigenvalues()[1] > kPans && std::abs(upright) > kUpright) {
    down = upright > 0.0 ? axis : Eigen::Vector3d(-axis);
  }
  // A first view that looks along the vertical has its upper edge forward.
  Eigen::Vector3d forward = first.col(2) - down.dot(first.col(2)) * down;
  if (forward.norm() < 0.1) forward = -first.col(1) + down.dot(first.col(1)) * down;
  forward.normalize();
  Eigen::Matrix3d R_s_w;
  R_s_w.row(0) = down.cross(forward).transpose();
  R_s_w.row(1) = down.transpose();
  R_s_w.row(2) = forward.transpose();
  return Rotation::FromMatrix(R_s_w);
}

// Half the angle of the cone about the optical axis that holds the image.
double ViewRadius(const Camera& camera) {
  constexpr int kSteps = 16;
  double radius = 0.0;
  const auto widen = [&](double x, double y) {
    const auto bearing = camera.Unproject({x, y});
    if (bearing) radius = std::max(radius, std::acos(std::clamp(bearing->z(), -1.0, 1.0)));
  };
  for (int k = 0; k <= kSteps; ++k) {
    const double x = (camera.width - 1) * static_cast<double>(k) / kSteps;
    const double y = (camera.height - 1) * static_cast<double>(k) / kSteps;
    widen(x, 0.0);
    widen(x, camera.height - 1);
    widen(0.0, y);
    widen(camera.width - 1, y);
  }
  return radius;
}

// The pixels of the whole sphere.
struct Grid {
  explicit Grid(int columns) : width(columns), height(columns / 2) {
    forward.reserve(width);
    for (int column = 0; column < width; ++column) {
      const double longitude = (column + 0.5) / width * 2.0 * kPi - kPi;
      forward.emplace_back(std::sin(longitude), std::cos(longitude));
    }
  }

  double Latitude(int row) const { return 0.5 * kPi - (row + 0.5) / height * kPi; }

  int width;
  int height;
  std::vector<Eigen::Vector2d> forward;  // x and z on the equator, by column
};

// Columns first .. first + count - 1, those beyond the right edge going on at the left.
struct Columns {
  int first = 0;
  int count = 0;
};

// Columns of a row within `radius` of a direction.
Columns ColumnsWithin(const Grid& grid,
                      const Eigen::Vector3d& center,
                      double radius,
                      double latitude) {
  const double center_latitude = std::asin(std::clamp(-center.y(), -1.0, 1.0));
  const double denominator = std::cos(latitude) * std::cos(center_latitude);
  const double cosine = std::cos(radius) - std::sin(latitude) * std::sin(center_latitude);
  if (cosine >= denominator) return {};
  if (cosine <= -denominator) return {0, grid.width};
  const double reach = std::acos(cosine / denominator);
  const double middle = std::atan2(center.x(), center.z());
  const auto column_of = [&](double longitude) {
    return static_cast<int>(std::floor((longitude + kPi) / (2.0 * kPi) * grid.width));
  };
  const int first = column_of(middle - reach);
  const int count = std::min(column_of(middle + reach) - first + 2, grid.width);
  return {(first % grid.width + grid.width) % grid.width, count};
}

// A view as the sphere sees it.
class ProjectedView {
 public:
  ProjectedView(const Camera& camera, const Rotation& sphere_from_cam, double radius)
      : camera_(camera),
        R_c_s_(sphere_from_cam.Inverse().Matrix()),
        center_(sphere_from_cam * Eigen::Vector3d::UnitZ()),
        radius_(radius),
        smallest_cosine_(std::cos(radius)) {}

  // Calls use(column, pixel) for the pixels of a row of the grid that the view shows.
  template <class Use>
  void ForRow(const Grid& grid, int row, const Use& use) const {
    const double latitude = grid.Latitude(row);
    const double sine = std::sin(latitude);
    const double cosine = std::cos(latitude);
    const Columns columns = ColumnsWithin(grid, center_, radius_, latitude);
    for (int k = 0; k < columns.count; ++k) {
      const int column = (columns.first + k) % grid.width;
      // x right, y down, z forward.
      const Eigen::Vector2d& forward = grid.forward[column];
      const Eigen::Vector3d direction(cosine * forward.x(), -sine, cosine * forward.y());
      if (direction.dot(center_) < smallest_cosine_) continue;
      const auto pixel = camera_.Project(R_c_s_ * direction);
      if (!pixel || pixel->x() < 0.0 || pixel->y() < 0.0 || pixel->x() > camera_.width - 1 ||
          pixel->y() > camera_.height - 1) {
        continue;
      }
      use(column, *pixel);
    }
  }

 private:
  const Camera& camera_;
  Eigen::Matrix3d R_c_s_;
  Eigen::Vector3d center_;
  double radius_;
  double smallest_cosine_;
};

// Bilinear; the pixel lies within the image.
cv::Vec3f Sample(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  const int x = std::min(static_cast<int>(pixel.x()), image.cols - 2);
  const int y = std::min(static_cast<int>(pixel.y()), image.rows - 2);
  const auto wx = static_cast<float>(pixel.x() - x);
  const auto wy = static_cast<float>(pixel.y() - y);
  const auto at = [&](int dx, int dy) -> cv::Vec3f {
    if (image.channels() == 3) return image.at<cv::Vec3b>(y + dy, x + dx);
    const auto grey = static_cast<float>(image.at<unsigned char>(y + dy, x + dx));
    return {grey, grey, grey};
  };
  return (1.0F - wy) * ((1.0F - wx) * at(0, 0) + wx * at(1, 0)) +
         wy * ((1.0F - wx) * at(0, 1) + wx * at(1, 1));
}

// Mean brightness of each cell of a coarse grid, as one view shows it.
using Cells = std::map<int, double>;

Cells BrightnessOf(const cv::Mat& image, const ProjectedView& view) {
  static const Grid kCoarse(360);
  Cells cells;
  for (int row = 0; row < kCoarse.height; ++row) {
    view.ForRow(kCoarse, row, [&](int column, const Eigen::Vector2d& pixel) {
      const cv::Vec3f colour = Sample(image, pixel);
      cells[row * kCoarse.width + column] = (colour[0] + colour[1] + colour[2]) / 3.0;
    });
  }
  return cells;
}

// One factor per view, so that views agree on the brightness of what several of them show: means of
// the cells and factors of the views by turns.
std::vector<double> GainsOf(const std::vector<Cells>& cells_of_view) {
  constexpr int kIterations = 30;
  constexpr double kLargest = 2.5;
  // What keeps views that share little with others near to one, in cells of brightness one.
  constexpr double kPrior = 1e4;
  std::vector<double> gains(cells_of_view.size(), 1.0);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    std::map<int, std::pair<double, int>> sums;
    for (std::size_t k = 0; k < gains.size(); ++k) {
      for (const auto& [cell, value] : cells_of_view[k]) {
        sums[cell].first += gains[k] * value;
        ++sums[cell].second;
      }
    }
    for (std::size_t k = 0; k < gains.size(); ++k) {
      double numerator = kPrior;
      double denominator = kPrior;
      for (const auto& [cell, value] : cells_of_view[k]) {
        const auto& [sum, count] = sums.at(cell);
        numerator += value * sum / count;
        denominator += value * value;
      }
      gains[k] = std::clamp(numerator / denominator, 1.0 / kLargest, kLargest);
    }
  }
  return gains;
}

// Weighted sums of colours over the sphere.
class Blend {
 public:
  Blend(const Grid& grid, double sharpness)
      : grid_(grid),
        sharpness_(sharpness),
        colours_(grid.height, grid.width, cv::Vec3f(0, 0, 0)),
        weights_(grid.height, grid.width, 0.0F) {}

  void Add(const cv::Mat& image, const ProjectedView& view, double gain, int num_threads) {
    ParallelFor(grid_.height, num_threads, [&](int row) {
      view.ForRow(grid_, row, [&](int column, const Eigen::Vector2d& pixel) {
        const double x = 2.0 * std::min(pixel.x(), image.cols - 1 - pixel.x()) / (image.cols - 1);
        const double y = 2.0 * std::min(pixel.y(), image.rows - 1 - pixel.y()) / (image.rows - 1);
        const auto weight = static_cast<float>(1e-6 + std::pow(std::min(x, y), sharpness_));
        colours_(row, column) += weight * static_cast<float>(gain) * Sample(image, pixel);
        weights_(row, column) += weight;
      });
    });
  }

  bool Shows(int row, int column) const { return weights_(row, column) > 0.0F; }

  cv::Vec3b ColourAt(int row, int column) const {
    if (!Shows(row, column)) return {0, 0, 0};
    cv::Vec3b colour;
    for (int channel = 0; channel < 3; ++channel) {
      colour[channel] =
          cv::saturate_cast<unsigned char>(colours_(row, column)[channel] / weights_(row, column));
    }
    return colour;
  }

 private:
  Grid grid_;
  double sharpness_;
  cv::Mat_<cv::Vec3f> colours_;
  cv::Mat_<float> weights_;
};

// The smallest part of the sphere, columns going round, that holds all there is.
struct Part {
  int first_row = 0;
  int num_rows = 0;
  Columns columns;
};

Part ContentOf(const Blend& blend, const Grid& grid) {
  std::vector<bool> has_row(grid.height, false);
  std::vector<bool> has_column(grid.width, false);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      if (blend.Shows(row, column)) has_row[row] = has_column[column] = true;
    }
  }
  const int first_row =
      static_cast<int>(std::find(has_row.begin(), has_row.end(), true) - has_row.begin());
  const int rows_below =
      static_cast<int>(std::find(has_row.rbegin(), has_row.rend(), true) - has_row.rbegin());
  // Behind the longest gap.
  Columns gap;
  int run = 0;
  for (int k = 0; k < 2 * grid.width && run < grid.width; ++k) {
    run = has_column[k % grid.width] ? 0 : run + 1;
    if (run > gap.count) gap = {(k - run + 1) % grid.width, run};
  }
  const Columns columns =
      gap.count == 0 ? Columns{0, grid.width}
                     : Columns{(gap.first + gap.count) % grid.width, grid.width - gap.count};
  return {first_row, grid.height - first_row - rows_below, columns};
}

Panorama Cut(const Blend& blend, const Grid& grid, const Part& part) {
  Panorama panorama;
  panorama.image.create(part.num_rows, part.columns.count, CV_8UC3);
  for (int row = 0; row < part.num_rows; ++row) {
    for (int k = 0; k < part.columns.count; ++k) {
      panorama.image.at<cv::Vec3b>(row, k) =
          blend.ColourAt(part.first_row + row, (part.columns.first + k) % grid.width);
    }
  }
  const double deg_per_pixel = 360.0 / grid.width;
  panorama.left_deg = part.columns.first * deg_per_pixel - 180.0;
  panorama.top_deg = 90.0 - part.first_row * 180.0 / grid.height;
  panorama.width_deg = part.columns.count * deg_per_pixel;
  panorama.height_deg = part.num_rows * 180.0 / grid.height;
  return panorama;
}

Grid GridOf(const Camera& camera, const StitchOptions& options) {
  int width = options.width;
  if (width == 0) {
    width = std::min(static_cast<int>(std::lround(2.0 * kPi * camera.MeanFocal())),
                     StitchOptions::kMaxWidth);
  }
  return Grid(std::max(2, width - width % 2));
}

}  // namespace

std::optional<std::string> StitchOptions::Problem() const {
  if (width != 0 && (width < 16 || width > 32768)) {
    return OutOfRange("width", width, "0 or in [16, 32768]");
  }
  if (!(sharpness >= 0.0 && sharpness <= 100.0)) {
    return OutOfRange("sharpness", sharpness, "in [0, 100]");
  }
  return std::nullopt;
}

Panorama Stitch(const Camera& camera,
                const std::vector<Rotation>& world_from_cam,
                const ViewReader& read_views,
                const StitchOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("StitchOptions: " + *problem);
  }
  if (world_from_cam.empty()) throw std::invalid_argument("Stitch: no view");
  const Rotation sphere_from_world = SphereFromWorld(world_from_cam);
  const double radius = ViewRadius(camera);
  const auto project = [&](int k) {
    return ProjectedView(camera, sphere_from_world * world_from_cam.at(k), radius);
  };
  std::vector<double> gains(world_from_cam.size(), 1.0);
  if (options.compensate_exposure) {
    std::vector<Cells> cells(world_from_cam.size());
    read_views([&](int k, const cv::Mat& image) { cells.at(k) = BrightnessOf(image, project(k)); });
    gains = GainsOf(cells);
  }
  const Grid grid = GridOf(camera, options);
  Blend blend(grid, options.sharpness);
  int num_views = 0;
  read_views([&](int k, const cv::Mat& image) {
    blend.Add(image, project(k), gains.at(k), options.num_threads);
    ++num_views;
  });
  if (num_views == 0) throw std::invalid_argument("Stitch: no view has an image");
  const Part whole{0, grid.height, {0, grid.width}};
  return Cut(blend, grid, options.full ? whole : ContentOf(blend, grid));
}

}  // namespace rotslam
