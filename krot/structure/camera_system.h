#pragma once

#include <vector>

#include <Eigen/Core>

namespace rotslam {

/// Symmetric positive definite system of 3 x 3 blocks, factored as L L^T in square tiles. Blocks
/// are ordered by reverse Cuthill-McKee, so that the tiles of a drive form a band; those of an
/// orbit are all non-zero. Arithmetic is dense within a tile.
class CameraSystem {
 public:
  /// @param groups  block (a, b) may be non-zero where a and b are members of one group; members
  ///                are in [0, num_blocks).
  CameraSystem(int num_blocks, const std::vector<std::vector<int>>& groups);

  void SetZero();
  /// Adds `block` to block (a, b) and its transpose to (b, a); a diagonal block is added once.
  void Add(int a, int b, const Eigen::Matrix3d& block);
  /// False when the matrix is not positive definite. Blocks without entries count as identities.
  bool Factor();
  Eigen::VectorXd Solve(const Eigen::VectorXd& b) const;

 private:
  static constexpr int kBlocksPerTile = 16;
  static constexpr int kTileSize = 3 * kBlocksPerTile;
  using Tile = Eigen::Matrix<double, kTileSize, kTileSize>;

  Tile* Find(int row, int column);
  const Tile* Find(int row, int column) const;
  Tile& At(int row, int column) { return *Find(row, column); }
  const Tile& At(int row, int column) const { return *Find(row, column); }
  void PlaceTiles(const std::vector<std::vector<int>>& neighbours);
  bool FactorColumn(int column);

  int num_blocks_;
  int num_tiles_;                          // per side
  std::vector<int> position_;              // of each block in the elimination's order
  std::vector<int> tile_index_;            // row * num_tiles_ + column, -1: zero; row >= column
  std::vector<std::vector<int>> rows_of_;  // below the diagonal, by column
  std::vector<std::vector<int>> before_;   // columns left of the diagonal, by row
  std::vector<Tile> tiles_;
};

}  // namespace rotslam
