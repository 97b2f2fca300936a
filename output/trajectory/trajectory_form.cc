#include "output/trajectory/trajectory_form.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "output/files/decimal_commas.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

constexpr double kSecondsPerNanosecond = 1e-9;

std::string LowerCase(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

std::vector<std::string> CutAt(std::string_view separators, std::string_view line) {
  std::vector<std::string> words;
  std::size_t begin = line.find_first_not_of(separators);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(line.find_first_of(separators, begin), line.size());
    words.emplace_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(separators, end);
  }
  return words;
}

bool IsNumber(const std::string& word) {
  if (IsMissingNumber(word)) return true;
  const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
  double value = 0.0;
  const auto [stop, code] = std::from_chars(begin, word.data() + word.size(), value);
  return code != std::errc::invalid_argument && stop == word.data() + word.size();
}

// The names in a header, without a leading '#' and units in brackets.
std::vector<std::string> HeaderNames(std::string header) {
  header = LowerCase(std::move(header));
  for (std::size_t open = header.find('['); open != std::string::npos; open = header.find('[')) {
    const std::size_t close = std::min(header.find(']', open), header.size() - 1);
    header.erase(open, close - open + 1);
  }
  const bool has_commas = header.find_first_of(",;") != std::string::npos;
  std::vector<std::string> names;
  for (const std::string& cell : CutAt(has_commas ? ",;" : " \t", header)) {
    std::string name;
    for (const char c : cell) {
      if (c != ' ' && c != '\t' && c != '#' && c != '"' && c != '%') name += c;
    }
    if (!name.empty()) names.push_back(name);
  }
  return names;
}

void TakeHeader(const std::string& header, TrajectoryInput& input) {
  std::vector<std::string> names = HeaderNames(header);
  if (!NamedPoseColumns(names)) return;
  input.is_in_nanoseconds = LowerCase(header).find("[ns]") != std::string::npos;
  input.columns = std::move(names);
}

// Integers exactly, as far as a double goes.
double Seconds(const std::filesystem::path& path,
               const TextRow& row,
               std::size_t column,
               double unit_s) {
  const std::string& word = row.words.at(column);
  std::int64_t whole = 0;
  const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), whole);
  const bool is_whole = code == std::errc() && stop == word.data() + word.size();
  if (is_whole && unit_s == kSecondsPerNanosecond) {
    constexpr std::int64_t kPerSecond = 1000000000;
    const std::int64_t seconds = whole / kPerSecond;
    return static_cast<double>(seconds) + unit_s * static_cast<double>(whole % kPerSecond);
  }
  return unit_s == 1.0 ? NumberAt(path, row, column) : NumberAt(path, row, column) * unit_s;
}

struct TimeUnit {
  double seconds = 1.0;
  const char* name = "s";
};

TimeUnit UnitOf(const std::vector<double>& times) {
  double largest = 0.0;
  std::vector<double> steps;
  for (std::size_t k = 0; k < times.size(); ++k) {
    largest = std::max(largest, std::abs(times[k]));
    if (k > 0) steps.push_back(std::abs(times[k] - times[k - 1]));
  }
  const double step = Median(std::move(steps));
  // Seconds since 1970 are some 1e9 in our time.
  if (largest >= 1e17) return {1e-9, "ns"};
  if (largest >= 1e14) return {1e-6, "us"};
  if (largest >= 1e11 && step < 1e6) return {1e-3, "ms"};
  // Times since a device was switched on: no two frames are a quarter of an hour apart.
  if (step >= 1e6) return {1e-9, "ns"};
  if (step >= 1e3) return {1e-6, "us"};
  return {};
}

std::string Plural(int count, const std::string& word) {
  return std::to_string(count) + " " + word + (count == 1 ? "" : "s");
}

bool HasMissing(const TextRow& row, const PoseColumns& columns) {
  const auto is_missing = [&](int column) {
    return column >= 0 && IsMissingNumber(row.words[static_cast<std::size_t>(column)]);
  };
  return std::any_of(columns.position.begin(), columns.position.end(), is_missing) ||
         std::any_of(columns.quaternion.begin(), columns.quaternion.end(), is_missing);
}

