#include "output/ply.h"
#include "output/trajectory.h"

int main(int, char** argv) {
  rotslam::Trajectory trajectory;
  for (int k = 0; k < 4; ++k) {
    trajectory.push_back({0.1 * k, rotslam::Rotation::Exp({0.0, 0.1 * k, 0.0}), {1.0 * k, 0, 0}});
  }
  rotslam::WriteTumTrajectory(argv[1], trajectory);
  rotslam::WritePly(std::string(argv[1]) + ".ply", {rotslam::CloudPoint{}});
}
