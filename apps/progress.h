#pragma once

#include <chrono>
#include <string>

namespace rotslam {

/// Tells a person how a run is getting on: one line that renews itself on a terminal, a plain line
/// now and then elsewhere. Writes to standard error; warnings are shown even when quiet.
class Progress {
 public:
  explicit Progress(bool quiet);
  /// Takes the renewed line away, so that an error's own line stands alone.
  ~Progress() { ClearLine(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A line that stays.
  void Say(const std::string& line);
  void Warn(const std::string& line);

  /// Begins a stage of `total` steps (negative: not known).
  void StartStage(const std::string& name, int total);
  /// Step `done` of the stage is finished; `note` is shown behind the figures.
  void Step(int done, const std::string& note = {});
  /// Ends the stage with one line that stays.
  void EndStage(const std::string& note = {});

 private:
  using Clock = std::chrono::steady_clock;

  std::string Figures(int done) const;
  void Renew(const std::string& line);
  void ClearLine();

  bool quiet_;
  bool terminal_;
  std::string stage_;
  int total_ = -1;
  int done_ = 0;
  Clock::time_point started_;
  Clock::time_point shown_;
  bool line_open_ = false;
};

}  // namespace rotslam