// Refuses columns of which most are no quaternion, and says which are.
void RequireQuaternions(const TrajectoryInput& input, const PoseColumns& columns) {
  const auto share_of_units = [&](const std::array<int, 4>& quaternion) {
    int num_units = 0;
    int num_rows = 0;
    for (const TextRow& row : input.rows) {
      if (HasMissing(row, columns)) continue;
      Eigen::Vector4d q;
      for (int k = 0; k < 4; ++k) {
        q[k] = NumberAt(input.path, row, static_cast<std::size_t>(quaternion[k]));
      }
      if (q.norm() == 0.0) continue;
      ++num_rows;
      num_units += IsUnitLength(q.norm()) ? 1 : 0;
    }
    return num_rows == 0 ? 1.0 : static_cast<double>(num_units) / num_rows;
  };
  if (share_of_units(columns.quaternion) >= 0.5) return;
  std::string reason = "columns " + std::to_string(columns.quaternion[0] + 1) + " to " +
                       std::to_string(columns.quaternion[3] + 1) +
                       " are no quaternions of length 1";
  const int num_columns = static_cast<int>(input.NumColumns());
  for (int first = 0; first + 4 <= num_columns; ++first) {
    bool has_missing = false;
    for (const TextRow& row : input.rows) {
      for (int k = first; k < first + 4; ++k) {
        has_missing |= IsMissingNumber(row.words[static_cast<std::size_t>(k)]);
      }
    }
    if (has_missing || share_of_units({first, first + 1, first + 2, first + 3}) < 0.9) continue;
    reason += ", columns " + std::to_string(first + 1) + " to " + std::to_string(first + 4) +
              " are: name them in a first line";
    break;
  }
  throw std::runtime_error(AtLine(
      input.path, input.rows.front().line, reason + "; expected timestamp tx ty tz qx qy qz qw"));
}

}  // namespace

bool IsMissingNumber(const std::string& word) {
  if (word.size() < 3 || word.size() > 10) return false;
  std::string name = LowerCase(word);
  if (name.front() == '-' || name.front() == '+') name.erase(0, 1);
  return name == "nan" || name == "inf" || name == "infinity" || name == "null" || name == "none" ||
         name == "nan(ind)";
}

TrajectoryInput ReadTrajectoryInput(const std::filesystem::path& path) {
  TrajectoryInput input;
  input.path = path;
  if (std::filesystem::is_directory(path)) {
    input.is_folder = true;
    return input;
  }
  std::string text = ReadText(path);
  if (HasDecimalCommas(text)) {
    text = WithDecimalPoints(std::move(text));
    input.notes.push_back("its commas are taken for decimal points");
  }
  std::istringstream file(std::move(text));
  std::string line;
  std::string header;
  for (int number = 1; std::getline(file, line); ++number) {
    std::vector<std::string> words = CutAt(" \t\r,;", line);
    if (words.empty()) continue;
    const bool is_comment = words.front().front() == '#' || words.front().front() == '%';
    if (input.rows.empty() && (is_comment || std::none_of(words.begin(), words.end(), IsNumber))) {
      header = line;
      if (!is_comment && !NamedPoseColumns(HeaderNames(header))) {
        input.notes.push_back("line " + std::to_string(number) + " is taken for a header");
      }
      continue;
    }
    if (is_comment) continue;
    if (input.rows.empty()) {
      input.has_commas = line.find_first_of(",;") != std::string::npos;
      TakeHeader(header, input);
    }
    input.rows.push_back({number, std::move(words)});
  }
  const bool names_every_column =
      input.columns.size() == input.NumColumns() || input.columns.size() > 9;
  if (!names_every_column) input.columns.clear();
  if (input.columns.empty() && !input.rows.empty()) {
    const std::vector<std::string>& words = input.rows.front().words;
    const auto odd = std::find_if_not(words.begin(), words.end(), IsNumber);
    if (odd != words.end()) input.odd_word = *odd;
  }
  return input;
}

