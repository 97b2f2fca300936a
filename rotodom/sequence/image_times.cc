#include "rotodom/sequence/image_times.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/times.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct TableRow {
  TextLine line;
  std::vector<std::string> cells;
};

// A text file with one frame in each line.
struct Table {
  std::vector<std::string> titles;  // of the columns; empty where the file has none
  std::vector<TableRow> rows;
};

bool IsNumberOrDate(const std::string& cell) {
  return ParseNumber(cell).has_value() || ParseDate(cell).has_value();
}

bool IsImageCell(std::string cell) {
  std::replace(cell.begin(), cell.end(), '\\', '/');
  const fs::path file(cell);
  return !file.filename().empty() && IsImageName(file);
}

Table ReadTable(const fs::path& file) {
  Table table;
  std::istringstream stream(ReadText(file));
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    const std::string_view line = Trimmed(text);
    if (line.empty()) continue;
    const bool is_comment = line.front() == '#';
    std::vector<std::string> cells = CutIntoCells(is_comment ? line.substr(1) : line);
    const bool is_title =
        table.rows.empty() && std::none_of(cells.begin(), cells.end(), IsNumberOrDate);
    if (is_comment || is_title) {
      if (table.rows.empty()) table.titles = std::move(cells);
    } else {
      table.rows.push_back({{number, std::string(line)}, std::move(cells)});
    }
  }
  return table;
}

// One column of numbers with a decimal comma, which looks like two: "0,05". An index would increase
// from line to line.
void JoinDecimalCommas(Table& table) {
  bool increases = true;
  for (std::size_t k = 0; k < table.rows.size(); ++k) {
    const std::vector<std::string>& cells = table.rows[k].cells;
    if (cells.size() != 2 || !AllDigits(cells[0]) || !AllDigits(cells[1]) ||
        table.rows[k].line.text != cells[0] + "," + cells[1]) {
      return;
    }
    increases =
        increases && (k == 0 || ParseInteger(cells[0]) > ParseInteger(table.rows[k - 1].cells[0]));
  }
  if (increases) return;
  for (TableRow& row : table.rows) row.cells = {row.line.text};
}

// The number at the end of a name: 12 of "frame_000012".
std::optional<std::int64_t> NumberOfName(const std::string& stem) {
  const std::size_t last = stem.find_last_not_of("0123456789");
  return ParseInteger(std::string_view(stem).substr(last == std::string::npos ? 0 : last + 1));
}

// The images by what a list may call them.
struct ImageKeys {
  explicit ImageKeys(const std::vector<fs::path>& files) : count(files.size()) {
    for (std::size_t k = 0; k < files.size(); ++k) {
      const std::string stem = files[k].stem().string();
      by_name[Lower(stem)] = k;
      numbers.push_back(NumberOfName(stem));
      if (numbers.back()) by_number.emplace(*numbers.back(), k);
    }
    are_numbered = by_number.size() == count;
  }

  std::optional<std::size_t> Find(std::string cell) const {
    std::replace(cell.begin(), cell.end(), '\\', '/');
    const fs::path file = fs::path(cell).filename();
    const std::string name = Lower((IsImageName(file) ? file.stem() : file).string());
    if (const auto found = by_name.find(name); found != by_name.end()) return found->second;
    const auto number = ParseInteger(cell);
    const auto found = number && are_numbered ? by_number.find(*number) : by_number.end();
    return found == by_number.end() ? std::nullopt : std::optional(found->second);
  }

  std::size_t count;
  std::map<std::string, std::size_t> by_name;
  std::map<std::int64_t, std::size_t> by_number;
  std::vector<std::optional<std::int64_t>> numbers;
  bool are_numbered = false;
};

std::string CellOf(const TableRow& row, std::size_t column) {
  return column < row.cells.size() ? row.cells[column] : std::string();
}

// The column that names the images or numbers them.
std::optional<std::size_t> NameColumn(const Table& table, const ImageKeys& images) {
  const std::size_t num_columns = table.rows.front().cells.size();
  for (std::size_t c = 0; c < num_columns; ++c) {
    if (IsImageCell(table.rows.front().cells[c])) return c;
  }
  for (std::size_t c = 0; num_columns > 1 && c < num_columns; ++c) {
    std::vector<bool> found(images.count, false);
    std::size_t num_found = 0;
    for (const TableRow& row : table.rows) {
      const auto k = images.Find(CellOf(row, c));
      if (!k || found[*k]) continue;
      found[*k] = true;
      ++num_found;
    }
    if (num_found == images.count) return c;
  }
  return std::nullopt;
}

