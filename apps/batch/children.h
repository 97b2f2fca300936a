#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <signal.h>
#include <sys/types.h>

namespace rotslam {

struct ChildTimes {
  double cpu_s = 0.0;
  double wall_s = 0.0;
};

/// How a child process ended and what it took.
struct ChildEnd {
  int exit_code = 0;  // 128 + signal where a signal ended it, as shells have it
  double cpu_s = 0.0;
  double wall_s = 0.0;
  std::int64_t max_memory_kb = 0;
};

/// Processes of this same program that run beside each other. While an object lives, Ctrl-C and
/// SIGTERM do nothing here but reach all of them, so that each ends in its own good order. Where
/// the thread that has started them ends before them, as it does when this process is killed, they
/// are killed.
class Children {
 public:
  Children();
  /// Ends the children that still run.
  ~Children();
  Children(const Children&) = delete;
  Children& operator=(const Children&) = delete;

  /// Starts the program with these arguments, as they are: no shell is between. What it prints goes
  /// to `log`. Throws std::runtime_error when the system refuses.
  /// @param id  by which Wait calls it.
  void Start(int id, const std::vector<std::string>& arguments, const std::filesystem::path& log);

  /// Waits for the next child to end; there must be one. nullopt: none has ended in that time.
  std::optional<std::pair<int, ChildEnd>> Wait(std::chrono::milliseconds at_most);

  /// The times that those that run have taken so far, by id.
  std::map<int, ChildTimes> TimesSoFar() const;

  int num_running() const { return static_cast<int>(running_.size()); }
  /// Someone has asked for the end: no further child should start.
  bool interrupted() const { return interrupted_; }

  /// Takes note of signals that came since, without waiting.
  void Poll();

 private:
  struct Child {
    int id = 0;
    std::chrono::steady_clock::time_point start;
  };

  void Take(int signal);

  std::map<pid_t, Child> running_;
  bool interrupted_ = false;
  sigset_t signals_;
  sigset_t mask_before_;
};

}  // namespace rotslam
