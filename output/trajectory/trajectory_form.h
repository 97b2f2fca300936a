#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "output/trajectory/trajectory_file.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

/// A file of poses, cut into lines and words, before its form is known.
struct TrajectoryInput {
  std::filesystem::path path;
  bool is_folder = false;  // then the rest is empty
  // Names in the header, lower case and without units; empty where no line names every column.
  std::vector<std::string> columns;
  bool is_in_nanoseconds = false;  // the header says so of the times
  bool has_commas = false;         // between the numbers
  std::vector<TextRow> rows;       // words of numbers, or "nan" and the like
  std::vector<std::string> notes;  // what was assumed so far

  // The first word that is no number though no header names its column; empty without one.
  std::string odd_word;

  std::size_t NumColumns() const { return rows.empty() ? 0 : rows.front().words.size(); }
};

/// One form of trajectory files. A new form is one file in output/trajectory_forms.
struct TrajectoryForm {
  std::string name;         // "TUM"
  std::string description;  // one line for the documentation and --help
  /// Cheap; at most one form recognises an input.
  bool (*recognises)(const TrajectoryInput& input);
  /// Throws std::runtime_error with file, line and reason.
  TrajectoryFile (*read)(const TrajectoryInput& input,
                         const std::optional<std::filesystem::path>& times);
};

/// All forms, by the names of their files.
const std::vector<TrajectoryForm>& TrajectoryForms();

/// Cuts a file up; a folder is only named. Throws std::runtime_error when it cannot be read.
TrajectoryInput ReadTrajectoryInput(const std::filesystem::path& path);

/// Whether a word stands for a number that is not there: "nan", "-inf", "null".
bool IsMissingNumber(const std::string& word);

/// The columns of a pose in a line. Without positions these are -1.
struct PoseColumns {
  int time = 0;
  std::array<int, 3> position = {1, 2, 3};
  std::array<int, 4> quaternion = {4, 5, 6, 7};  // of qx qy qz qw
};

/// The columns by their names; nullopt where a time or a part of the quaternion has none.
std::optional<PoseColumns> NamedPoseColumns(const std::vector<std::string>& columns);

/// Makes a trajectory pose by pose; leaves out what a system has lost and what is there twice.
class TrajectoryBuilder {
 public:
  TrajectoryBuilder(const TrajectoryInput& input, std::string form);
  /// A pose with the line that it comes from.
  void Add(int line, const StampedPose& pose);
  void Add(const TextRow& row,
           double timestamp_s,
           const Eigen::Vector3d& center,
           const Eigen::Vector4d& qx_qy_qz_qw);
  /// @param numbers  a row-major 3x4 matrix.
  void Add(int line, double timestamp_s, const std::array<double, 12>& numbers);
  void AddLost(int line);
  void Note(std::string note) { file_.notes.push_back(std::move(note)); }
  /// Sorted by time. Throws std::runtime_error when no pose is left.
  TrajectoryFile Finish();

 private:
  std::filesystem::path path_;
  TrajectoryFile file_;
  std::vector<std::pair<double, int>> lines_;  // by time, of each pose
  int num_lost_ = 0;
  int first_lost_line_ = 0;
  int num_scaled_ = 0;
};

/// Reads lines whose columns are known. Lines must have as many words as the first.
TrajectoryFile ReadPoseColumns(const TrajectoryInput& input,
                               const PoseColumns& columns,
                               const std::string& form);

/// The numbers of one column in seconds. Times since 1970 in ns, us or ms are told by their size,
/// others by their spacing; `note` says which.
std::vector<double> SecondsIn(const std::filesystem::path& path,
                              const std::vector<TextRow>& rows,
                              std::size_t column,
                              bool is_in_nanoseconds,
                              std::string& note);

/// Times of poses that have none of their own: those of the file, else the numbers themselves.
/// @param numbers  of the poses, 0 being the file's first time.
/// Throws std::runtime_error when the file has too few.
std::vector<double> TimesOfPoses(const TrajectoryInput& input,
                                 const std::optional<std::filesystem::path>& times,
                                 const std::vector<double>& numbers,
                                 std::vector<std::string>& notes);

}  // namespace rotslam
