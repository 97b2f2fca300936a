// 1DSfM's EGs.txt: i j, a rotation matrix by rows with R = R_i R_j^T, and a translation. The
// cameras are Bundler's: x right, y up, looking along -z.

#include <array>

#include "output/graph/rotation_graph_form.h"

namespace rotslam {
namespace {

constexpr std::size_t kWordsOfOneDSfmLine = 14;

bool RecognisesOneDSfm(const RotationGraphInput& input) {
  return input.first_words.size() == kWordsOfOneDSfmLine && IsWholeNumber(input.first_words[0]) &&
         IsWholeNumber(input.first_words[1]);
}

RotationList ReadOneDSfm(const RotationGraphInput& input, double sigma_rad) {
  const Eigen::Matrix3d covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  RotationGraphBuilder builder(input);
  ForEachGraphLine(input, [&](GraphLine& line) {
    GraphLine peek = line;
    const std::string_view first = peek.Word();
    std::size_t count = 1;
    for (; !peek.AtEnd(); ++count) peek.Word();
    // Names of views are read, other words are not.
    if (!IsNumberWord(first) && (IsGraphTag(first) || count != kWordsOfOneDSfmLine)) {
      builder.Skip(line, first);
      return;
    }
    const std::string i = line.Id();
    const std::string j = line.Id();
    std::array<double, 9> numbers{};
    for (double& number : numbers) number = line.Number();
    while (!line.AtEnd()) line.Number();  // the translation
    builder.AddEdge(line, i, j, RotationOfNine(line, numbers), covariance);
  });
  builder.ChooseReading({{"x_i = R x_j of cameras with y up, as 1DSfM has it", true, false, true},
                         {"x_j = R x_i of cameras with y down", false, false, false}});
  return builder.Finish("1DSfM");
}

}  // namespace

namespace forms {

RotationGraphForm RotationGraphFormOneDsfm() {
  return {"1DSfM",
          "EGs.txt: i j, a 3x3 matrix R_i R_j^T by rows and a translation",
          RecognisesOneDSfm,
          ReadOneDSfm};
}

}  // namespace forms
}  // namespace rotslam
