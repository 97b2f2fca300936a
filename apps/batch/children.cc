#include "apps/batch/children.h"

#include <cerrno>
#include <ctime>
#include <optional>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

double Seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

ChildEnd Describe(int status, const rusage& usage, Clock::time_point start) {
  ChildEnd end;
  end.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  end.cpu_s = Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
  end.wall_s = std::chrono::duration<double>(Clock::now() - start).count();
  end.max_memory_kb = usage.ru_maxrss;
  return end;
}

// What posix_spawn takes, freed at the end.
struct SpawnSetup {
  SpawnSetup(const std::filesystem::path& log, const sigset_t& mask) {
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(
        &actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    posix_spawnattr_init(&attributes);
    // A group of its own, so that a terminal's Ctrl-C comes once: from us.
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setsigmask(&attributes, &mask);
  }
  ~SpawnSetup() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSetup(const SpawnSetup&) = delete;
  SpawnSetup& operator=(const SpawnSetup&) = delete;

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

}  // namespace

Children::Children() {
  sigemptyset(&signals_);
  for (const int signal : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&signals_, signal);
  pthread_sigmask(SIG_BLOCK, &signals_, &mask_before_);
}

Children::~Children() {
  for (const auto& [pid, child] : running_) kill(pid, SIGTERM);
  for (const auto& [pid, child] : running_) waitpid(pid, nullptr, 0);
  pthread_sigmask(SIG_SETMASK, &mask_before_, nullptr);
}

void Children::Start(int id,
                     const std::vector<std::string>& arguments,
                     const std::filesystem::path& log) {
  std::vector<std::string> words = {"rotslam"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const SpawnSetup setup(log, mask_before_);
  pid_t pid = 0;
  const Clock::time_point start = Clock::now();
  const int error =
      posix_spawn(&pid, "/proc/self/exe", &setup.actions, &setup.attributes, argv.data(), environ);
  if (error != 0) {
    throw std::runtime_error(log.string() + ": cannot start a process that prints there: " +
                             std::generic_category().message(error));
  }
  running_[pid] = {id, start};
}

std::pair<int, ChildEnd> Children::Wait() {
  if (running_.empty()) throw std::invalid_argument("no child runs");
  while (true) {
    for (auto child = running_.begin(); child != running_.end(); ++child) {
      int status = 0;
      rusage usage{};
      if (wait4(child->first, &status, WNOHANG, &usage) != child->first) continue;
      const std::pair<int, ChildEnd> ended(child->second.id,
                                           Describe(status, usage, child->second.start));
      running_.erase(child);
      return ended;
    }
    // A child that ended since has left its signal, which comes now.
    if (const int signal = sigwaitinfo(&signals_, nullptr); signal > 0) Take(signal);
  }
}

void Children::Poll() {
  const timespec now{};
  for (int signal = 0; (signal = sigtimedwait(&signals_, nullptr, &now)) > 0;) Take(signal);
}

void Children::Take(int signal) {
  if (signal == SIGCHLD) return;
  interrupted_ = true;
  for (const auto& [pid, child] : running_) kill(pid, signal);
}

}  // namespace rotslam