std::optional<PoseColumns> NamedPoseColumns(const std::vector<std::string>& columns) {
  constexpr std::string_view kAxes = "xyzw";
  PoseColumns found{-1, {-1, -1, -1}, {-1, -1, -1, -1}};
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const std::string& name = columns[k];
    const int column = static_cast<int>(k);
    const bool is_time = name.starts_with("time") || name == "t" || name.starts_with("stamp") ||
                         name == "sec" || name == "seconds";
    if (is_time && found.time < 0) {
      found.time = column;
      continue;
    }
    const std::size_t axis = kAxes.find(name.back());
    if (axis == std::string_view::npos) continue;
    const bool is_rotation = name.starts_with("q") || name.starts_with("rot") ||
                             name.find("orient") != std::string::npos;
    const bool is_position = name.starts_with("p") || name.starts_with("t") || name.size() == 1;
    if (is_rotation) {
      if (found.quaternion[axis] < 0) found.quaternion[axis] = column;
    } else if (is_position && axis < 3) {
      if (found.position[axis] < 0) found.position[axis] = column;
    }
  }
  const auto is_missing = [](int column) { return column < 0; };
  if (found.time < 0 || std::any_of(found.quaternion.begin(), found.quaternion.end(), is_missing)) {
    return std::nullopt;
  }
  if (std::any_of(found.position.begin(), found.position.end(), is_missing)) {
    found.position = {-1, -1, -1};
  }
  return found;
}

TrajectoryBuilder::TrajectoryBuilder(const TrajectoryInput& input, std::string form)
    : path_(input.path) {
  file_.form = std::move(form);
  file_.notes = input.notes;
}

void TrajectoryBuilder::Add(int line, const StampedPose& pose) {
  constexpr double kLatestTime = 1e15;  // s
  if (!(std::abs(pose.timestamp_s) < kLatestTime) || !pose.center_in_world.allFinite()) {
    throw std::runtime_error(AtLine(path_, line, "a number is out of range"));
  }
  lines_.emplace_back(pose.timestamp_s, line);
  file_.poses.push_back(pose);
}

void TrajectoryBuilder::Add(const TextRow& row,
                            double timestamp_s,
                            const Eigen::Vector3d& center,
                            const Eigen::Vector4d& q) {
  const double length = q.norm();
  if (length == 0.0) {
    AddLost(row.line);
    return;
  }
  if (!std::isfinite(length)) {
    throw std::runtime_error(AtLine(path_, row.line, "a number of the quaternion is out of range"));
  }
  if (!IsUnitLength(length) && num_scaled_++ == 0) file_.first_scaled_line = row.line;
  try {
    Add(row.line, {timestamp_s, Rotation(Eigen::Quaterniond(q[3], q[0], q[1], q[2])), center});
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(AtLine(path_, row.line, error.what()));
  }
}

void TrajectoryBuilder::Add(int line, double timestamp_s, const std::array<double, 12>& v) {
  Eigen::Matrix3d R_w_c;
  R_w_c << v[0], v[1], v[2], v[4], v[5], v[6], v[8], v[9], v[10];
  if (!R_w_c.allFinite() || R_w_c.isZero(0.0)) {
    AddLost(line);
    return;
  }
  try {
    Add(line, {timestamp_s, Rotation::FromMatrix(R_w_c), Eigen::Vector3d(v[3], v[7], v[11])});
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(AtLine(path_, line, error.what()));
  }
}

void TrajectoryBuilder::AddLost(int line) {
  if (num_lost_++ == 0) first_lost_line_ = line;
}

TrajectoryFile TrajectoryBuilder::Finish() {
  if (num_lost_ > 0) {
    Note(Plural(num_lost_, "pose") + " left out that " + (num_lost_ == 1 ? "is" : "are") +
         " marked as lost (nan or zero), the first in line " + std::to_string(first_lost_line_));
  }
  if (num_scaled_ > 0) {
    Note(Plural(num_scaled_, "quaternion") +
         " of another length than 1 normalised, the first in "
         "line " +
         std::to_string(file_.first_scaled_line));
  }
  const auto earlier = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::stable_sort(lines_.begin(), lines_.end(), earlier);
  std::stable_sort(
      file_.poses.begin(), file_.poses.end(), [](const StampedPose& a, const StampedPose& b) {
        return a.timestamp_s < b.timestamp_s;
      });
  Trajectory once;
  once.reserve(file_.poses.size());
  int first_line = 0;
  double largest_deg = 0.0;
  for (std::size_t k = 0; k < file_.poses.size(); ++k) {
    const StampedPose& pose = file_.poses[k];
    if (once.empty() || pose.timestamp_s > once.back().timestamp_s) {
      once.push_back(pose);
      continue;
    }
    if (first_line == 0) first_line = lines_[k].second;
    largest_deg = std::max(largest_deg,
                           (once.back().world_from_cam.Inverse() * pose.world_from_cam).AngleDeg());
  }
  const int num_again = static_cast<int>(file_.poses.size() - once.size());
  if (num_again > 0) {
    Note(Plural(num_again, "pose") + " left out whose time is there before, the first in line " +
         std::to_string(first_line) +
         (largest_deg > 1e-3
              ? " (up to " + FormatNumber("%.3g", largest_deg) + " deg from the pose that is kept)"
              : ""));
  }
  file_.poses = std::move(once);
  if (file_.poses.empty()) {
    throw std::runtime_error(path_.string() + ": has no poses" +
                             (num_lost_ > 0 ? ": all are marked as lost (nan or zero)" : ""));
  }
  return std::move(file_);
}

