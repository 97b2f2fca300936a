#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "output/graph/rotation_cycles.h"
#include "output/graph/rotation_list.h"

namespace rotslam {

/// A file of relative rotations before its form is known.
struct RotationGraphInput {
  std::filesystem::path path;
  std::string text;                      // with points in place of decimal commas
  std::vector<std::string> first_words;  // of the first line that is neither empty nor a comment
  std::vector<std::string> notes;
};

/// One form of files with relative rotations. A new form is one file in output/graph/forms.
struct RotationGraphForm {
  std::string name;         // "g2o"
  std::string description;  // one line for the documentation and --help
  /// Looks at the first line; at most one form recognises an input.
  bool (*recognises)(const RotationGraphInput& input);
  /// @param sigma_rad  of edges whose lines say none.
  /// Throws std::runtime_error with file, line and reason.
  RotationList (*read)(const RotationGraphInput& input, double sigma_rad);
};

/// All forms, by the names of their files.
const std::vector<RotationGraphForm>& RotationGraphForms();

/// Throws std::runtime_error when the file cannot be read.
RotationGraphInput ReadRotationGraphInput(const std::filesystem::path& path);

bool IsWholeNumber(std::string_view word);
bool IsNumberWord(std::string_view word);
/// A word that stands in front of the lines of g2o and TORO.
bool IsGraphTag(std::string_view word);

/// The words of one line, taken one by one; blanks and commas separate them.
class GraphLine {
 public:
  GraphLine(const std::filesystem::path& path, int number, std::string_view text);
  bool AtEnd() const { return rest_.empty(); }
  bool IsComment() const { return rest_.front() == '#'; }
  int number() const { return number_; }
  std::string_view Word();
  double Number();
  /// A whole number as it is written without signs and zeros that say nothing, or a name.
  std::string Id();
  /// Of x y z w, unit; throws where it is none.
  Rotation Quaternion();
  [[noreturn]] void Fail(const std::string& reason) const;

 private:
  void Skip();

  const std::filesystem::path* path_;
  int number_;
  std::string_view rest_;
};

/// Calls `take` for every line that is neither empty nor a comment.
template <class Take>
void ForEachGraphLine(const RotationGraphInput& input, Take&& take) {
  const std::string_view text = input.text;
  int number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    GraphLine line(input.path, ++number, text.substr(begin, end - begin));
    begin = end + 1;
    if (!line.AtEnd() && !line.IsComment()) take(line);
  }
}

/// Collects edges and vertices, whose ids it numbers.
class RotationGraphBuilder {
 public:
  explicit RotationGraphBuilder(const RotationGraphInput& input);
  /// Throws where both ends are the same view.
  void AddEdge(const GraphLine& line,
               const std::string& i,
               const std::string& j,
               const Rotation& j_from_i,
               const Eigen::Matrix3d& covariance);
  /// The numbers of the last edge beside its rotation.
  void AddTranslation(const EdgeTranslation& translation);
  void AddVertex(const std::string& id,
                 const Rotation& cam_from_world,
                 const Eigen::Vector3d& center_in_world);
  void Fix(const std::string& id) { fixed_.push_back(id); }
  /// A line that is not read, under the word in front.
  void Skip(const GraphLine& line, std::string_view tag);
  void Note(std::string note) { list_.notes.push_back(std::move(note)); }
  /// Edges in the reading that their cycles tell.
  void ChooseReading(const std::vector<EdgeReading>& readings);
  /// Ids ascending, numbers before names. Throws std::runtime_error without edges.
  RotationList Finish(const std::string& form);

 private:
  struct Skipped {
    int count = 0;
    std::vector<int> lines;  // the first of them
  };
  std::string UnreadLines() const;
  int ViewOf(const std::string& id);

  std::filesystem::path path_;
  RotationList list_;
  std::unordered_map<std::string, int> views_;
  std::vector<std::string> fixed_;
  std::map<std::string, Skipped, std::less<>> skipped_;
};

/// g2o's and TORO's lines.
RotationList ReadPoseGraphLines(const RotationGraphInput& input,
                                double sigma_rad,
                                const std::string& form);

/// Orientations by id: vertices of a pose graph, or lines `id qx qy qz qw` with or without numbers
/// behind (cam_from_world).
std::map<std::string, Rotation> ReadOrientationLines(const RotationGraphInput& input);

/// Nine numbers by rows; throws std::runtime_error through `line` where they are no rotation.
Rotation RotationOfNine(const GraphLine& line, const std::array<double, 9>& numbers);

}  // namespace rotslam
