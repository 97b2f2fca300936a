#pragma once

#include <array>
#include <csignal>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

namespace rotslam {

/// A program that runs beside the test, with its standard error at hand as it comes.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments) {
    std::vector<std::string> words = {ROTSLAM_EXECUTABLE};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::array<int, 2> ends = {};
    EXPECT_EQ(pipe(ends.data()), 0);
    child_ = fork();
    if (child_ == 0) {
      // Whoever runs the tests in the background may have them ignored.
      std::signal(SIGINT, SIG_DFL);
      std::signal(SIGTERM, SIG_DFL);
      dup2(ends[1], STDERR_FILENO);
      close(ends[0]);
      close(ends[1]);
      execv(argv[0], argv.data());
      _exit(127);
    }
    close(ends[1]);
    error_ = ends[0];
  }
  ~RunningProgram() {
    if (child_ > 0) kill(child_, SIGKILL);
    Finish();
  }
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  // Waits until standard error has shown `text`; false when the program ends without.
  bool WaitFor(const std::string& text) { return WaitForBehind(0, text); }
  // The same for what it shows from now on.
  bool WaitForNext(const std::string& text) { return WaitForBehind(shown_.size(), text); }

  void Send(int signal) const { kill(child_, signal); }
  const std::string& shown() const { return shown_; }

  // Exit code at the end; -1: a signal ended it.
  int Finish() {
    if (child_ <= 0) return exit_code_;
    while (ReadMore()) {
    }
    close(error_);
    int status = 0;
    waitpid(child_, &status, 0);
    child_ = -1;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return exit_code_;
  }

 private:
  bool WaitForBehind(std::size_t place, const std::string& text) {
    while (shown_.find(text, place) == std::string::npos) {
      if (!ReadMore()) return false;
    }
    return true;
  }

  bool ReadMore() {
    std::array<char, 4096> buffer = {};
    const ssize_t count = read(error_, buffer.data(), buffer.size());
    if (count > 0) shown_.append(buffer.data(), static_cast<std::size_t>(count));
    return count > 0;
  }

  pid_t child_ = -1;
  int error_ = -1;
  int exit_code_ = -1;
  std::string shown_;
};

}  // namespace rotslam
