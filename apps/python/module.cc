#include "apps/python/module.h"

#include <opencv2/core.hpp>

#include "output/tables/summary.h"

PYBIND11_MODULE(rotslam, module) {
  module.doc() =
      "Known-rotation monocular SLAM: the whole system, orientations frame by frame, positions "
      "from "
      "known rotations, evaluation.";
  module.attr("__version__") = rotslam::Version();
  // Our stages bring their own threads.
  cv::setNumThreads(1);
  rotslam::AddCamera(module);
  rotslam::AddSequence(module);
  rotslam::AddOdometry(module);
  rotslam::AddKnownRotation(module);
  rotslam::AddSlam(module);
  rotslam::AddEvaluation(module);
}
