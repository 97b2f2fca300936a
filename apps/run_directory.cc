#include "apps/run_directory.h"

#include <stdexcept>
#include <system_error>

#include "output/atomic_file.h"
#include "output/g2o.h"
#include "output/trajectory.h"

namespace rotslam {

std::filesystem::path PrepareRunDirectory(const std::string& out) {
  const std::filesystem::path directory = out;
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory)) {
    throw std::runtime_error(out + ": cannot make this folder for the results: " +
                             (error ? error.message() : "a file of that name is in the way"));
  }
  const std::filesystem::path probe = directory / ".write_test";
  ReplaceFile(probe, "");
  std::filesystem::remove(probe, error);
  return directory;
}

void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations) {
  WriteTumTrajectory(directory / "rotations_tum.txt", RotationTrajectory(orientations));
  WriteG2o(directory / "view_graph.g2o", {orientations.graph, orientations.cam_from_world, {}});
}

RunSummary StartSummary(const std::string& command,
                        const Input& input,
                        const Orientations& orientations,
                        std::vector<OptionEntry> options) {
  RunSummary summary;
  summary.command = command;
  summary.options = std::move(options);
  summary.camera = input.camera;
  const auto count = [](std::size_t value) { return static_cast<std::int64_t>(value); };
  summary.sequence = {{"description", input.sequence->Describe()},
                      {"camera_file", input.camera_file},
                      {"first_timestamp_s", orientations.timestamps_s.front()},
                      {"last_timestamp_s", orientations.timestamps_s.back()}};
  summary.counts = {{"frames", count(orientations.timestamps_s.size())},
                    {"unreadable_frames", std::int64_t{orientations.num_unreadable}},
                    {"frames_without_edge", std::int64_t{orientations.num_predicted}},
                    {"frames_with_weak_edge", std::int64_t{orientations.num_weak}},
                    {"edges", count(orientations.graph.edges().size())}};
  double inliers = 0.0;
  std::int64_t rotation_only = 0;
  for (const RelativeRotation& edge : orientations.graph.edges()) {
    inliers += edge.num_inliers;
    rotation_only += edge.rotation_only;
  }
  summary.rotodom = SummaryTable{
      {"mean_inliers_per_edge", inliers / static_cast<double>(orientations.graph.edges().size())},
      {"rotation_only_edges", rotation_only}};
  return summary;
}

}  // namespace rotslam
