#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "rotodom/features/fast_corners.h"
#include "rotodom/features/features.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

// Smallest distance of a corner from the border, pixels: closer ones have no complete patch for
// description and tracking.
constexpr int kBorder = 19;

// Features per level, proportional to the level's side length as in ORB; they sum to max_features.
std::vector<int> CountsPerLevel(const FeatureOptions& options) {
  std::vector<double> shares(options.num_levels);
  double sum = 0.0;
  for (int level = 0; level < options.num_levels; ++level) {
    shares[level] = std::pow(options.scale_factor, -level);
    sum += shares[level];
  }
  std::vector<int> counts(options.num_levels);
  double share = 0.0;  // of this level and those before it
  int given = 0;
  for (int level = 0; level < options.num_levels; ++level) {
    share += shares[level] / sum;
    counts[level] = static_cast<int>(std::lround(options.max_features * share)) - given;
    given += counts[level];
  }
  return counts;
}

// Number of new features per level. Where a level carries more than its count, the others are
// reduced in proportion to the total excess.
std::vector<int> RoomPerLevel(const std::vector<int>& counts,
                              const std::vector<int>& carried_counts) {
  std::vector<int> room(counts.size());
  int left = 0;  // in all
  int open = 0;  // on levels that are not full
  for (std::size_t level = 0; level < counts.size(); ++level) {
    left += counts[level] - carried_counts[level];
    room[level] = std::max(0, counts[level] - carried_counts[level]);
    open += room[level];
  }
  if (left <= 0) return std::vector<int>(counts.size(), 0);
  std::int64_t open_so_far = 0;
  int given = 0;
  for (int& here : room) {
    open_so_far += here;
    here = static_cast<int>(open_so_far * left / open) - given;
    given += here;
  }
  return room;
}

// A level's area in square cells of about two features.
class Grid {
 public:
  Grid(const cv::Rect& area, int count)
      : area_(area),
        side_(std::max(8, static_cast<int>(std::sqrt(2.0 * area.width * area.height / count)))),
        columns_((area.width + side_ - 1) / side_),
        rows_((area.height + side_ - 1) / side_) {}

  int num_cells() const { return columns_ * rows_; }
  int side() const { return side_; }

  // Positions outside belong to the nearest cell.
  int Column(double x) const {
    return std::clamp((static_cast<int>(x) - area_.x) / side_, 0, columns_ - 1);
  }
  int Row(double y) const {
    return std::clamp((static_cast<int>(y) - area_.y) / side_, 0, rows_ - 1);
  }
  int CellAt(double x, double y) const { return Row(y) * columns_ + Column(x); }
  int Cell(int column, int row) const { return row * columns_ + column; }

 private:
  cv::Rect area_;
  int side_;
  int columns_;
  int rows_;
};

// Candidates in one list, cell by cell. A cell that has strong corners holds no others.
struct Candidates {
  // Sorts by score, then by row and column from the top left: 8 bits, 28 bits, 28 bits.
  using Key = std::uint64_t;

  std::vector<Key> keys;
  std::vector<int> begin_of_cell;  // one more than there are cells
};

constexpr int kPositionBits = 28;
constexpr std::uint64_t kPositionMask = (std::uint64_t{1} << kPositionBits) - 1;

Candidates::Key ToKey(const FastCorner& corner) {
  const auto descending = [](int value) {
    return kPositionMask - static_cast<std::uint64_t>(value);
  };
  return static_cast<std::uint64_t>(corner.score) << (2 * kPositionBits) |
         descending(corner.y) << kPositionBits | descending(corner.x);
}

cv::Point PositionOf(Candidates::Key key) {
  return cv::Point(static_cast<int>(kPositionMask - (key & kPositionMask)),
                   static_cast<int>(kPositionMask - (key >> kPositionBits & kPositionMask)));
}

