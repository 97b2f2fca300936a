#include "apps/cli/versions.h"

#include <string>
#include <utility>
#include <vector>

#include <ClpConfig.h>
#include <Eigen/Core>
#include <SuiteSparse_config.h>
#include <ceres/version.h>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <pcl/pcl_config.h>
#include <spdlog/version.h>
#include <sqlite3.h>
#ifdef ROTSLAM_WITH_GLPK
#include <glpk.h>
#endif

#include "output/tables/summary.h"

namespace rotslam {
namespace {

template <class... Numbers>
std::string Dotted(int first, Numbers... rest) {
  std::string text = std::to_string(first);
  ((text += "." + std::to_string(rest)), ...);
  return text;
}

std::string Compiler() {
#ifdef __clang__
  return "clang " __clang_version__;
#else
  return "GCC " __VERSION__;
#endif
}

}  // namespace

std::string VersionText() {
  const std::vector<std::pair<std::string, std::string>> parts = {
      {"compiler", Compiler()},
      {"OpenCV", cv::getVersionString()},
      {"Eigen", Dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
      {"Ceres", CERES_VERSION_STRING},
      {"CLP", CLP_VERSION},
#ifdef ROTSLAM_WITH_GLPK
      {"GLPK", glp_version()},
#else
      {"GLPK", "not built in"},
#endif
      {"SuiteSparse",
       Dotted(SUITESPARSE_MAIN_VERSION, SUITESPARSE_SUB_VERSION, SUITESPARSE_SUBSUB_VERSION)},
      {"PCL", PCL_VERSION_PRETTY},
      {"nlohmann_json",
       Dotted(
           NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
      {"SQLite", sqlite3_libversion()},
      {"spdlog", Dotted(SPDLOG_VER_MAJOR, SPDLOG_VER_MINOR, SPDLOG_VER_PATCH)}};
  std::string text = "rotslam " + Version();
  for (const auto& [name, version] : parts) {
    text.append("\n  ").append(name).append(15 - name.size(), ' ').append(version);
  }
  return text;
}

}  // namespace rotslam
