#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace rotslam {

/// One option or positional argument, as --help shows it.
struct OptionDescription {
  std::vector<std::string> names;    // "--out"; one bare word for a positional argument
  bool takes_value = true;           // not a flag
  std::vector<std::string> choices;  // the only values there are; empty: any
  std::string text;
};

/// A command with all below it: what completion and the manual page are written from.
struct CommandDescription {
  std::string name;
  std::string text;
  std::vector<OptionDescription> arguments;  // positional ones
  std::vector<OptionDescription> options;
  std::string example;  // the command line that --help ends with; may be empty
  std::vector<CommandDescription> commands;
};

/// Reads it off the definitions that parse the command line.
CommandDescription DescribeCommands(const CLI::App& app);

/// Completion for bash: commands, options, and values where there are only some.
std::string BashCompletion(const CommandDescription& program);

/// The manual page, section 1, in roff.
std::string ManualPage(const CommandDescription& program, const std::string& version);

}  // namespace rotslam
