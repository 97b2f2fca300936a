#include "apps/cli/run_directory/unfinished.h"

#include <array>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr const char* kSummary = "summary.json";

// All that `run`, `rotations` and `solve` write, but for the summary.
constexpr std::array kOutputs = {"cameras.ply",
                                 "camera.yaml",
                                 "cloud.ply",
                                 "focal_lengths.csv",
                                 "keyframes_tum.txt",
                                 "known_rotation.txt",
                                 "live_trajectory_tum.txt",
                                 "loops.csv",
                                 "map.bin",
                                 "map_all_frames.bin",
                                 "matches.bin",
                                 "mask.png",
                                 "pose_covariance.csv",
                                 "poses.csv",
                                 "removed.csv",
                                 "report.html",
                                 "residuals.csv",
                                 "rotations.csv",
                                 "rotations_tum.txt",
                                 "segments.csv",
                                 "thumbnails.bin",
                                 "trajectory_kitti.txt",
                                 "trajectory_tum.txt",
                                 "view_graph.g2o",
                                 "views.csv"};

fs::path OutputsFolder(const fs::path& run) { return UnfinishedFolder(run) / "outputs"; }
// The same once they are being moved.
fs::path MovingFolder(const fs::path& run) { return UnfinishedFolder(run) / "moving"; }

void Check(const fs::path& path, const std::error_code& error) {
  if (!error) return;
  throw std::runtime_error(path.string() + ": cannot replace the file: " + error.message());
}

void Move(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  Check(to, error);
}

void RemoveFile(const fs::path& path) {
  // A folder of that name is none of ours.
  if (fs::is_directory(path)) Check(path, std::make_error_code(std::errc::is_a_directory));
  std::error_code error;
  fs::remove(path, error);
  Check(path, error);
}

void MoveOutputs(const fs::path& run) {
  const fs::path folder = MovingFolder(run);
  for (const char* name : kOutputs) {
    if (fs::exists(folder / name)) Move(folder / name, run / name);
  }
  if (fs::exists(folder / kSummary)) Move(folder / kSummary, run / kSummary);
  std::error_code error;
  fs::remove(folder, error);
  fs::remove(UnfinishedFolder(run), error);  // a checkpoint keeps it
}

void PublishOutputs(const fs::path& run) {
  const fs::path folder = OutputsFolder(run);
  RemoveFile(run / kSummary);
  for (const char* name : kOutputs) {
    if (!fs::exists(folder / name)) RemoveFile(run / name);
  }
  Move(folder, MovingFolder(run));
  MoveOutputs(run);
}

}  // namespace

fs::path UnfinishedFolder(const fs::path& run) { return run / "unfinished"; }

UnfinishedOutputs::UnfinishedOutputs(fs::path run)
    : run_(std::move(run)), folder_(OutputsFolder(run_)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (!error) return;
  throw std::runtime_error(folder_.string() + ": cannot make this folder: " + error.message());
}

void UnfinishedOutputs::Publish() const { PublishOutputs(run_); }

void ClearUnfinishedOutputs(const fs::path& run) {
  if (fs::exists(MovingFolder(run))) MoveOutputs(run);
  const fs::path folder = OutputsFolder(run);
  if (fs::exists(folder / kSummary)) PublishOutputs(run);
  std::error_code error;
  fs::remove_all(folder, error);
  fs::remove(UnfinishedFolder(run), error);
}

}  // namespace rotslam
