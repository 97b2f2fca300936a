#pragma once

#include <cstdint>
#include <string>

#include <CLI/CLI.hpp>

namespace rotslam {

/// The flags of every subcommand.
struct CommonFlags {
  int threads = 0;  // 0: all cores; the output does not depend on it
  std::uint64_t seed = 1;
  std::string config;  // YAML file that overrides option defaults; empty: none
  bool quiet = false;
  bool verbose = false;
  std::string log;  // file for all that --verbose says, with times; empty: none

  /// `threads`, with 0 replaced by the number of cores.
  int NumThreads() const;
};

/// Checks of option values, with messages for people.
CLI::Validator AtLeastZero();
CLI::Validator AboveZero();

void AddCommonFlags(CLI::App& command, CommonFlags& flags);

}  // namespace rotslam
