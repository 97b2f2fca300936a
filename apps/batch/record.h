#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/batch/children.h"
#include "apps/batch/list.h"

namespace rotslam {

/// The request of a batch for one sequence: everything that its result depends on, as one line of
/// JSON. Equal requests have equal results.
std::string RequestOf(const BatchEntry& entry, std::uint64_t seed);

/// The request's options as a file for --config; JSON is YAML, too.
std::string OptionsFileOf(const BatchEntry& entry);

/// How one sequence went: batch.json in the folder of its results.
struct BatchRecord {
  std::string request;
  // nullopt: started, and nobody was there to see the end.
  std::optional<ChildEnd> end;
  std::string error;  // the line that says why it failed
  // Time of the parts before interruptions. The total in `end` includes it.
  ChildTimes earlier = {};
  // Without an end: of the part since, as last seen.
  ChildTimes running = {};
};

/// nullopt where there is no record, or not a whole one.
std::optional<BatchRecord> ReadRecord(const std::filesystem::path& directory);
/// Throws std::runtime_error naming the file when it cannot be written.
void WriteRecord(const std::filesystem::path& directory, const BatchRecord& record);

/// Whether this very request has been met, its results being whole.
bool IsFinished(const std::filesystem::path& directory, const std::string& request);

/// Whether a run with this very request was stopped from outside: by Ctrl-C, by a signal, or
/// together with the batch. What it has left is to be gone on from.
bool WasInterrupted(const std::filesystem::path& directory, const std::string& request);

/// The last line of a log that reports an error, without "rotslam: "; else the last line.
std::string LastErrorLine(const std::filesystem::path& log);

/// "exit code 1: seq: no such folder", "signal 9"; empty where all went well.
std::string ReasonOf(const BatchRecord& record);

/// One line of the table. Missing figures are not known, or the sequence has none.
struct BatchResult {
  std::string name;
  std::optional<std::int64_t> frames;
  std::optional<double> coverage;  // share of the frames whose pose has ground truth
  std::optional<double> rpe1_deg;
  std::optional<double> rpen_deg;
  std::optional<double> ate;  // in the ground truth's unit, metres
  std::optional<std::int64_t> points;
  std::optional<double> cpu_s;
  // "done", "failed", "not run", "unfinished": runs, or was stopped together with the batch,
  // "outdated": ran with another request
  std::string status;
  std::string note;    // why it failed, or could not be compared
  std::string report;  // page about the run, relative to --out; empty: there is none
  std::string log;     // what it printed, likewise
};

/// Reads what a run has left in `directory` and compares it with the entry's ground truth.
BatchResult ResultOf(const BatchEntry& entry,
                     const std::filesystem::path& directory,
                     const std::string& request,
                     int num_threads);

}  // namespace rotslam
