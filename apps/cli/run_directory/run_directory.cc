#include "apps/cli/run_directory/run_directory.h"

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include <unistd.h>

#include "apps/cli/run_directory/unfinished.h"
#include "output/files/atomic_file.h"

namespace rotslam {

std::filesystem::path PrepareRunDirectory(const std::string& out) {
  if (out.empty()) throw std::runtime_error("--out names no folder for the results");
  std::filesystem::path directory = out;
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error || !std::filesystem::is_directory(directory)) {
    throw std::runtime_error(out + ": cannot make this folder for the results: " +
                             (error ? error.message() : "a file of that name is in the way"));
  }
  if (access(directory.c_str(), W_OK) != 0) {
    throw std::runtime_error(
        out + ": cannot write into this folder: " + std::generic_category().message(errno));
  }
  const std::filesystem::path probe = directory / ".write_test";
  ReplaceFile(probe, "");
  std::filesystem::remove(probe, error);
  ClearUnfinishedOutputs(directory);
  return directory;
}

std::string DescribeInterrupted(const std::filesystem::path& directory,
                                const Orientations& orientations,
                                const Checkpoint& checkpoint) {
  return "interrupted after " + std::to_string(orientations.timestamps_s.size()) +
         " frames; their orientations are in " + directory.string() +
         ": rotations_tum.txt, rotations.csv, loops.csv, view_graph.g2o, summary.json" +
         (checkpoint.IsOn() ? "; --resume goes on from here" : "");
}

}  // namespace rotslam
