// Factorisations of graph Laplacians, as rotation averaging needs them: Eigen's, which it uses,
// beside CHOLMOD's; of the scalar Laplacian, which preconditions, and of 3x3 blocks, which would
// solve. The order of elimination is found once, a factorisation per step.
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCholesky>
#include <benchmark/benchmark.h>

#include "output/graph/g2o.h"
#include "tests/scenes/wrong_edges.h"

namespace rotslam {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

std::vector<RelativeRotation> CityEdges(int num_views) {
  const WrongEdges scene = MakeWrongEdges({.shape = GraphShape::kCity, .num_views = num_views});
  return scene.edges;
}

std::vector<RelativeRotation> FileEdges(const char* name) {
  const std::filesystem::path path =
      std::filesystem::path(ROTSLAM_SHARED_DIR) / "data" / "pose_graphs" / name;
  if (!std::filesystem::exists(path)) return {};
  return ReadG2o(path).graph.edges();
}

// Blocks are not isotropic, so none of their entries is zero.
Matrix Laplacian(const std::vector<RelativeRotation>& edges, int block) {
  int num_views = 0;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(3 * edges.size() * static_cast<std::size_t>(block * block));
  for (const RelativeRotation& edge : edges) {
    const int i = edge.i.value;
    const int j = edge.j.value;
    num_views = std::max({num_views, i + 1, j + 1});
    for (int row = 0; row < block; ++row) {
      for (int column = 0; column < block; ++column) {
        const double weight = row == column ? 1.0 : 0.1;
        entries.emplace_back(block * i + row, block * i + column, weight);
        entries.emplace_back(block * j + row, block * j + column, weight);
        entries.emplace_back(block * j + row, block * i + column, -weight);
        entries.emplace_back(block * i + row, block * j + column, -weight);
      }
    }
  }
  for (int k = 0; k < block * num_views; ++k) entries.emplace_back(k, k, 1e-6);
  Matrix matrix(block * num_views, block * num_views);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

template <class Solver>
void BM_Factorize(benchmark::State& state, const std::vector<RelativeRotation>& edges, int block) {
  if (edges.empty()) {
    state.SkipWithError("no such file below the shared data");
    return;
  }
  const Matrix matrix = Laplacian(edges, block);
  Solver solver;
  solver.analyzePattern(matrix);
  for (auto _ : state) solver.factorize(matrix);
  const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(matrix.rows(), -1.0, 1.0);
  state.counters["error"] = (solver.solve(matrix * x) - x).norm() / x.norm();
}

template <class Solver>
void Register(const std::string& name, int block) {
  const auto add = [&](const std::string& graph, const std::vector<RelativeRotation>& edges) {
    benchmark::RegisterBenchmark(
        (name + "/" + graph).c_str(),
        [edges, block](auto& state) { BM_Factorize<Solver>(state, edges, block); })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
  };
  add("sphere2500", FileEdges("sphere2500.g2o"));
  add("garage", FileEdges("parking-garage.g2o"));
  add("city:5000", CityEdges(5000));
  if (block == 1) add("city:100000", CityEdges(100000));
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  using rotslam::Matrix;
  rotslam::Register<Eigen::SimplicialLDLT<Matrix>>("scalar/Eigen", 1);
  rotslam::Register<Eigen::CholmodSimplicialLDLT<Matrix>>("scalar/CHOLMOD_simplicial", 1);
  rotslam::Register<Eigen::CholmodSupernodalLLT<Matrix>>("scalar/CHOLMOD_supernodal", 1);
  rotslam::Register<Eigen::CholmodSimplicialLDLT<Matrix>>("blocks/CHOLMOD_simplicial", 3);
  rotslam::Register<Eigen::CholmodSupernodalLLT<Matrix>>("blocks/CHOLMOD_supernodal", 3);
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
