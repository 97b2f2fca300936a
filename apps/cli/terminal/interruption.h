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

/// There is nothing to write yet: the program ends with Interruption::kExitCode and this line.
class InterruptedError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What Ctrl-C (SIGINT) and SIGTERM do to a command that wants to end in order. The first one is a
/// request; the second ends the program at once, without half-written files. A signal that was
/// ignored at the start stays ignored.
///
/// A thread of its own waits for the signals, which are blocked in all others: make this object
/// before anything that starts threads.
class Interruption {
 public:
  // As shells give it for SIGINT.
  static constexpr int kExitCode = 130;

  Interruption();
  ~Interruption();
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  /// Whether to stop after the frame at hand.
  bool IsRequested() const { return is_requested_; }

 private:
  friend class LastWords;

  void EndWith(std::function<void()> last_words);
  void Wait();

  sigset_t signals_ = {};
  sigset_t blocked_before_ = {};
  std::atomic<bool> is_requested_ = false;
  std::atomic<bool> is_over_ = false;
  std::mutex mutex_;  // of last_words_, also while it runs
  std::function<void()> last_words_;
  int wake_ = 0;  // one that ends the waiting; 0: all are ignored, nobody waits
  std::thread waiting_;
};

/// While this lives the request itself ends the program, after a call of `say` on the waiting
/// thread: around work that cannot be stopped halfway and would be lost anyway. Where the request
/// has been made before, it ends here.
class LastWords {
 public:
  LastWords(Interruption& interruption, std::function<void()> say) : interruption_(interruption) {
    interruption_.EndWith(std::move(say));
  }
  ~LastWords() { interruption_.EndWith(nullptr); }
  LastWords(const LastWords&) = delete;
  LastWords& operator=(const LastWords&) = delete;

 private:
  Interruption& interruption_;
};

}  // namespace rotslam
