#include "rotodom/matching/matching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <stdexcept>

#include "rotodom/features/binary_descriptor.h"
#include "rotodom/types/options.h"

namespace rotslam {
namespace {

constexpr int kCellPx = 32;  // of the grid: near the search radius, so that few cells are visited
// Pyramid levels that a feature may move between two frames: one is a factor of 1.2, more than the
// distance to a point changes from frame to frame.
constexpr int kMaxLevelStep = 1;

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

  // All keypoints, in the order of a search over the whole image.
  std::vector<int> All() const {
    std::vector<int> all;
    all.reserve(features_.size());
    for (const std::vector<int>& cell : cells_) all.insert(all.end(), cell.begin(), cell.end());
    return all;
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

// The two nearest candidates of one keypoint; the first of equal ones.
struct Nearest {
  Candidate first;
  Candidate second;

  void Add(int j, int distance) {
    if (distance < first.distance) {
      second = first;
      first = {j, distance};
    } else if (distance < second.distance) {
      second = {j, distance};
    }
  }
};

// The nearest candidate of frame j if its distance is small enough and the second one is clearly
// worse; else j = -1.
Candidate Choose(const Nearest& nearest,
                 const Features& features_j,
                 const MatchingOptions& options) {
  const auto& [first, second] = nearest;
  if (first.j < 0 || first.distance > options.max_distance) return {};
  // The same corner found on the next level is no alternative.
  const bool alternative =
      second.j >= 0 &&
      (features_j.keypoints_px[second.j] - features_j.keypoints_px[first.j]).norm() > 4.0;
  if (alternative && first.distance > options.ratio * second.distance) return {};
  return first;
}

// Searches each keypoint of frame i in frame j. Results have one entry per keypoint.
class Search {
 public:
  Search(const Features& features_i, const Features& features_j, const MatchingOptions& options)
      : features_i_(features_i),
        features_j_(features_j),
        options_(options),
        descriptors_i_(ToBinaryDescriptors(features_i.descriptors)),
        descriptors_j_(ToBinaryDescriptors(features_j.descriptors)),
        grid_j_(features_j) {}

  // Searches within a circle around the predicted position, if there is one.
  std::vector<Candidate> Around(const std::vector<std::optional<Eigen::Vector2d>>& predicted_px,
                                double radius) const {
    std::vector<Candidate> best(features_i_.size());
    for (int i = 0; i < features_i_.size(); ++i) {
      if (!predicted_px[i]) continue;
      Nearest nearest;
      grid_j_.VisitWithin(*predicted_px[i], radius, [&](int j) {
        if (!IsComparable(features_i_.levels[i], j)) return;
        nearest.Add(j, HammingDistance(descriptors_i_[i], descriptors_j_[j]));
      });
      best[i] = Choose(nearest, features_j_, options_);
    }
    return best;
  }

  // Searches the whole image. Comparable descriptors are stored contiguously, so that only the
  // distances remain to be computed.
  std::vector<Candidate> Anywhere() const {
    struct Group {
      std::vector<int> indices;
      std::vector<BinaryDescriptor> descriptors;
    };
    std::map<int, Group> comparable;  // by the level of frame i
    for (const int level : features_i_.levels) comparable[level];
    for (const int j : grid_j_.All()) {
      for (auto& [level, group] : comparable) {
        if (!IsComparable(level, j)) continue;
        group.indices.push_back(j);
        group.descriptors.push_back(descriptors_j_[j]);
      }
    }
    std::vector<Candidate> best(features_i_.size());
    for (int i = 0; i < features_i_.size(); ++i) {
      const Group& group = comparable.at(features_i_.levels[i]);
      Nearest nearest;
      for (std::size_t k = 0; k < group.indices.size(); ++k) {
        nearest.Add(group.indices[k], HammingDistance(descriptors_i_[i], group.descriptors[k]));
      }
      best[i] = Choose(nearest, features_j_, options_);
    }
    return best;
  }

 private:
  bool IsComparable(int level_i, int j) const {
    return std::abs(features_j_.levels[j] - level_i) <= kMaxLevelStep;
  }

  const Features& features_i_;
  const Features& features_j_;
  const MatchingOptions& options_;
  std::vector<BinaryDescriptor> descriptors_i_;
  std::vector<BinaryDescriptor> descriptors_j_;
  KeypointGrid grid_j_;
};

// Of all keypoints of frame i with the same match in frame j, keeps the nearest.
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

// Patches rotate by about the same angle between two frames: keeps the matches near the most
// frequent angle.
void KeepCommonRotation(std::vector<Candidate>& best,
                        const Features& features_i,
                        const Features& features_j) {
  constexpr int kBins = 24;  // of 15 deg: patch angles have errors of several degrees
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
  const Search search(features_i, features_j, options);
  std::vector<Candidate> best;
  for (const SearchRange range :
       {SearchRange::kGuided, SearchRange::kWide, SearchRange::kWholeImage}) {
    result.range = range;
    // In a search over the whole image, keypoints predicted outside of the image are included.
    best = range == SearchRange::kWholeImage ? search.Anywhere()
           : range == SearchRange::kWide     ? search.Around(predicted_px, options.wide_radius_px)
                                             : search.Around(predicted_px, options.radius_px);
    KeepMutual(best, features_j.size());
    KeepCommonRotation(best, features_i, features_j);
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
