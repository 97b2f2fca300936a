#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>

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
inline CommandResult Rotslam(const std::vector<std::string>& arguments) {
  const TemporaryFolder folder;
  const std::filesystem::path output = folder.path() / "output";
  const std::filesystem::path error = folder.path() / "error";
  std::string command = Quoted(ROTSLAM_EXECUTABLE);
  for (const std::string& argument : arguments) command += " " + Quoted(argument);
  command += " >" + Quoted(output.string()) + " 2>" + Quoted(error.string());
  // The shell is replaced by the program, so that a signal is seen here.
  const int status = std::system(("exec " + command).c_str());
  CommandResult result;
  if (WIFEXITED(status)) result.exit_code = WEXITSTATUS(status);
  result.output = ReadWholeFile(output);
  result.error = ReadWholeFile(error);
  return result;
}

/// The same with one list behind another.
inline CommandResult Rotslam(std::vector<std::string> arguments,
                             const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return Rotslam(arguments);
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
