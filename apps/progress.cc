#include "apps/progress.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <sys/ioctl.h>
#include <unistd.h>

namespace rotslam {
namespace {

// How often the line is renewed on a terminal, and a plain line is written elsewhere.
constexpr std::chrono::milliseconds kTerminalInterval(100);
constexpr std::chrono::seconds kPlainInterval(5);

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

Progress::Progress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

void Progress::Say(const std::string& line) {
  if (quiet_) return;
  ClearLine();
  std::fprintf(stderr, "%s\n", line.c_str());
}

void Progress::Warn(const std::string& line) {
  ClearLine();
  std::fprintf(stderr, "rotslam: warning: %s\n", line.c_str());
}

void Progress::StartStage(const std::string& name, int total) {
  stage_ = name;
  total_ = total;
  done_ = 0;
  started_ = shown_ = Clock::now();
  if (terminal_ && !quiet_) Renew(stage_ + " ...");
}

void Progress::Step(int done, const std::string& note) {
  done_ = done;
  if (quiet_) return;
  const auto now = Clock::now();
  if (terminal_ ? now - shown_ < kTerminalInterval : now - shown_ < kPlainInterval) return;
  shown_ = now;
  std::string line = stage_ + "  " + Figures(done);
  if (!note.empty()) line += "  " + note;
  if (terminal_) {
    Renew(line);
  } else {
    std::fprintf(stderr, "%s\n", line.c_str());
  }
}

void Progress::EndStage(const std::string& note) {
  if (quiet_) return;
  ClearLine();
  char seconds[32];
  std::snprintf(seconds, sizeof(seconds), "%.1f s", SecondsSince(started_));
  std::fprintf(
      stderr, "%s: %s%s%s\n", stage_.c_str(), note.c_str(), note.empty() ? "" : ", ", seconds);
}

std::string Progress::Figures(int done) const {
  char text[128];
  const double seconds = std::max(SecondsSince(started_), 1e-6);
  const double fps = done / seconds;
  if (total_ > 0 && fps > 0.0) {
    const int eta = static_cast<int>(std::lround((total_ - done) / fps));
    std::snprintf(
        text, sizeof(text), "%d/%d  %.1f fps  ETA %d:%02d", done, total_, fps, eta / 60, eta % 60);
  } else {
    std::snprintf(text, sizeof(text), "%d  %.1f fps", done, fps);
  }
  return text;
}

void Progress::Renew(const std::string& line) {
  // A line that wraps could not be taken back.
  winsize window{};
  const bool is_known = ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1;
  const int width = is_known ? window.ws_col - 1 : 79;
  std::fprintf(stderr, "\r\033[K%.*s", width, line.c_str());
  std::fflush(stderr);
  line_open_ = true;
}

void Progress::ClearLine() {
  if (!line_open_) return;
  std::fprintf(stderr, "\r\033[K");
  line_open_ = false;
}

}  // namespace rotslam
