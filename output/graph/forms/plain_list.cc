// Lines of two ids and a quaternion or a rotation matrix.

#include <array>
#include <cmath>
#include <optional>
#include <string>

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
  if (IsGraphTag(first)) return false;
  return IsWholeNumber(first) || count == 6 || count == 7 || count == 11;
}

// In a list of numbered views, a line that begins with a word is an edge when two ids and the
// numbers of a rotation stand in it.
bool IsEdgeOfNames(GraphLine line) {
  if (IsGraphTag(line.Word()) || line.AtEnd()) return false;
  line.Word();
  std::size_t count = 0;
  for (; !line.AtEnd(); ++count) {
    if (!IsNumberWord(line.Word())) return false;
  }
  return count == 4 || count == 5 || count >= 9;
}

// The rotation of an edge, from the numbers behind its ids.
struct PlainRotation {
  Rotation rotation;
  std::optional<double> sigma_rad;
  bool is_quaternion = false;
  bool is_longer = false;  // there are more numbers, which are not used
};

PlainRotation ReadRotation(GraphLine& line) {
  std::array<double, 9> numbers{};
  std::size_t count = 0;
  while (!line.AtEnd() && count < numbers.size()) numbers[count++] = line.Number();
  GraphLine rest = line;
  while (!rest.AtEnd()) rest.Number();
  PlainRotation read;
  read.is_longer = !line.AtEnd();
  if (count == 4 || count == 5) {
    const Eigen::Quaterniond q(numbers[3], numbers[0], numbers[1], numbers[2]);
    if (!IsUnitLength(q.norm())) line.Fail("the quaternion is not of unit length");
    read.rotation = Rotation(q);
    read.is_quaternion = true;
    if (count == 5) {
      const double sigma_rad = numbers[4] * kRadFromDeg;
      if (!(sigma_rad > 0.0 && sigma_rad * sigma_rad > 0.0) ||
          !std::isfinite(sigma_rad * sigma_rad)) {
        line.Fail("expected a standard deviation in deg above zero behind the quaternion");
      }
      read.sigma_rad = sigma_rad;
    }
  } else if (count == 9) {
    read.rotation = RotationOfNine(line, numbers);
  } else {
    line.Fail("expected i j and a quaternion or the nine numbers of a rotation matrix, found " +
              std::to_string(count) + " numbers behind the ids");
  }
  return read;
}

std::string LinesText(int count) {
  return " (" + std::to_string(count) + (count == 1 ? " line)" : " lines)");
}

RotationList ReadPlainList(const RotationGraphInput& input, double sigma_rad) {
  const bool has_numbers = IsWholeNumber(input.first_words.front());
  RotationGraphBuilder builder(input);
  bool has_quaternions = false;
  bool has_matrices = false;
  int num_longer = 0;
  int num_sigmas = 0;
  ForEachGraphLine(input, [&](GraphLine& line) {
    GraphLine peek = line;
    const std::string_view first = peek.Word();
    if (IsGraphTag(first) || (has_numbers && !IsNumberWord(first) && !IsEdgeOfNames(line))) {
      builder.Skip(line, first);
      return;
    }
    // In a list of names a decimal number, a time for one, is a name.
    const auto take_id = [&] {
      GraphLine next = line;
      const std::string_view word = next.Word();
      if (has_numbers || IsWholeNumber(word)) return line.Id();
      return std::string(line.Word());
    };
    const std::string i = take_id();
    const std::string j = take_id();
    const PlainRotation read = ReadRotation(line);
    const double sigma = read.sigma_rad.value_or(sigma_rad);
    builder.AddEdge(line, i, j, read.rotation, sigma * sigma * Eigen::Matrix3d::Identity());
    (read.is_quaternion ? has_quaternions : has_matrices) = true;
    num_longer += read.is_longer ? 1 : 0;
    num_sigmas += read.sigma_rad ? 1 : 0;
  });
  if (num_longer > 0) {
    builder.Note("the numbers behind the rotation are not used" + LinesText(num_longer));
  }
  if (num_sigmas > 0) {
    builder.Note("the fifth number behind the ids is the edge's standard deviation in deg" +
                 LinesText(num_sigmas));
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
      "i j qx qy qz qw [sigma_deg], or i j and a 3x3 matrix by rows; x_j = R x_i unless cycles say "
      "otherwise",
      RecognisesPlainList,
      ReadPlainList};
}

}  // namespace forms
}  // namespace rotslam
