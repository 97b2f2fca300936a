#include <cstdio>
#include <string>

#include "apps/slam/build_map.h"
#include "ba/bundle_adjustment.h"
#include "krot/known_rotation.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/averaging/averaging.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/view_graph/estimate_edges.h"

// One entry of each stage, so that the linker must find all it uses.
template <class Function>
void Need(const char* name, Function* function) {
  std::printf("%s at %p\n", name, reinterpret_cast<void*>(function));
}

int main(int, char** argv) {
  Need("AverageRotations", &rotslam::AverageRotations);
  Need("EstimateEdges", &rotslam::EstimateEdges);
  Need("OpenSequence", &rotslam::OpenSequence);
  Need("SolveKnownRotation", &rotslam::SolveKnownRotation);
  Need("RefineBundle", &rotslam::RefineBundle);
  Need("BuildMap", &rotslam::BuildMap);

  rotslam::Trajectory trajectory;
  for (int k = 0; k < 4; ++k) {
    trajectory.push_back({0.1 * k, rotslam::Rotation::Exp({0.0, 0.1 * k, 0.0}), {1.0 * k, 0, 0}});
  }
  rotslam::WriteTumTrajectory(argv[1], trajectory);
  rotslam::WritePly(std::string(argv[1]) + ".ply", {rotslam::CloudPoint{}});
}
