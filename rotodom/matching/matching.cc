#include "rotodom/matching/matching.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

constexpr int kCellPx = 32;

int HammingDistance(const std::uint8_t* a, const std::uint8_t* b) {
  int distance = 0;
  for (int word = 0; word < 4; ++word) {
    std::uint64_t x;
    std::uint64_t y;
    std::memcpy(&x, a + 8 * word, 8);
    std::memcpy(&y, b + 8 * word, 8);
    distance += std::popcount(x ^ y);
  }
  return distance;
}

// Keypoints of one frame by image cell.
class KeypointGrid {
 public:
  explicit KeypointGrid(const Features& features) : features_(features) {
    for (const Eigen::Vector2d& keypoint : features.keypoints_px) {
      columns_ = std::max(columns_, static_cast<int>(keypoint.x()) / kCellPx + 1);
      rows_ = std::max(rows_, static_cast<int>(keypoint.y()) / kCellPx + 1);
    }
    cells_.resize(static_cast<std::size_t>(columns_) * rows_);
    for (int index = 0; index < features.size(); ++index) {
      const Eigen::Vector2d& keypoint = features.keypoints_px[index];
      const int column = std::max(0, static_cast<int>(keypoint.x()) / kCellPx);
      const int row = std::max(0, static_cast<int>(keypoint.y()) / kCellPx);
      cells_[row * columns_ + column].push_back(index);
    }
  }

  template <class Visitor>
  void VisitWithin(const Eigen::Vector2d& center, double radius, Visitor&& visit) const {
    const auto cell_of = [](double coordinate, int count) {
      return static_cast<int>(std::clamp(std::floor(coordinate / kCellPx), -1.0, double(count)));
    };
    const int first_column = std::max(0, cell_of(center.x() - radius, columns_));
    const int last_column = std::min(columns_ - 1, cell_of(center.x() + radius, columns_));
    const int first_row = std::max(0, cell_of(center.y() - radius, rows_));
    const int last_row = std::min(rows_ - 1, cell_of(center.y() + radius, rows_));
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column) {
        for (const int index : cells_[row * columns_ + column]) {
          if ((features_.keypoints_px[index] - center).squaredNorm() <= radius * radius)
            visit(index);
        }
      }
    }
  }

 private:
  const Features& features_;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::vector<int>> cells_;
};

struct Candidate {
  int j = -1;
  int distance = std::numeric_limits<int>::max();
};

// Best candidate of each keypoint of frame i; j = -1 where there is none.
std::vector<Candidate> FindBest(const Features& features_i,
                                const Features& features_j,
                                const std::vector<std::optional<Eigen::Vector2d>>& predicted_px,
                                const KeypointGrid& grid_j,
                                double radius,
                                const MatchingOptions& options) {
  std::vector<Candidate> best(features_i.size());
  for (int i = 0; i < features_i.size(); ++i) {
    if (!predicted_px[i]) continue;
    const std::uint8_t* descriptor = features_i.descriptors.ptr<std::uint8_t>(i);
    Candidate first;
    Candidate second;
    grid_j.VisitWithin(*predicted_px[i], radius, [&](int j) {
      if (std::abs(features_j.levels[j] - features_i.levels[i]) > options.max_level_step) return;
      const int distance = HammingDistance(descriptor, features_j.descriptors.ptr<std::uint8_t>(j));
      if (distance < first.distance) {
        second = first;
        first = {j, distance};
      } else if (distance < second.distance) {
        second = {j, distance};
      }
    });
    if (first.j < 0 || first.distance > options.max_distance) continue;
    // The same corner found on the next level is no rival.
    const bool rival =
        second.j >= 0 &&
        (features_j.keypoints_px[second.j] - features_j.keypoints_px[first.j]).norm() > 4.0;
    if (rival && first.distance > options.ratio * second.distance) continue;
    best[i] = first;
  }
  return best;
}

// Keeps, of all keypoints of frame i that chose the same one of frame j, the nearest.
void KeepMutual(std::vector<Candidate>& best, int num_j) {
  std::vector<int> owner(num_j, -1);
  for (int i = 0; i < static_cast<int>(best.size()); ++i) {
    if (best[i].j < 0) continue;
    int& current = owner[best[i].j];
    if (current < 0 || best[i].distance < best[current].distance) current = i;
  }
  for (int i = 0; i < static_cast<int>(best.size()); ++i) {
    if (best[i].j >= 0 && owner[best[i].j] != i) best[i].j = -1;
  }
}

