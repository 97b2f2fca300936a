// EuRoC and TUM-VI: timestamp [ns], position, quaternion with q_w first; 17 columns have
// velocities and biases besides.

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

bool HasLongWholeTimes(const TrajectoryInput& input) {
  const std::string& word = input.rows.front().words.front();
  return word.size() >= 18 && word.find_first_not_of("0123456789") == std::string::npos;
}

bool RecognisesEuroc(const TrajectoryInput& input) {
  const std::size_t count = input.NumColumns();
  const auto named = NamedPoseColumns(input.columns);
  if (named) {
    return named->position[0] >= 0 && named->quaternion[3] < named->quaternion[0] &&
           (count == 8 || count == 17);
  }
  if (input.is_folder || !input.has_commas) return false;
  if (count != 17 && count != 8) return false;
  return HasLongWholeTimes(input);
}

TrajectoryFile ReadEuroc(const TrajectoryInput& input,
                         const std::optional<std::filesystem::path>&) {
  const auto named = NamedPoseColumns(input.columns);
  const PoseColumns columns = named ? *named : PoseColumns{0, {1, 2, 3}, {5, 6, 7, 4}};
  TrajectoryInput timed = input;
  timed.is_in_nanoseconds = timed.is_in_nanoseconds || HasLongWholeTimes(input);
  TrajectoryFile file = ReadPoseColumns(timed, columns, "EuRoC");
  if (input.NumColumns() == 17) file.notes.push_back("its velocities and biases are not used");
  if (!named) {
    file.notes.push_back("no header names its columns; taken for EuRoC's, with q_w first");
    file.is_order_assumed = input.NumColumns() == 8;
  }
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormEuroc() {
  return {"EuRoC",
          "timestamp [ns], p x y z, q w x y z, with velocities and biases or without",
          RecognisesEuroc,
          ReadEuroc};
}

}  // namespace forms
}  // namespace rotslam
