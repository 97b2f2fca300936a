#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "output/tables/loops_csv.h"
#include "output/tables/poses_csv.h"
#include "output/tables/segments.h"

namespace rotslam {

/// How far a run may be trusted.
enum class Verdict {
  kGreen,     // nothing speaks against it
  kLookAt,    // usable; what the reasons name may be wrong
  kDoNotUse,  // what the reasons name is wrong
};

/// "green", "look at" or "do not use".
const char* Name(Verdict verdict);

/// Something that speaks against a run.
struct CheckReason {
  Verdict verdict = Verdict::kLookAt;
  std::string frames;  // "frames 0-39, 83", or "all frames"
  std::string text;    // what happened, what it means, what to do
  bool warns = false;  // `run` warns of it; of the others it does so by itself, or not at all
};

/// The files of a run that tell its quality. A missing file leaves its field empty.
// NOLINTNEXTLINE(bugprone-exception-escape): moving a JSON value is noexcept.
struct RunFacts {
  nlohmann::ordered_json summary;
  std::vector<PoseRow> poses;
  std::vector<Segment> segments;
  std::vector<LoopRow> loops;
};

/// How far a run can be trusted, and why.
struct RunCheck {
  Verdict verdict = Verdict::kGreen;  // the worst of the reasons'
  std::vector<CheckReason> reasons;   // the worst first
};

/// Asks every function of the table of reasons in run_check.cc. A new reason is a function there.
RunCheck CheckFacts(const RunFacts& facts);

/// Reads a folder of `run` or `rotations` and checks it. Throws std::runtime_error with path and
/// reason where summary.json is missing or a file is damaged.
RunCheck CheckRun(const std::filesystem::path& run);

/// The verdict and the number of reasons in one sentence.
std::string Describe(const RunCheck& check);

}  // namespace rotslam