// All patches turn by about the same angle between two frames: keeps the matches near the commonest
// turn.
void KeepCommonTurn(std::vector<Candidate>& best,
                    const Features& features_i,
                    const Features& features_j) {
  constexpr int kBins = 24;
  const auto bin_of = [&](int i) {
    const double turn = features_j.angles_rad[best[i].j] - features_i.angles_rad[i];
    const double fraction = turn / (2.0 * std::numbers::pi);
    return static_cast<int>((fraction - std::floor(fraction)) * kBins) % kBins;
  };
  std::array<int, kBins> histogram = {};
  for (int i = 0; i < static_cast<int>(best.size()); ++i) {
    if (best[i].j >= 0) ++histogram[bin_of(i)];
  }
  int common = 0;
  int most = -1;
  for (int bin = 0; bin < kBins; ++bin) {
    const int around =
        histogram[(bin + kBins - 1) % kBins] + histogram[bin] + histogram[(bin + 1) % kBins];
    if (around > most) {
      most = around;
      common = bin;
    }
  }
  for (int i = 0; i < static_cast<int>(best.size()); ++i) {
    if (best[i].j < 0) continue;
    const int away = std::abs(bin_of(i) - common);
    if (std::min(away, kBins - away) > 1) best[i].j = -1;
  }
}

}  // namespace

std::optional<std::string> MatchingOptions::Problem() const {
  if (!(radius_px > 0.0)) return OutOfRange("radius_px", radius_px, "positive");
  if (!(wide_radius_px >= radius_px))
    return OutOfRange("wide_radius_px", wide_radius_px, "at least radius_px");
  if (min_matches < 0) return OutOfRange("min_matches", min_matches, "zero or more");
  if (max_distance < 0 || max_distance > 256)
    return OutOfRange("max_distance", max_distance, "0 to 256");
  if (!(ratio > 0.0 && ratio <= 1.0)) return OutOfRange("ratio", ratio, "above 0 and at most 1");
  if (max_level_step < 0) return OutOfRange("max_level_step", max_level_step, "zero or more");
  return std::nullopt;
}

Matches MatchFeatures(const Features& features_i,
                      const Features& features_j,
                      const Rotation& predicted_j_from_i,
                      const Camera& camera,
                      const MatchingOptions& options) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("MatchingOptions: " + *problem);
  }
  Matches result;
  result.frame_i = features_i.frame;
  result.frame_j = features_j.frame;
  std::vector<std::optional<Eigen::Vector2d>> predicted_px;
  for (const Eigen::Vector3d& bearing : features_i.bearings) {
    predicted_px.push_back(camera.Project(predicted_j_from_i * bearing));
  }
  const KeypointGrid grid_j(features_j);
  const struct {
    SearchRange range;
    double radius;
  } searches[] = {{SearchRange::kGuided, options.radius_px},
                  {SearchRange::kWide, options.wide_radius_px},
                  {SearchRange::kWholeImage, 1e6}};
  std::vector<Candidate> best;
  for (const auto& search : searches) {
    if (search.range == SearchRange::kWholeImage) {
      // The prediction has failed, so features that it sends out of the image count as well.
      for (std::size_t i = 0; i < predicted_px.size(); ++i)
        predicted_px[i] = features_i.keypoints_px[i];
    }
    result.range = search.range;
    best = FindBest(features_i, features_j, predicted_px, grid_j, search.radius, options);
    KeepMutual(best, features_j.size());
    KeepCommonTurn(best, features_i, features_j);
    const auto found =
        std::count_if(best.begin(), best.end(), [](const Candidate& c) { return c.j >= 0; });
    if (found >= options.min_matches) break;
  }
  for (int i = 0; i < features_i.size(); ++i) {
    if (best[i].j < 0) continue;
    result.matches.push_back({KeypointIndex{i}, KeypointIndex{best[i].j}});
  }
  return result;
}

}  // namespace rotslam
