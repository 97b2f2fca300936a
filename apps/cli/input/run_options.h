#pragma once

#include <optional>
#include <string>

#include "apps/cli/input/input.h"
#include "apps/cli/terminal/common_flags.h"
#include "apps/slam/options.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {

/// All options of `rotslam run`: how the sequence is read, and the system's options.
struct RunOptions : SlamOptions {
  SequenceOptions sequence;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("sequence", sequence);
    SlamOptions::Visit(visit);
  }
};

/// The flags of `run` and `solve` for the known-rotation solver.
struct KrotFlags {
  std::string start;  // empty: as the configuration says
  bool no_certificate = false;

  void Override(KrotOptions& options) const;
};

void AddKrotFlags(CLI::App& command, KrotFlags& flags);

/// The defaults, overridden by the configuration file and then by the flags.
RunOptions ReadRunOptions(const CommonFlags& common);
RunOptions ReadRunOptions(const CommonFlags& common, const InputFlags& input);

}  // namespace rotslam
