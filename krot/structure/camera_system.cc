#include "krot/structure/camera_system.h"

#include <algorithm>
#include <utility>

#include <Eigen/Cholesky>

namespace rotslam {
namespace {

std::vector<std::vector<int>> Neighbours(int num_blocks,
                                         const std::vector<std::vector<int>>& groups) {
  std::vector<std::vector<int>> neighbours(num_blocks);
  std::vector<std::size_t> sorted_size(num_blocks, 64);
  const auto tidy = [](std::vector<int>& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  };
  for (const std::vector<int>& group : groups) {
    for (const int a : group) {
      for (const int b : group) {
        if (a != b) neighbours[a].push_back(b);
      }
      // Duplicates are removed as soon as they outnumber the rest.
      if (neighbours[a].size() < 2 * sorted_size[a]) continue;
      tidy(neighbours[a]);
      sorted_size[a] = std::max<std::size_t>(64, neighbours[a].size());
    }
  }
  for (std::vector<int>& list : neighbours) tidy(list);
  return neighbours;
}

// Breadth-first order of the connected component of `start`, neighbours by degree.
std::vector<int> Sweep(const std::vector<std::vector<int>>& neighbours,
                       int start,
                       std::vector<bool> seen) {
  std::vector<int> order = {start};
  seen[start] = true;
  for (std::size_t k = 0; k < order.size(); ++k) {
    std::vector<int> next;
    for (const int b : neighbours[order[k]]) {
      if (seen[b]) continue;
      seen[b] = true;
      next.push_back(b);
    }
    std::stable_sort(next.begin(), next.end(), [&](int a, int b) {
      return neighbours[a].size() < neighbours[b].size();
    });
    order.insert(order.end(), next.begin(), next.end());
  }
  return order;
}

// Reverse Cuthill-McKee order; each connected component starts from the last block of a
// breadth-first sweep.
std::vector<int> Positions(const std::vector<std::vector<int>>& neighbours) {
  const int n = static_cast<int>(neighbours.size());
  std::vector<bool> seen(n, false);
  std::vector<int> order;
  for (int start = 0; start < n; ++start) {
    if (seen[start]) continue;
    const int end = Sweep(neighbours, start, seen).back();
    for (const int block : Sweep(neighbours, end, seen)) {
      seen[block] = true;
      order.push_back(block);
    }
  }
  std::vector<int> position(n);
  for (int k = 0; k < n; ++k) position[order[k]] = n - 1 - k;
  return position;
}

}  // namespace

CameraSystem::CameraSystem(int num_blocks, const std::vector<std::vector<int>>& groups)
    : num_blocks_(num_blocks), num_tiles_((num_blocks + kBlocksPerTile - 1) / kBlocksPerTile) {
  const auto neighbours = Neighbours(num_blocks, groups);
  position_ = Positions(neighbours);
  PlaceTiles(neighbours);
}

void CameraSystem::PlaceTiles(const std::vector<std::vector<int>>& neighbours) {
  const int n = num_tiles_;
  std::vector<bool> present(static_cast<std::size_t>(n) * n, false);
  for (int a = 0; a < num_blocks_; ++a) {
    const int row = position_[a] / kBlocksPerTile;
    present[row * n + row] = true;
    for (const int b : neighbours[a]) {
      const int column = position_[b] / kBlocksPerTile;
      if (row > column) present[row * n + column] = true;
    }
  }
  rows_of_.resize(n);
  before_.resize(n);
  tile_index_.assign(present.size(), -1);
  int count = 0;
  for (int column = 0; column < n; ++column) {
    tile_index_[column * n + column] = count++;
    std::vector<int>& rows = rows_of_[column];
    for (int row = column + 1; row < n; ++row) {
      if (present[row * n + column]) rows.push_back(row);
    }
    for (const int row : rows) {
      tile_index_[row * n + column] = count++;
      before_[row].push_back(column);
      for (const int other : rows) {
        if (other <= row) present[row * n + other] = true;
      }
    }
  }
  tiles_.resize(count);
}

CameraSystem::Tile* CameraSystem::Find(int row, int column) {
  const int index = tile_index_[row * num_tiles_ + column];
  return index < 0 ? nullptr : &tiles_[index];
}

const CameraSystem::Tile* CameraSystem::Find(int row, int column) const {
  const int index = tile_index_[row * num_tiles_ + column];
  return index < 0 ? nullptr : &tiles_[index];
}

void CameraSystem::SetZero() {
  for (Tile& tile : tiles_) tile.setZero();
}

void CameraSystem::Add(int a, int b, const Eigen::Matrix3d& block) {
  const int i = position_[a];
  const int j = position_[b];
  const int row = 3 * (i % kBlocksPerTile);
  const int column = 3 * (j % kBlocksPerTile);
  if (i >= j) {
    At(i / kBlocksPerTile, j / kBlocksPerTile).block<3, 3>(row, column) += block;
  } else {
    At(j / kBlocksPerTile, i / kBlocksPerTile).block<3, 3>(column, row) += block.transpose();
  }
}

bool CameraSystem::Factor() {
  // Rows without entries, such as the unused ones of the last tile, become identities.
  for (int t = 0; t < num_tiles_; ++t) {
    for (int k = 0; k < kTileSize; ++k) {
      if (At(t, t)(k, k) == 0.0) At(t, t)(k, k) = 1.0;
    }
  }
  for (int column = 0; column < num_tiles_; ++column) {
    if (!FactorColumn(column)) return false;
  }
  return true;
}

bool CameraSystem::FactorColumn(int column) {
  Tile& diagonal = At(column, column);
  for (const int k : before_[column]) {
    const Tile& left = At(column, k);
    diagonal.triangularView<Eigen::Lower>() -= left * left.transpose();
  }
  Eigen::LLT<Eigen::Ref<Tile>> llt(diagonal);
  if (llt.info() != Eigen::Success) return false;
  for (const int row : rows_of_[column]) {
    Tile& tile = At(row, column);
    for (const int k : before_[column]) {
      const Tile* left = Find(row, k);
      if (left != nullptr) tile.noalias() -= *left * At(column, k).transpose();
    }
    diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(tile);
  }
  return true;
}

Eigen::VectorXd CameraSystem::Solve(const Eigen::VectorXd& b) const {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(num_tiles_ * kTileSize);
  for (int a = 0; a < num_blocks_; ++a) x.segment<3>(3 * position_[a]) = b.segment<3>(3 * a);
  const auto part = [&](int tile) { return x.segment<kTileSize>(kTileSize * tile); };
  for (int column = 0; column < num_tiles_; ++column) {
    auto here = part(column);
    At(column, column).triangularView<Eigen::Lower>().solveInPlace(here);
    for (const int row : rows_of_[column]) part(row).noalias() -= At(row, column) * here;
  }
  for (int column = num_tiles_ - 1; column >= 0; --column) {
    auto here = part(column);
    for (const int row : rows_of_[column]) {
      here.noalias() -= At(row, column).transpose() * part(row);
    }
    At(column, column).triangularView<Eigen::Lower>().transpose().solveInPlace(here);
  }
  Eigen::VectorXd result(3 * num_blocks_);
  for (int a = 0; a < num_blocks_; ++a) result.segment<3>(3 * a) = x.segment<3>(3 * position_[a]);
  return result;
}

}  // namespace rotslam
