#include "apps/paper_method/window_matching.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace rotslam {
namespace {

// Levels that the two corners of a match may be apart (MRO).
constexpr int kMaxLevels = 2;
// Side of a cell in which a frame's features are listed, pixels.
constexpr double kBucketPx = 32.0;
// Classes of a patch's rotation, and how many of them stay (ORB-SLAM2).
constexpr int kNumTurns = 12;
constexpr int kNumTurnsKept = 3;
// A class that stays has this share of the largest one's matches.
constexpr double kMinTurnShare = 0.1;

// The features of a frame by their place in the image.
class Cells {
 public:
  explicit Cells(const std::vector<Eigen::Vector2d>& keypoints_px) {
    Eigen::Vector2d most = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& keypoint : keypoints_px) most = most.cwiseMax(keypoint);
    cols_ = CellOf(most.x()) + 1;
    rows_ = CellOf(most.y()) + 1;
    cells_.resize(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_));
    for (std::size_t k = 0; k < keypoints_px.size(); ++k) {
      At(CellOf(keypoints_px[k].x()), CellOf(keypoints_px[k].y())).push_back(static_cast<int>(k));
    }
  }

  // Calls `take` with all features in the cells that the square touches.
  template <class Take>
  void Around(const Eigen::Vector2d& center, double radius_px, Take&& take) const {
    const int last_col = std::min(cols_ - 1, CellOf(center.x() + radius_px));
    const int last_row = std::min(rows_ - 1, CellOf(center.y() + radius_px));
    for (int row = CellOf(center.y() - radius_px); row <= last_row; ++row) {
      for (int col = CellOf(center.x() - radius_px); col <= last_col; ++col) {
        for (const int k : At(col, row)) take(k);
      }
    }
  }

 private:
  static int CellOf(double px) { return static_cast<int>(std::max(0.0, px) / kBucketPx); }
  std::vector<int>& At(int col, int row) {
    return cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) + col];
  }
  const std::vector<int>& At(int col, int row) const {
    return cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) + col];
  }

  int cols_ = 0;
  int rows_ = 0;
  std::vector<std::vector<int>> cells_;
};

// The best of the candidates for one feature, and whether the second best is far enough behind.
class BestMatch {
 public:
  void Offer(int index, int distance) {
    if (distance < best_) {
      second_ = best_;
      best_ = distance;
      index_ = index;
    } else {
      second_ = std::min(second_, distance);
    }
  }
  bool Counts(const MatchingOptions& options) const {
    return best_ <= options.max_distance && best_ < options.ratio * second_;
  }
  int index() const { return index_; }
  int distance() const { return best_; }

 private:
  static constexpr int kNone = 1000;  // beyond 256 bits
  int best_ = kNone;
  int second_ = kNone;
  int index_ = -1;
};

// Which feature of j each feature of i has, the nearest of those that want it.
class Assignment {
 public:
  explicit Assignment(std::size_t num_i)
      : j_of_i_(num_i, -1), distances_(num_i, std::numeric_limits<int>::max()) {}

  // Whether a feature of i is still to be had at this distance.
  bool IsFree(int i, int distance) const { return distance < distances_[i]; }
  void Set(int i, int j, int distance) {
    j_of_i_[i] = j;
    distances_[i] = distance;
  }
  std::vector<std::array<int, 2>> Pairs() const {
    std::vector<std::array<int, 2>> pairs;
    for (std::size_t i = 0; i < j_of_i_.size(); ++i) {
      if (j_of_i_[i] >= 0) pairs.push_back({static_cast<int>(i), j_of_i_[i]});
    }
    std::sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) { return a[1] < b[1]; });
    return pairs;
  }

 private:
  std::vector<int> j_of_i_;
  std::vector<int> distances_;
};

int TurnOf(float angle_i_rad, float angle_j_rad) {
  const double turns = (angle_i_rad - angle_j_rad) / (2.0 * std::numbers::pi);
  const int turn = static_cast<int>(std::lround((turns - std::floor(turns)) * kNumTurns));
  return turn % kNumTurns;
}

// Drops matches whose patches have rotated as few others have.
void KeepCommonTurns(const OrbView& i, const OrbView& j, std::vector<std::array<int, 2>>& pairs) {
  const auto turn_of = [&](const std::array<int, 2>& pair) {
    return TurnOf(i.angles_rad[pair[0]], j.angles_rad[pair[1]]);
  };
  std::array<int, kNumTurns> counts{};
  for (const auto& pair : pairs) ++counts[turn_of(pair)];
  std::array<int, kNumTurns> order{};
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return counts[a] > counts[b]; });
  std::array<bool, kNumTurns> stays{};
  for (int k = 0; k < kNumTurnsKept; ++k) {
    stays[order[k]] = counts[order[k]] >= kMinTurnShare * counts[order[0]];
  }
  std::erase_if(pairs, [&](const auto& pair) { return !stays[turn_of(pair)]; });
}

}  // namespace

OrbView ToOrbView(const Features& features) {
  return {features.frame,
          features.keypoints_px,
          features.bearings,
          features.levels,
          features.angles_rad,
          ToBinaryDescriptors(features.descriptors)};
}

std::vector<std::array<int, 2>> MatchInWindow(const OrbView& i,
                                              const OrbView& j,
                                              const MatchingOptions& options) {
  const Cells cells(i.keypoints_px);
  Assignment assignment(i.keypoints_px.size());
  for (std::size_t k = 0; k < j.keypoints_px.size(); ++k) {
    BestMatch best;
    cells.Around(j.keypoints_px[k], options.radius_px, [&](int candidate) {
      if (std::abs(i.levels[candidate] - j.levels[k]) > kMaxLevels) return;
      const Eigen::Vector2d offset = i.keypoints_px[candidate] - j.keypoints_px[k];
      if (offset.cwiseAbs().maxCoeff() > options.radius_px) return;
      const int distance = HammingDistance(i.descriptors[candidate], j.descriptors[k]);
      if (assignment.IsFree(candidate, distance)) best.Offer(candidate, distance);
    });
    if (!best.Counts(options)) continue;
    assignment.Set(best.index(), static_cast<int>(k), best.distance());
  }
  return assignment.Pairs();
}

std::vector<std::array<int, 2>> MatchByWords(const OrbView& i,
                                             const DirectIndex& words_i,
                                             const OrbView& j,
                                             const DirectIndex& words_j,
                                             const MatchingOptions& options) {
  Assignment assignment(i.keypoints_px.size());
  for (std::size_t node_j = 0; node_j < words_j.nodes.size(); ++node_j) {
    const auto found =
        std::lower_bound(words_i.nodes.begin(), words_i.nodes.end(), words_j.nodes[node_j]);
    if (found == words_i.nodes.end() || *found != words_j.nodes[node_j]) continue;
    const auto node_i = static_cast<std::size_t>(found - words_i.nodes.begin());
    for (const int k : words_j.FeaturesOf(node_j)) {
      BestMatch best;
      for (const int candidate : words_i.FeaturesOf(node_i)) {
        const int distance = HammingDistance(i.descriptors[candidate], j.descriptors[k]);
        if (assignment.IsFree(candidate, distance)) best.Offer(candidate, distance);
      }
      if (best.Counts(options)) assignment.Set(best.index(), k, best.distance());
    }
  }
  std::vector<std::array<int, 2>> pairs = assignment.Pairs();
  KeepCommonTurns(i, j, pairs);
  return pairs;
}

}  // namespace rotslam