Candidates SortIntoCells(const std::vector<FastCorner>& corners,
                         const Grid& grid,
                         int strong_threshold) {
  std::vector<int> weak(grid.num_cells(), 0);
  std::vector<int> strong(grid.num_cells(), 0);
  std::vector<int> cell_of(corners.size());
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const int cell = grid.CellAt(corners[k].x, corners[k].y);
    cell_of[k] = cell;
    ++(corners[k].score >= strong_threshold ? strong : weak)[cell];
  }
  Candidates candidates;
  candidates.begin_of_cell.assign(grid.num_cells() + 1, 0);
  for (int cell = 0; cell < grid.num_cells(); ++cell) {
    candidates.begin_of_cell[cell + 1] =
        candidates.begin_of_cell[cell] + (strong[cell] > 0 ? strong[cell] : weak[cell]);
  }
  candidates.keys.resize(candidates.begin_of_cell.back());
  std::vector<int> next = candidates.begin_of_cell;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const int cell = cell_of[k];
    if (strong[cell] > 0 && corners[k].score < strong_threshold) continue;
    candidates.keys[next[cell]++] = ToKey(corners[k]);
  }
  return candidates;
}

// Positions on a level from which new corners keep the minimum distance.
class Taken {
 public:
  Taken(const Grid& grid, double min_distance_px)
      : grid_(grid), min_distance_px_(min_distance_px), positions_(grid.num_cells()) {}

  void Add(const Eigen::Vector2d& position) {
    positions_[grid_.CellAt(position.x(), position.y())].push_back(position);
  }

  int CountInCell(int cell) const { return static_cast<int>(positions_[cell].size()); }

  bool IsFree(const Eigen::Vector2d& position) const {
    const double reach = min_distance_px_;
    for (int row = grid_.Row(position.y() - reach); row <= grid_.Row(position.y() + reach); ++row) {
      for (int column = grid_.Column(position.x() - reach);
           column <= grid_.Column(position.x() + reach);
           ++column) {
        for (const Eigen::Vector2d& other : positions_[grid_.Cell(column, row)]) {
          if ((other - position).squaredNorm() < reach * reach) return false;
        }
      }
    }
    return true;
  }

 private:
  const Grid& grid_;
  double min_distance_px_;
  std::vector<std::vector<Eigen::Vector2d>> positions_;
};

// Selects corners in rounds: each round takes the best remaining corner of every cell. A cell takes
// part once as many rounds are over as it has carried features. Ends when `count` corners are
// selected.
std::vector<cv::Point> ChooseInRounds(Candidates candidates,
                                      const Grid& grid,
                                      int count,
                                      Taken& taken) {
  std::vector<int> end_of_cell(candidates.begin_of_cell.begin() + 1,
                               candidates.begin_of_cell.end());
  std::vector<int> first_turn(grid.num_cells());
  std::vector<int> open;  // cells that have corners left
  for (int cell = 0; cell < grid.num_cells(); ++cell) {
    const auto begin = candidates.keys.begin() + candidates.begin_of_cell[cell];
    const auto end = candidates.keys.begin() + end_of_cell[cell];
    if (begin == end) continue;
    std::make_heap(begin, end);
    first_turn[cell] = taken.CountInCell(cell);
    open.push_back(cell);
  }
  const auto take_best = [&](int cell) -> std::optional<Candidates::Key> {
    const auto begin = candidates.keys.begin() + candidates.begin_of_cell[cell];
    while (end_of_cell[cell] > candidates.begin_of_cell[cell]) {
      std::pop_heap(begin, candidates.keys.begin() + end_of_cell[cell]);
      const Candidates::Key key = candidates.keys[--end_of_cell[cell]];
      const cv::Point position = PositionOf(key);
      if (taken.IsFree(Eigen::Vector2d(position.x, position.y))) return key;
    }
    return std::nullopt;
  };
  std::vector<cv::Point> chosen;
  for (int turn = 0; !open.empty() && static_cast<int>(chosen.size()) < count; ++turn) {
    std::vector<Candidates::Key> this_turn;
    std::vector<int> still_open;
    for (const int cell : open) {
      if (first_turn[cell] <= turn) {
        const auto key = take_best(cell);
        if (!key) continue;
        const cv::Point position = PositionOf(*key);
        taken.Add(Eigen::Vector2d(position.x, position.y));
        this_turn.push_back(*key);
      }
      still_open.push_back(cell);
    }
    open = std::move(still_open);
    const std::size_t room = static_cast<std::size_t>(count) - chosen.size();
    if (this_turn.size() > room) {
      std::sort(this_turn.begin(), this_turn.end(), std::greater<>());
      this_turn.resize(room);
    }
    for (const Candidates::Key key : this_turn) chosen.push_back(PositionOf(key));
  }
  std::sort(chosen.begin(), chosen.end(), [](const cv::Point& a, const cv::Point& b) {
    return a.y != b.y ? a.y < b.y : a.x < b.x;
  });
  return chosen;
}

