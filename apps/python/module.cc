#include "apps/python/module.h"

#include <opencv2/core.hpp>

#include "output/tables/summary.h"

PYBIND11_MODULE(rotslam, module) {
  module.doc() =
      "Known-rotation monocular SLAM: the whole system, orientations frame by frame, averaging, "
      "positions from known rotations, bundle adjustment, readers, evaluation.";
  module.attr("__version__") = rotslam::Version();
  // Our stages bring their own threads.
  cv::setNumThreads(1);
  rotslam::AddCamera(module);
  rotslam::AddSequence(module);
  rotslam::AddOdometry(module);
  rotslam::AddAveraging(module);
  rotslam::AddKnownRotation(module);
  rotslam::AddBundle(module);
  rotslam::AddReaders(module);
  rotslam::AddMapReaders(module);
  rotslam::AddSlam(module);
  rotslam::AddLiveSlam(module);
  rotslam::AddEvaluation(module);
}