// What Layout::times_source says of a list.
std::string SourceOfList(const fs::path& list, const SpokenTimes& times) {
  const std::string name = list.filename().string();
  return times.unit == "seconds" ? name : name + " (" + times.unit + ")";
}

// As times do, but for some lines that are at fault.
bool MostlyIncrease(const std::vector<double>& values) {
  std::size_t count = 0;
  for (std::size_t k = 1; k < values.size(); ++k) count += values[k] > values[k - 1] ? 1 : 0;
  return 2 * count + 1 >= values.size();
}

// The times of the first column that holds some; nullopt: none does.
std::optional<SpokenTimes> TimesOfTable(const fs::path& list,
                                        const Table& table,
                                        std::optional<std::size_t> name_column) {
  const std::size_t num_columns = table.rows.front().cells.size();
  for (std::size_t c = 0; c < num_columns; ++c) {
    if (c == name_column || !IsNumberOrDate(table.rows.front().cells[c])) continue;
    std::vector<std::string> words;
    std::vector<const TableRow*> bad_rows;
    for (const TableRow& row : table.rows) {
      words.push_back(CellOf(row, c));
      if (!IsNumberOrDate(words.back())) bad_rows.push_back(&row);
    }
    if (2 * bad_rows.size() > words.size()) continue;
    if (!bad_rows.empty()) FailAtLine(list, bad_rows.front()->line, "a time");
    const bool has_titles = table.titles.size() == num_columns;
    auto times =
        TimesOfWords(words, UnclearTimes::kAreNone, has_titles ? TicksOfTitle(table.titles[c]) : 0);
    if (!times) {
      // Dates and numbers, or whole numbers that could be of frames.
      continue;
    }
    if (name_column || MostlyIncrease(times->times_s)) return times;
  }
  return std::nullopt;
}

struct ListedTime {
  double time_s = 0.0;
  int line = 0;
};

// What a list tells of images.
struct ListedTimes {
  std::string source;  // as in Layout
  std::vector<std::optional<ListedTime>> of_image;
  bool has_names = false;  // the list's order says nothing
};

// Times of the images that a list tells: nullopt where it does not fit, which is noted.
std::optional<ListedTimes> TimesOfList(const fs::path& list,
                                       const ImageKeys& images,
                                       std::vector<std::string>& notes) {
  // A table of another name may be about anything.
  const bool is_certain = LowerExtension(list) != ".csv";
  Table table = ReadTable(list);
  JoinDecimalCommas(table);
  const std::string name = list.filename().string();
  const auto refuse = [&](const std::string& reason) {
    if (is_certain) notes.push_back(list.string() + " " + reason + ": not used");
    return std::nullopt;
  };
  if (table.rows.empty()) return refuse("is empty");
  const auto name_column = NameColumn(table, images);
  const auto times = TimesOfTable(list, table, name_column);
  if (!times) return refuse("numbers the frames and tells no times");
  ListedTimes listed;
  listed.source = SourceOfList(list, *times);
  listed.has_names = name_column.has_value();
  listed.of_image.resize(images.count);
  auto& found = listed.of_image;
  const std::size_t num_rows = table.rows.size();
  const std::string counts =
      std::to_string(num_rows) + " times for " + std::to_string(images.count) + " images";
  if (name_column) {
    std::size_t num_found = 0;
    for (std::size_t row = 0; row < num_rows; ++row) {
      const auto k = images.Find(CellOf(table.rows[row], *name_column));
      if (!k || found[*k]) continue;
      found[*k] = {times->times_s[row], table.rows[row].line.number};
      ++num_found;
    }
    if (2 * num_found < images.count) return refuse("names other images");
    return listed;
  }
  const auto take_row = [&](std::size_t k, std::size_t row) {
    found[k] = {times->times_s[row], table.rows[row].line.number};
  };
  if (num_rows == images.count) {
    for (std::size_t k = 0; k < images.count; ++k) take_row(k, k);
    return listed;
  }
  const bool by_number = images.are_numbered && !images.by_number.empty() &&
                         images.by_number.rbegin()->first < static_cast<std::int64_t>(num_rows);
  if (num_rows < images.count || !by_number) return refuse("has " + counts);
  for (std::size_t k = 0; k < images.count; ++k) {
    take_row(k, static_cast<std::size_t>(*images.numbers[k]));
  }
  notes.push_back(name + " has " + counts + ": an image has the time of its number");
  return listed;
}

