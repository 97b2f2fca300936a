// GLOMAP's relative poses: name name qw qx qy qz tx ty tz, x_2 = R x_1 + t.

#include <array>
#include <cmath>

#include "output/graph/rotation_graph_form.h"
#include "output/trajectory/unit_length.h"

namespace rotslam {
namespace {

bool RecognisesRelpose(const RotationGraphInput& input) {
  const std::vector<std::string>& words = input.first_words;
  if (words.size() != 9 || IsGraphTag(words[0])) {
    return false;
  }
  for (std::size_t k = 2; k < words.size(); ++k) {
    if (!IsNumberWord(words[k])) return false;
  }
  return true;
}

RotationList ReadRelpose(const RotationGraphInput& input, double sigma_rad) {
  const Eigen::Matrix3d covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  RotationGraphBuilder builder(input);
  int num_header_lines = 0;
  ForEachGraphLine(input, [&](GraphLine& line) {
    GraphLine peek = line;
    const bool has_tag = IsGraphTag(peek.Word());
    if (has_tag || peek.AtEnd() || (num_header_lines == 0 && !peek.AtEnd() && [&] {
          while (!peek.AtEnd()) {
            if (IsNumberWord(peek.Word())) return false;
          }
          return true;
        }())) {
      ++num_header_lines;
      GraphLine tag = line;
      builder.Skip(line, tag.Word());
      return;
    }
    const std::string i(line.Word());
    const std::string j(line.Word());
    std::array<double, 7> v{};
    for (double& number : v) number = line.Number();
    if (!line.AtEnd()) line.Fail("expected name name qw qx qy qz tx ty tz, found more numbers");
    const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
    if (!IsUnitLength(length)) {
      line.Fail(
          "expected a unit quaternion qw qx qy qz behind the names, found one of another "
          "length");
    }
    // Kept as the readings below expect it: the first number in the place of x.
    builder.AddEdge(line, i, j, Rotation(Eigen::Quaterniond(v[3], v[0], v[1], v[2])), covariance);
  });
  builder.ChooseReading({{"x_2 = R x_1, qw first", false, true, false},
                         {"x_1 = R x_2, qw first", true, true, false},
                         {"x_2 = R x_1, qw last", false, false, false},
                         {"x_1 = R x_2, qw last", true, false, false}});
  return builder.Finish("GLOMAP relative poses");
}

}  // namespace

namespace forms {

RotationGraphForm RotationGraphFormRelpose() {
  return {
      "GLOMAP relative poses", "name name qw qx qy qz tx ty tz", RecognisesRelpose, ReadRelpose};
}

}  // namespace forms
}  // namespace rotslam
