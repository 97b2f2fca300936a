#include "apps/cli/terminal/interruption.h"

#include <exception>
#include <utility>

#include <unistd.h>

#include "apps/cli/terminal/progress.h"
#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

bool IsIgnored(int signal) {
  struct sigaction action = {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

// Other threads are in mid-work: nothing of theirs is taken down in order.
[[noreturn]] void EndAtOnce() {
  RemoveTemporaryFiles();
  _exit(Interruption::kExitCode);
}

[[noreturn]] void EndAfter(const std::function<void()>& last_words) {
  try {
    last_words();
  } catch (const std::exception& error) {
    PrintError(error.what());
  }
  EndAtOnce();
}

}  // namespace

Interruption::Interruption() {
  sigemptyset(&signals_);
  for (const int signal : {SIGINT, SIGTERM}) {
    if (IsIgnored(signal)) continue;
    sigaddset(&signals_, signal);
    wake_ = signal;
  }
  if (wake_ == 0) return;
  pthread_sigmask(SIG_BLOCK, &signals_, &blocked_before_);
  waiting_ = std::thread([this] { Wait(); });
}

Interruption::~Interruption() {
  if (wake_ == 0) return;
  is_over_ = true;
  pthread_kill(waiting_.native_handle(), wake_);
  waiting_.join();
  pthread_sigmask(SIG_SETMASK, &blocked_before_, nullptr);
}

void Interruption::EndWith(std::function<void()> last_words) {
  const std::scoped_lock lock(mutex_);
  last_words_ = std::move(last_words);
  if (last_words_ && is_requested_) EndAfter(last_words_);
}

void Interruption::Wait() {
  int signal = 0;
  while (sigwait(&signals_, &signal) == 0 && !is_over_) {
    if (is_requested_.exchange(true)) EndAtOnce();
    const std::scoped_lock lock(mutex_);
    if (last_words_) EndAfter(last_words_);
  }
}

}  // namespace rotslam