bool MentionsImages(const fs::path& file) {
  std::array<char, 4096> buffer;
  std::ifstream stream(file, std::ios::binary);
  stream.read(buffer.data(), buffer.size());
  const std::string text =
      Lower(std::string_view(buffer.data(), static_cast<std::size_t>(stream.gcount())));
  for (const char* extension :
       {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".pgm", ".webp", ".heic"}) {
    if (text.find(extension) != std::string::npos) return true;
  }
  return false;
}

// Files in `places` that may tell the times of images, the likelier ones first.
std::vector<fs::path> TimeListsIn(const std::vector<fs::path>& places) {
  std::vector<fs::path> lists;
  for (const fs::path& place : places) {
    for (const char* name : {"times.txt",
                             "timestamps.txt",
                             "timestamp.txt",
                             "image_timestamps.txt",
                             "image_timestamps",
                             "times.csv",
                             "timestamps.csv"}) {
      if (IsFile(place / name)) lists.push_back(place / name);
    }
    std::vector<fs::path> tables;
    std::error_code error;
    for (fs::directory_iterator entries(place, error), end; !error && entries != end;
         entries.increment(error)) {
      const fs::path& file = entries->path();
      if (LowerExtension(file) != ".csv" || !IsFile(file)) continue;
      const bool is_known = std::find(lists.begin(), lists.end(), file) != lists.end();
      if (!is_known && MentionsImages(file)) tables.push_back(file);
    }
    std::sort(tables.begin(), tables.end());
    lists.insert(lists.end(), tables.begin(), tables.end());
  }
  return lists;
}

void SortByTime(std::vector<ImageEntry>& entries) {
  std::stable_sort(entries.begin(), entries.end(), [](const ImageEntry& a, const ImageEntry& b) {
    return a.timestamp_s < b.timestamp_s;
  });
}

// With the times of the first list that fits. False: none does.
bool AddWithListedTimes(const std::vector<fs::path>& files,
                        const std::vector<fs::path>& places,
                        Layout& layout) {
  const ImageKeys images(files);
  for (const fs::path& list : TimeListsIn(places)) {
    const auto times = TimesOfList(list, images, layout.notes);
    if (!times) continue;
    std::vector<std::string> left_out;
    for (std::size_t k = 0; k < files.size(); ++k) {
      const auto& time = times->of_image[k];
      if (time) {
        layout.entries.push_back({files[k], time->time_s, time->line});
      } else {
        left_out.push_back(files[k].filename().string());
      }
    }
    if (!left_out.empty()) {
      layout.notes.push_back(list.filename().string() + " has no times for " +
                             SomeOf(left_out, left_out.size()) + ": left out");
    }
    layout.time_list = list;
    layout.times_source = times->source;
    if (times->has_names) SortByTime(layout.entries);
    return true;
  }
  return false;
}

// `time name time name`, as data sets associate images and depth maps.
bool IsRowOfTwo(const std::vector<std::string>& cells) {
  return cells.size() == 4 && IsNumberOrDate(cells[0]) && !IsNumberOrDate(cells[1]) &&
         IsNumberOrDate(cells[2]) && !IsNumberOrDate(cells[3]);
}

// Of two names in a row: is the first that of the depth map?
bool LooksLikeDepth(const std::string& first, const std::string& second) {
  const auto mentions = [](const std::string& name, std::initializer_list<const char*> words) {
    const std::string lower = Lower(name);
    return std::any_of(words.begin(), words.end(), [&](const char* word) {
      return lower.find(word) != std::string::npos;
    });
  };
  const auto is_image = {"rgb", "color", "colour", "image", "grey", "gray"};
  return !mentions(first, is_image) && (mentions(first, {"depth"}) || mentions(second, is_image));
}

// The columns of a list of images, with times that are words still.
struct ListColumns {
  const std::vector<TextLine>& lines;
  const std::vector<std::string>& words;  // the times
  const std::vector<std::string>& names;
};

void AddWithWords(const fs::path& list,
                  const ListColumns& columns,
                  const std::vector<fs::path>& folders,
                  const SequenceOptions& options,
                  Layout& layout) {
  const auto& [lines, words, names] = columns;
  bool are_numbers = true;  // of frames, by which the images are called, too
  ListedFiles files(list, folders);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    layout.entries.push_back({files.Find(names[k]), 0.0, lines[k].number});
    const auto number = ParseInteger(words[k]);
    are_numbers =
        are_numbers && number && NumberOfName(layout.entries.back().file.stem().string()) == number;
  }
  files.AddNotes(layout.notes);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (!IsNumberOrDate(words[k])) FailAtLine(list, lines[k], "a time and a name");
  }
  auto times =
      TimesOfWords(words, are_numbers ? UnclearTimes::kAreNone : UnclearTimes::kAreSeconds);
  if (!times && !are_numbers) Fail(list, "holds both dates and numbers, expected one of them");
  layout.time_list = list;
  layout.times_are_made_up = !times;
  layout.times_source = times ? SourceOfList(list, *times) : MadeUpTimes(options.fps);
  if (!times) {
    layout.notes.push_back(list.filename().string() + " numbers the frames and tells no times");
  }
  for (std::size_t k = 0; k < lines.size(); ++k) {
    layout.entries[k].timestamp_s =
        times ? times->times_s[k] : static_cast<double>(*ParseInteger(words[k])) / options.fps;
  }
}

}  // namespace

