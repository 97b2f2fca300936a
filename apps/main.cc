#include <cstdio>
#include <exception>

#include <opencv2/core/utility.hpp>

#include "apps/command.h"

int main(int argc, char** argv) {
  try {
    CLI::App app("rotslam: camera path and sparse map from one calibrated video, rotations first",
                 "rotslam");
    app.require_subcommand(1);
    // Our stages bring their own threads; OpenCV's pool under them only gets in the way.
    cv::setNumThreads(1);
    rotslam::Action action;
    rotslam::AddRunCommand(app, action);
    rotslam::AddRotationsCommand(app, action);
    rotslam::AddEvalCommand(app, action);
    rotslam::AddSimulateCommand(app, action);
    CLI11_PARSE(app, argc, argv);
    return action();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "rotslam: %s\n", error.what());
    return 1;
  }
}
