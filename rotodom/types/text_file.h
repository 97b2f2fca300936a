#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace rotslam {

/// The content of a file. Throws std::runtime_error naming `path` when it cannot be read.
std::string ReadBytes(const std::filesystem::path& path);

/// The content of a text file, without a byte-order mark and with '\n' at the end of every line,
/// whatever system wrote it. Throws std::runtime_error naming `path` when it cannot be read or is
/// no text: UTF-16, or a file with bytes of value zero.
std::string ReadText(const std::filesystem::path& path);

/// One line of a text file that carries data, cut at blanks and commas.
struct TextRow {
  int line = 0;  // 1 is the file's first line
  std::vector<std::string> words;
};

/// The lines of a text file without the empty ones and those that start with '#'.
/// Throws std::runtime_error naming `path` when it cannot be read.
std::vector<TextRow> ReadTextRows(const std::filesystem::path& path);

/// The lines of a CSV file below its first one, cut at commas alone: cells may be empty. Throws
/// std::runtime_error naming `path`, and the line where that has another number of cells.
std::vector<TextRow> ReadCsvRows(const std::filesystem::path& path, std::size_t num_columns);

/// "path:line: reason", the form in which readers report what is wrong in a file.
std::string AtLine(const std::filesystem::path& path, int line, const std::string& reason);

/// The row's word at `position` as a finite number; throws std::runtime_error with file and line
/// when it is something else.
double NumberAt(const std::filesystem::path& path, const TextRow& row, std::size_t position);

/// The same as a whole number from `low` to the largest int.
int IntegerAt(const std::filesystem::path& path, const TextRow& row, std::size_t position, int low);

/// `value` with `format`, one printf conversion for a double ("%.12g").
std::string FormatNumber(const char* format, double value);

}  // namespace rotslam
