// Lines of two ids and a quaternion or a rotation matrix.

#include <array>

#include "output/graph/rotation_graph_form.h"
#include "output/trajectory/unit_length.h"

namespace rotslam {
namespace {

constexpr std::size_t kWordsOfOneDSfm = 14;
constexpr std::size_t kWordsOfRelpose = 9;

bool RecognisesPlainList(const RotationGraphInput& input) {
  const std::size_t count = input.first_words.size();
  if (count < 3 || count == kWordsOfOneDSfm || count == kWordsOfRelpose) return false;
  const std::string& first = input.first_words.front();
  const bool has_tag = first.starts_with("VERTEX") || first.starts_with("EDGE") ||
                       first.starts_with("PARAMS") || first == "FIX";
  if (has_tag) return false;
  return IsWholeNumber(first) || count == 6 || count == 11;
}

RotationList ReadPlainList(const RotationGraphInput& input, double sigma_rad) {
  const Eigen::Matrix3d covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  const bool has_numbers = IsWholeNumber(input.first_words.front());
  RotationGraphBuilder builder(input);
  bool has_quaternions = false;
  bool has_matrices = false;
  int num_longer = 0;
  ForEachGraphLine(input, [&](GraphLine& line) {
    GraphLine peek = line;
    const std::string_view first = peek.Word();
    if (has_numbers && !IsNumberWord(first)) {
      builder.Skip(line, first);
      return;
    }
    const std::string i = has_numbers ? line.Id() : std::string(line.Word());
    const std::string j = has_numbers ? line.Id() : std::string(line.Word());
    std::array<double, 9> numbers{};
    std::size_t count = 0;
    while (!line.AtEnd() && count < numbers.size()) numbers[count++] = line.Number();
    GraphLine rest = line;
    while (!rest.AtEnd()) rest.Number();
    if (!line.AtEnd()) ++num_longer;
    Rotation rotation;
    if (count == 4) {
      const Eigen::Quaterniond q(numbers[3], numbers[0], numbers[1], numbers[2]);
      if (!IsUnitLength(q.norm())) line.Fail("the quaternion is not of unit length");
      rotation = Rotation(q);
      has_quaternions = true;
    } else if (count == 9) {
      rotation = RotationOfNine(line, numbers);
      has_matrices = true;
    } else {
      line.Fail("expected i j and a quaternion or the nine numbers of a rotation matrix, found " +
                std::to_string(count) + " numbers behind the ids");
    }
    builder.AddEdge(line, i, j, rotation, covariance);
  });
  if (num_longer > 0) {
    builder.Note("the numbers behind the rotation are not used (" + std::to_string(num_longer) +
                 (num_longer == 1 ? " line)" : " lines)"));
  }
  std::vector<EdgeReading> readings = {{"x_j = R x_i", false, false, false},
                                       {"x_i = R x_j", true, false, false}};
  if (has_quaternions && !has_matrices) {
    readings.push_back({"x_j = R x_i with qw first", false, true, false});
    readings.push_back({"x_i = R x_j with qw first", true, true, false});
  }
  builder.ChooseReading(readings);
  return builder.Finish("list of rotations");
}

}  // namespace

namespace forms {

RotationGraphForm RotationGraphFormPlainList() {
  return {
      "list of rotations",
      "i j qx qy qz qw, or i j and a 3x3 matrix by rows; x_j = R x_i unless cycles say otherwise",
      RecognisesPlainList,
      ReadPlainList};
}

}  // namespace forms
}  // namespace rotslam
