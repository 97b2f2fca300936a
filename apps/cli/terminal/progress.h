#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/cli/terminal/common_flags.h"

namespace spdlog {
class logger;
}  // namespace spdlog

namespace rotslam {

/// Shows the progress of a run: one line that is updated on a terminal, and a plain line at
/// intervals elsewhere. Writes to standard error; warnings are shown even when quiet. The log file
/// gets every line, details included, with its time. May be used from several threads.
class Progress {
 public:
  /// Throws std::runtime_error when the log file cannot be written.
  explicit Progress(const CommonFlags& flags);
  /// Removes the updated line, so that an error message has a line of its own.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Prints a permanent line. Control characters, which file names may contain, are shown as '?'.
  void Say(const std::string& line);
  void Warn(const std::string& line);
  /// Prints a line with --verbose only.
  void Detail(const std::string& line);

  /// Starts a stage of `total` steps (negative: not known).
  void StartStage(const std::string& name, int total);
  /// Reports that `done` steps of the stage are finished. Counters are shown after the figures as
  /// far as the line has room.
  void Step(int done, const std::vector<std::string>& counters = {});
  /// Ends the stage with a permanent line.
  void EndStage(const std::string& note = {});

 private:
  using Clock = std::chrono::steady_clock;

  std::vector<std::string> Figures() const;
  void Renew();
  void Print(const std::string& line);
  void ClearLine();
  // Updates the seconds of a stage without steps.
  void Tick();

  bool quiet_;
  bool verbose_;
  bool terminal_;
  bool colour_;
  std::shared_ptr<spdlog::logger> log_;  // null: none

  std::mutex mutex_;  // of all below
  std::string stage_;
  int total_ = -1;
  int done_ = 0;
  std::vector<std::string> counters_;
  Clock::time_point started_;
  Clock::time_point shown_;
  bool stage_open_ = false;
  bool line_open_ = false;
  bool ending_ = false;
  std::condition_variable wake_;
  std::thread ticker_;  // on a terminal only
};

/// "rotslam: <message>" on standard error as one such line, and in the log file if there is one.
void PrintError(std::string message);

}  // namespace rotslam
