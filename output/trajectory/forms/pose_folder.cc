// 7-Scenes and ScanNet: a folder with a 4x4 matrix, camera->world, per file; or EuRoC's folder
// with its data.csv.

#include <algorithm>
#include <cmath>

#include "output/trajectory/trajectory.h"
#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct PoseFile {
  double number = 0.0;  // in its name
  fs::path path;
};

bool IsDigitOfName(char c) { return c >= '0' && c <= '9'; }

// frame-000000.pose.txt, 000000.pose.txt, pose_0.txt or 0.txt.
std::optional<PoseFile> AsPoseFile(const fs::path& path) {
  if (path.extension() != ".txt") return std::nullopt;
  const std::string name = path.stem().string();
  const auto last = std::find_if(name.rbegin(), name.rend(), IsDigitOfName);
  if (last == name.rend()) return std::nullopt;
  const bool is_number = std::all_of(name.begin(), name.end(), IsDigitOfName);
  if (!is_number && name.find("pose") == std::string::npos) return std::nullopt;
  const auto first = std::find_if_not(last, name.rend(), IsDigitOfName);
  const std::string digits(first.base(), last.base());
  if (digits.size() > 15) return std::nullopt;
  return PoseFile{std::stod(digits), path};
}

std::vector<PoseFile> PoseFiles(const fs::path& folder) {
  std::vector<PoseFile> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const auto file = AsPoseFile(entry.path());
    if (file) files.push_back(*file);
  }
  std::sort(files.begin(), files.end(), [](const PoseFile& a, const PoseFile& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  return files;
}

bool RecognisesPoseFolder(const TrajectoryInput& input) {
  return input.is_folder && (fs::exists(input.path / "data.csv") || !PoseFiles(input.path).empty());
}

TrajectoryFile ReadPoseFolder(const TrajectoryInput& input, const std::optional<fs::path>& times) {
  const std::vector<PoseFile> files = PoseFiles(input.path);
  if (files.empty()) return ReadTrajectoryFile(input.path / "data.csv", times);
  TrajectoryBuilder builder(input, "folder of pose files");
  std::vector<double> numbers;
  numbers.reserve(files.size());
  for (const PoseFile& file : files) numbers.push_back(file.number);
  std::vector<std::string> notes;
  const std::vector<double> timestamps_s = TimesOfPoses(input, times, numbers, notes);
  for (const std::string& note : notes) builder.Note(note);
  int num_lost = 0;
  std::string first_lost;
  for (std::size_t k = 0; k < files.size(); ++k) {
    std::array<double, 12> pose{};
    std::size_t count = 0;
    bool is_lost = false;
    for (const TextRow& row : ReadTextRows(files[k].path)) {
      for (std::size_t n = 0; n < row.words.size(); ++n, ++count) {
        is_lost |= IsMissingNumber(row.words[n]);
        const double value = is_lost ? 0.0 : NumberAt(files[k].path, row, n);
        if (count < pose.size()) pose[count] = value;
      }
    }
    if (count != 16 && count != 12) {
      throw std::runtime_error(files[k].path.string() +
                               ": expected the 16 numbers of a 4x4 matrix, found " +
                               std::to_string(count));
    }
    Eigen::Matrix3d R;
    R << pose[0], pose[1], pose[2], pose[4], pose[5], pose[6], pose[8], pose[9], pose[10];
    if (is_lost || R.isZero(0.0)) {
      if (num_lost++ == 0) first_lost = files[k].path.filename().string();
      continue;
    }
    try {
      builder.Add(
          1,
          {timestamps_s[k], Rotation::FromMatrix(R), Eigen::Vector3d(pose[3], pose[7], pose[11])});
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(files[k].path.string() + ": " + error.what());
    }
  }
  if (num_lost > 0) {
    builder.Note(std::to_string(num_lost) + " poses left out that are marked as lost, the first " +
                 first_lost);
  }
  TrajectoryFile file = builder.Finish();
  file.has_times = times.has_value();
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormPoseFolder() {
  return {"folder of pose files",
          "a folder with a 4x4 matrix per file (7-Scenes, ScanNet), or with EuRoC's data.csv",
          RecognisesPoseFolder,
          ReadPoseFolder};
}

}  // namespace forms
}  // namespace rotslam
