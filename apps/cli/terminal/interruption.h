#pragma once

#include <atomic>
#include <csignal>
#include <functional>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

namespace rotslam {

/// Thrown where there is no result to write yet: the program ends with Interruption::kExitCode and
/// this message.
class InterruptedError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Handles Ctrl-C (SIGINT) and SIGTERM for commands that finish their work first. The first signal
/// is a request; the second one ends the program at once, without half-written files. A signal that
/// was ignored at the start stays ignored.
///
/// A separate thread waits for the signals, which are blocked in all others: create this object
/// before any code that starts threads.
class Interruption {
 public:
  // The exit code that shells use for SIGINT.
  static constexpr int kExitCode = 130;

  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// Whether to stop after the frame at hand.
  bool IsRequested() const { return is_requested_; }
  /// Call it when the request has been fulfilled: the next signal counts as the first one.
  void Answer() { is_requested_ = false; }

 private:
  friend class EndAtInterruption;

  void EndWith(std::function<void()> end_at_interruption);
  void Wait();

  sigset_t signals_ = {};
  sigset_t blocked_before_ = {};
  std::atomic<bool> is_requested_ = false;
  std::atomic<bool> is_over_ = false;
  std::mutex mutex_;  // of at_end_, also while it runs
  std::function<void()> at_end_;
  int wake_ = 0;  // a signal that ends the waiting; 0: all are ignored, no thread waits
  std::thread waiting_;
};

/// While this object exists, the first signal ends the program after a call of `say` on the waiting
/// thread: for work that cannot be stopped half way and whose results would be lost. If the signal
/// came before, the program ends in the constructor.
class EndAtInterruption {
 public:
  EndAtInterruption(Interruption& interruption, std::function<void()> say)
      : interruption_(interruption) {
    interruption_.EndWith(std::move(say));
  }
  ~EndAtInterruption() { interruption_.EndWith(nullptr); }
  EndAtInterruption(const EndAtInterruption&) = delete;
  EndAtInterruption& operator=(const EndAtInterruption&) = delete;

 private:
  Interruption& interruption_;
};

}  // namespace rotslam