std::vector<double> SecondsIn(const std::filesystem::path& path,
                              const std::vector<TextRow>& rows,
                              std::size_t column,
                              bool is_in_nanoseconds,
                              std::string& note) {
  std::vector<double> times;
  times.reserve(rows.size());
  for (const TextRow& row : rows) times.push_back(NumberAt(path, row, column));
  const TimeUnit unit = is_in_nanoseconds ? TimeUnit{1e-9, "ns"} : UnitOf(times);
  if (unit.seconds == 1.0) return times;
  if (!is_in_nanoseconds) note = std::string("its times are taken for ") + unit.name;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    times[k] = Seconds(path, rows[k], column, unit.seconds);
  }
  return times;
}

std::vector<double> TimesOfPoses(const TrajectoryInput& input,
                                 const std::optional<std::filesystem::path>& times,
                                 const std::vector<double>& numbers,
                                 std::vector<std::string>& notes) {
  if (!times) return numbers;
  std::string note;
  const std::vector<double> all = SecondsIn(*times, ReadTextRows(*times), 0, false, note);
  if (!note.empty()) notes.push_back(times->string() + ": " + note);
  std::vector<double> of_poses;
  of_poses.reserve(numbers.size());
  for (const double number : numbers) {
    if (number < static_cast<double>(all.size())) {
      of_poses.push_back(all[static_cast<std::size_t>(number)]);
      continue;
    }
    const bool are_counted = numbers.back() + 1.0 == static_cast<double>(numbers.size());
    throw std::runtime_error(
        times->string() + ": has " + std::to_string(all.size()) + " timestamps for the " +
        std::to_string(numbers.size()) + " poses of " + input.path.string() +
        (are_counted ? "" : ", of which one has the number " + FormatNumber("%.0f", number)));
  }
  return of_poses;
}

TrajectoryFile ReadPoseColumns(const TrajectoryInput& input,
                               const PoseColumns& columns,
                               const std::string& form) {
  const std::size_t num_columns = input.NumColumns();
  for (const TextRow& row : input.rows) {
    const bool may_have_empty_cells = input.columns.size() > 9;
    if (row.words.size() == num_columns || may_have_empty_cells) continue;
    throw std::runtime_error(AtLine(input.path,
                                    row.line,
                                    "expected " + std::to_string(num_columns) +
                                        " columns, as above, found " +
                                        std::to_string(row.words.size())));
  }
  int last = columns.time;
  for (const int column : columns.quaternion) last = std::max(last, column);
  for (const int column : columns.position) last = std::max(last, column);
  for (const TextRow& row : input.rows) {
    if (row.words.size() > static_cast<std::size_t>(last)) continue;
    throw std::runtime_error(AtLine(input.path, row.line, "the line ends too early"));
  }
  RequireQuaternions(input, columns);
  TrajectoryBuilder builder(input, form);
  std::string note;
  const std::vector<double> times = SecondsIn(input.path,
                                              input.rows,
                                              static_cast<std::size_t>(columns.time),
                                              input.is_in_nanoseconds,
                                              note);
  if (!note.empty()) builder.Note(note);
  for (std::size_t k = 0; k < input.rows.size(); ++k) {
    const TextRow& row = input.rows[k];
    if (HasMissing(row, columns)) {
      builder.AddLost(row.line);
      continue;
    }
    const auto at = [&](int column) {
      return column < 0 ? 0.0 : NumberAt(input.path, row, static_cast<std::size_t>(column));
    };
    builder.Add(row,
                times[k],
                {at(columns.position[0]), at(columns.position[1]), at(columns.position[2])},
                {at(columns.quaternion[0]),
                 at(columns.quaternion[1]),
                 at(columns.quaternion[2]),
                 at(columns.quaternion[3])});
  }
  return builder.Finish();
}

}  // namespace rotslam
