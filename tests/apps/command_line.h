#pragma once

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {

/// What a finished program left.
struct CommandResult {
  int exit_code = -1;  // -1: it was ended by a signal
  std::string output;  // standard output
  std::string error;   // standard error
};

/// The argument as a shell takes it literally.
inline std::string Quoted(const std::string& argument) {
  std::string quoted = "'";
  for (const char c : argument) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

/// Runs the built executable with these arguments.
/// @param setup   what the shell does before ("ulimit -f 100;").
/// @param runner  a program that starts the executable, with its arguments.
inline CommandResult Rotslam(const std::vector<std::string>& arguments,
                             const std::string& setup,
                             const std::string& runner) {
  const TemporaryFolder folder;
  const std::filesystem::path output = folder.path() / "output";
  const std::filesystem::path error = folder.path() / "error";
  std::string command = Quoted(ROTSLAM_EXECUTABLE);
  for (const std::string& argument : arguments) command += " " + Quoted(argument);
  command += " >" + Quoted(output.string()) + " 2>" + Quoted(error.string());
  // The shell is replaced by the program, so that a signal is seen here.
  const int status = std::system((setup + " exec " + runner + " " + command).c_str());
  CommandResult result;
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  result.output = ReadWholeFile(output);
  result.error = ReadWholeFile(error);
  return result;
}

inline CommandResult Rotslam(const std::vector<std::string>& arguments) {
  return Rotslam(arguments, "", "");
}

/// The same with one list behind another.
inline CommandResult Rotslam(std::vector<std::string> arguments,
                             const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return Rotslam(arguments);
}

/// Whether this machine gives programs a terminal of their own; some containers have none.
inline bool HasTerminals() {
  int terminal = -1;
  int other_side = -1;
  if (openpty(&terminal, &other_side, nullptr, nullptr, nullptr) != 0) return false;
  close(terminal);
  close(other_side);
  return true;
}

/// The same on a terminal of its own, of so many columns; everything printed is in `output`.
/// @param environment  what it has of it besides the test's, "NAME=value".
inline CommandResult RotslamOnTerminal(const std::vector<std::string>& arguments,
                                       int columns,
                                       std::vector<std::string> environment = {"NO_COLOR=1"}) {
  std::vector<std::string> words = {ROTSLAM_EXECUTABLE};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  winsize size{};
  size.ws_row = 24;
  size.ws_col = static_cast<unsigned short>(columns);
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, &size);
  if (child < 0) {
    throw std::runtime_error(std::string("no terminal can be opened: ") + std::strerror(errno));
  }
  if (child == 0) {
    for (std::string& variable : environment) putenv(variable.data());
    execv(argv[0], argv.data());
    _exit(127);
  }
  CommandResult result;
  std::array<char, 4096> buffer;
  // Linux reports the end of the other side as an error.
  for (ssize_t count = 0; (count = read(terminal, buffer.data(), buffer.size())) > 0;) {
    result.output.append(buffer.data(), static_cast<std::size_t>(count));
  }
  close(terminal);
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  return result;
}

/// What a terminal shows after `output`: carriage return and "clear to the end of the line" obeyed.
inline std::vector<std::string> ShownLines(const std::string& output) {
  std::vector<std::string> lines = {""};
  std::size_t column = 0;
  for (std::size_t k = 0; k < output.size(); ++k) {
    std::string& line = lines.back();
    if (output[k] == '\r') {
      column = 0;
    } else if (output[k] == '\n') {
      lines.emplace_back();
    } else if (output.compare(k, 3, "\033[K") == 0) {
      line.resize(std::min(column, line.size()));
      k += 2;
    } else {
      line.resize(std::max(line.size(), column + 1), ' ');
      line[column++] = output[k];
    }
  }
  if (lines.back().empty()) lines.pop_back();
  return lines;
}

inline std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

/// What `rotslam run` leaves in its folder without a report, in the order of FileNames.
inline const std::vector<std::string>& RunFiles() {
  static const std::vector<std::string> files = {"camera.yaml",
                                                 "cameras.ply",
                                                 "cloud.ply",
                                                 "keyframes_tum.txt",
                                                 "known_rotation.txt",
                                                 "loops.csv",
                                                 "map.bin",
                                                 "map_all_frames.bin",
                                                 "matches.bin",
                                                 "poses.csv",
                                                 "rotations.csv",
                                                 "rotations_tum.txt",
                                                 "segments.csv",
                                                 "summary.json",
                                                 "thumbnails.bin",
                                                 "trajectory_kitti.txt",
                                                 "trajectory_tum.txt",
                                                 "view_graph.g2o"};
  return files;
}

/// Names of all files below a folder, relative to it, sorted; none where there is no folder.
inline std::vector<std::string> FileNames(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  if (!std::filesystem::is_directory(folder)) return names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_directory()) {
      names.push_back(std::filesystem::relative(entry.path(), folder).string());
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace rotslam
