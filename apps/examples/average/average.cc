// Orientations from relative rotations, wrong ones among them: average GRAPH OUT.g2o
#include <cstdio>
#include <exception>

#include "output/graph/rotation_list_file.h"
#include "rotodom/averaging/certificate.h"
#include "rotodom/averaging/global_averaging.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fprintf(stderr, "usage: average GRAPH OUT.g2o\n");
    return 2;
  }
  // Edges from anywhere else: fill rotslam::RelativeRotation.
  const double sigma_rad = 1.0 * rotslam::kRadFromDeg;  // of edges that do not say
  const rotslam::RotationList list = rotslam::ReadRotationList(argv[1], sigma_rad);
  for (const std::string& note : list.notes) std::fprintf(stderr, "%s\n", note.c_str());

  rotslam::GlobalAveragingProblem problem;
  problem.edges = list.edges;
  problem.use_start = false;  // a tree that cycles confirm, instead of the file's vertices
  const rotslam::GlobalAveragingOptions options;
  const rotslam::GlobalAveragingResult result =
      rotslam::AverageGlobally(problem, options, /*num_threads=*/2);
  std::printf("%zu views, %d of %zu edges agree, cost %.6g after %d iterations\n",
              result.cam_from_world.size(),
              result.num_inliers,
              list.edges.size(),
              result.cost,
              result.iterations);

  // How far from the best of all orientations, for the least squares of the edges that agree.
  std::vector<double> weights;
  for (std::size_t k = 0; k < list.edges.size(); ++k) {
    const bool agrees = result.sigmas[k] <= options.loss_sigmas;
    weights.push_back(agrees ? 3.0 / list.edges[k].covariance.trace() : 0.0);
  }
  const rotslam::AveragingCertificate certificate =
      rotslam::CertifyAveraging(list.edges, weights, result.cam_from_world);
  std::printf("at most %.3g %% above the optimum\n", 100.0 * certificate.RelativeGap());
  rotslam::WriteRotationList(argv[2], list, {result.cam_from_world, {}, {}});
} catch (const std::exception& error) {
  std::fprintf(stderr, "average: %s\n", error.what());
  return 1;
}
