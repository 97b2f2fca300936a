// A header that names the columns: rotations.csv and tables of other programs.

#include "output/trajectory/trajectory_form.h"

namespace rotslam {
namespace {

bool RecognisesNamedColumns(const TrajectoryInput& input) {
  const std::size_t count = input.NumColumns();
  const auto named = NamedPoseColumns(input.columns);
  if (!named || count < 5 || count == 9) return false;
  const bool has_w_first = named->quaternion[3] < named->quaternion[0];
  const bool is_euroc = named->position[0] >= 0 && has_w_first && (count == 8 || count == 17);
  const bool is_tum = count == 8 && !has_w_first;
  return !is_euroc && !is_tum;
}

TrajectoryFile ReadNamedColumns(const TrajectoryInput& input,
                                const std::optional<std::filesystem::path>&) {
  const PoseColumns columns = *NamedPoseColumns(input.columns);
  TrajectoryFile file = ReadPoseColumns(
      input, columns, input.columns.front() == "frame" ? "rotations.csv" : "columns by name");
  if (columns.position[0] < 0) file.notes.push_back("it has no positions");
  return file;
}

}  // namespace

namespace forms {

TrajectoryForm TrajectoryFormNamedColumns() {
  return {"columns by name",
          "a first line that names timestamp, qx, qy, qz and qw (rotations.csv)",
          RecognisesNamedColumns,
          ReadNamedColumns};
}

}  // namespace forms
}  // namespace rotslam