// How many corners a level should have in all, and how many of them are new.
struct LevelCounts {
  int all = 0;
  int room = 0;
};

// New corners of a level.
std::vector<cv::Point> DetectOnLevel(const ImagePyramid& pyramid,
                                     int level,
                                     const std::vector<Eigen::Vector2d>& carried,
                                     const LevelCounts& counts,
                                     const FeatureOptions& options) {
  const cv::Mat& image = pyramid.levels[level];
  const cv::Rect area(kBorder, kBorder, image.cols - 2 * kBorder, image.rows - 2 * kBorder);
  if (area.width <= 0 || area.height <= 0 || counts.room <= 0) return {};
  const Grid grid(area, counts.all);
  Taken taken(grid, options.min_distance_px);
  for (const Eigen::Vector2d& position : carried) taken.Add(position);
  std::vector<FastCorner> corners = FindFastCorners(image, area, options.min_fast_threshold);
  if (!pyramid.mask.IsEmpty()) {
    std::erase_if(corners, [&](const FastCorner& corner) {
      return pyramid.IsMasked(pyramid.ToImage(Eigen::Vector2d(corner.x, corner.y), level), level);
    });
  }
  return ChooseInRounds(
      SortIntoCells(corners, grid, options.fast_threshold), grid, counts.room, taken);
}

}  // namespace

void DetectFeatures(const ImagePyramid& pyramid,
                    const Camera& camera,
                    const FeatureOptions& options,
                    int num_threads,
                    Features& features) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("FeatureOptions: " + *problem);
  }
  const int num_levels = static_cast<int>(pyramid.levels.size());
  if (num_levels != options.num_levels) {
    throw std::invalid_argument("DetectFeatures: the pyramid was built with other options");
  }
  const std::size_t num_carried = features.keypoints_px.size();
  if (features.bearings.size() != num_carried || features.levels.size() != num_carried ||
      features.rgb.size() != num_carried) {
    throw std::invalid_argument("DetectFeatures: the carried features' lists differ in length");
  }
  const std::vector<int> counts = CountsPerLevel(options);
  std::vector<std::vector<Eigen::Vector2d>> carried(num_levels);
  for (std::size_t k = 0; k < num_carried; ++k) {
    const int level = features.levels[k];
    if (level < 0 || level >= num_levels) {
      throw std::invalid_argument("DetectFeatures: a carried feature has no level of the pyramid");
    }
    if (!features.keypoints_px[k].allFinite()) {
      throw std::invalid_argument("DetectFeatures: a carried feature has no finite position");
    }
    carried[level].push_back(pyramid.ToLevel(features.keypoints_px[k], level));
  }
  std::vector<int> carried_counts(num_levels);
  for (int level = 0; level < num_levels; ++level) {
    carried_counts[level] = static_cast<int>(carried[level].size());
  }
  const std::vector<int> room = RoomPerLevel(counts, carried_counts);
  std::vector<std::vector<cv::Point>> corners(num_levels);
  ParallelFor(num_levels, num_threads, [&](int level) {
    corners[level] =
        DetectOnLevel(pyramid, level, carried[level], {counts[level], room[level]}, options);
  });
  for (int level = 0; level < num_levels; ++level) {
    for (const cv::Point& corner : corners[level]) {
      const Eigen::Vector2d position = pyramid.ToImage(Eigen::Vector2d(corner.x, corner.y), level);
      const auto bearing = camera.Unproject(position);
      if (!bearing) continue;
      const std::uint8_t grey = pyramid.levels[level].at<std::uint8_t>(corner);
      features.keypoints_px.push_back(position);
      features.bearings.push_back(*bearing);
      features.levels.push_back(level);
      features.rgb.push_back({grey, grey, grey});
    }
  }
}

}  // namespace rotslam
