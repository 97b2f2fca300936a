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

// Other threads may be running, so no destructors are called.
[[noreturn]] void EndAtOnce() {
  RemoveTemporaryFiles();
  _exit(Interruption::kExitCode);
}

[[noreturn]] void EndAfter(const std::function<void()>& end_at_interruption) {
  try {
    end_at_interruption();
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

void Interruption::EndWith(std::function<void()> end_at_interruption) {
  const std::scoped_lock lock(mutex_);
  at_end_ = std::move(end_at_interruption);
  if (at_end_ && is_requested_) EndAfter(at_end_);
}

void Interruption::Wait() {
  int signal = 0;
  while (sigwait(&signals_, &signal) == 0 && !is_over_) {
    if (is_requested_.exchange(true)) EndAtOnce();
    const std::scoped_lock lock(mutex_);
    if (at_end_) EndAfter(at_end_);
  }
}

}  // namespace rotslam