void AddImages(std::vector<fs::path> files,
               const std::vector<fs::path>& places,
               const SequenceOptions& options,
               Layout& layout) {
  if (files.empty()) Fail(layout.folder, "holds no images");
  if (AddWithListedTimes(files, places, layout)) return;
  std::vector<std::string> stems;
  stems.reserve(files.size());
  for (const fs::path& file : files) stems.push_back(file.stem().string());
  const auto times = TimesOfNames(stems);
  layout.times_are_made_up = !times;
  layout.times_source = times ? "file names (" + times->unit + ")" : MadeUpTimes(options.fps);
  for (std::size_t k = 0; k < files.size(); ++k) {
    const double time_s = times ? times->times_s[k] : static_cast<double>(k) / options.fps;
    layout.entries.push_back({std::move(files[k]), time_s});
  }
  SortByTime(layout.entries);
}

void AddNumberedImages(std::vector<fs::path> files, const fs::path& list, Layout& layout) {
  if (files.empty()) Fail(layout.folder, "holds no images");
  const std::vector<TextLine> lines = ReadLines(list);
  std::vector<std::string> words;
  words.reserve(lines.size());
  for (const TextLine& line : lines) {
    const std::vector<std::string> cells = CutIntoCells(line.text);
    if (cells.size() != 1 || !IsNumberOrDate(cells.front())) FailAtLine(list, line, "a time");
    words.push_back(cells.front());
  }
  const auto times = TimesOfWords(words, UnclearTimes::kAreSeconds);
  if (!times) Fail(list, "holds both dates and numbers, expected one of them");
  for (std::size_t k = 0; k < files.size(); ++k) {
    // The name is the number of the line, so a part of the images may be given with all the times.
    const std::string stem = files[k].stem().string();
    const auto number = AllDigits(stem) ? ParseInteger(stem) : std::nullopt;
    const auto row = number ? static_cast<std::size_t>(*number) : k;
    if (row >= lines.size()) {
      Fail(list, "has " + std::to_string(lines.size()) + " times, none for " + files[k].string());
    }
    layout.entries.push_back({std::move(files[k]), times->times_s[row], lines[row].number});
  }
  layout.time_list = list;
  layout.times_source = SourceOfList(list, *times);
}

void AddListedImages(const fs::path& list,
                     const std::vector<fs::path>& folders,
                     const SequenceOptions& options,
                     Layout& layout) {
  const std::vector<TextLine> lines = ReadLines(list);
  if (lines.empty()) Fail(list, "lists no images");
  const bool has_pairs = IsRowOfTwo(CutIntoCells(lines.front().text));
  std::vector<std::string> times;
  std::vector<std::string> names;
  std::vector<std::string> other_names;
  for (const TextLine& line : lines) {
    std::vector<std::string> cells = CutIntoCells(line.text);
    if (has_pairs && !IsRowOfTwo(cells)) FailAtLine(list, line, "'time name time name'");
    if (!has_pairs && (cells.size() < 2 || !IsNumberOrDate(cells[0]))) {
      FailAtLine(list, line, "'time name', such as 1305031102.175304 rgb/1305031102.175304.png");
    }
    times.push_back(cells[0]);
    // A name may hold blanks.
    if (!has_pairs && cells.size() > 2 && !IsImageCell(cells[1])) {
      const std::size_t blank = line.text.find_first_of(" \t");
      cells[1] = blank == std::string::npos ? cells[1] : line.text.substr(blank + 1);
    }
    names.push_back(cells[1]);
    other_names.push_back(has_pairs ? cells[3] : std::string());
  }
  if (has_pairs && LooksLikeDepth(names.front(), other_names.front())) {
    std::swap(names, other_names);
    for (std::size_t k = 0; k < lines.size(); ++k) times[k] = CutIntoCells(lines[k].text)[2];
  }
  AddWithWords(list, {lines, times, names}, folders, options, layout);
}

}  // namespace rotslam
