#include "apps/batch/children.h"

#include <array>
#include <cerrno>
#include <ctime>
#include <optional>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "rotodom/types/stopwatch.h"

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
  end.wall_s = SecondsSince(start);
  end.max_memory_kb = usage.ru_maxrss;
  return end;
}

bool OpenAs(int number, const char* path, int flags) {
  const int file = open(path, flags, 0666);
  if (file < 0 || file == number) return file == number;
  const bool done = dup2(file, number) == number;
  close(file);
  return done;
}

// Makes the child that was just forked the program. Allocates nothing: another thread may have held
// the lock that takes. Comes back only with the number of what the system refused.
int Become(const std::vector<char*>& argv, const char* log, const sigset_t& mask, pid_t parent) {
  // Else a run would go on unseen and write where the next batch does. It leaves a checkpoint.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) return ESRCH;  // killed before that
  // A group of its own, so that a terminal's Ctrl-C comes once: from us.
  setpgid(0, 0);
  if (!OpenAs(STDIN_FILENO, "/dev/null", O_RDONLY) ||
      !OpenAs(STDOUT_FILENO, log, O_WRONLY | O_CREAT | O_TRUNC) ||
      dup2(STDOUT_FILENO, STDERR_FILENO) < 0) {
    return errno;
  }
  pthread_sigmask(SIG_SETMASK, &mask, nullptr);
  execv("/proc/self/exe", argv.data());
  return errno;
}

// Forks and makes the child the program; throws std::system_error when the system refuses.
pid_t Spawn(const std::vector<char*>& argv, const char* log, const sigset_t& mask) {
  std::array<int, 2> ends = {};  // of a pipe that closes with exec, or first says why there is none
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::system_error(errno, std::generic_category());
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) {
    const int error = Become(argv, log, mask, parent);
    if (write(ends[1], &error, sizeof(error)) < 0) _exit(126);
    _exit(127);
  }
  int error = child < 0 ? errno : 0;
  close(ends[1]);
  if (child > 0 && read(ends[0], &error, sizeof(error)) > 0) waitpid(child, nullptr, 0);
  close(ends[0]);
  if (error != 0) throw std::system_error(error, std::generic_category());
  return child;
}

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
  const Clock::time_point start = Clock::now();
  try {
    running_[Spawn(argv, log.c_str(), mask_before_)] = {id, start};
  } catch (const std::system_error& error) {
    throw std::runtime_error(
        log.string() + ": cannot start a process that prints there: " + error.code().message());
  }
}

std::optional<std::pair<int, ChildEnd>> Children::Wait(std::chrono::milliseconds at_most) {
  if (running_.empty()) throw std::invalid_argument("no child runs");
  const Clock::time_point deadline = Clock::now() + at_most;
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
    const auto left = std::chrono::duration_cast<std::chrono::nanoseconds>(deadline - Clock::now());
    if (left.count() <= 0) return std::nullopt;
    constexpr std::int64_t kSecond = 1'000'000'000;
    const timespec time{left.count() / kSecond, left.count() % kSecond};
    // A child that ended since has left its signal, which comes now.
    if (const int signal = sigtimedwait(&signals_, nullptr, &time); signal > 0) Take(signal);
  }
}

std::map<int, ChildTimes> Children::TimesSoFar() const {
  std::map<int, ChildTimes> times;
  for (const auto& [pid, child] : running_) {
    clockid_t clock{};
    timespec cpu{};
    if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &cpu) != 0) continue;
    times[child.id] = {static_cast<double>(cpu.tv_sec) + 1e-9 * static_cast<double>(cpu.tv_nsec),
                       SecondsSince(child.start)};
  }
  return times;
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
