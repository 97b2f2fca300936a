#include "apps/cli/terminal/progress.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <spdlog/logger.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// Intervals between updates of the line on a terminal, and between plain lines elsewhere.
constexpr std::chrono::milliseconds kTerminalInterval(100);
constexpr std::chrono::seconds kPlainInterval(10);
// Interval between updates of a stage without steps.
constexpr std::chrono::seconds kTickInterval(1);

// Name under which PrintError finds the log.
constexpr const char* kLogName = "rotslam";

// Select graphic rendition, ECMA-48.
constexpr const char* kBold = "1";
constexpr const char* kRed = "1;31";
constexpr const char* kYellow = "1;33";

std::string Environment(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): nobody sets it
  return value == nullptr ? "" : value;
}

bool ColoursAreWanted() {
  const std::string terminal = Environment("TERM");
  return isatty(STDERR_FILENO) != 0 && Environment("NO_COLOR").empty() && !terminal.empty() &&
         terminal != "dumb";
}

std::string Coloured(const std::string& text, const char* colour, bool is_wanted) {
  return is_wanted ? "\033[" + std::string(colour) + "m" + text + "\033[0m" : text;
}

std::shared_ptr<spdlog::logger> OpenLog(const std::string& path) {
  if (path.empty()) return nullptr;
  try {
    constexpr bool kTruncate = true;
    auto log = std::make_shared<spdlog::logger>(
        kLogName, std::make_shared<spdlog::sinks::basic_file_sink_mt>(path, kTruncate));
    log->set_pattern("%Y-%m-%d %H:%M:%S.%e %-7l %v");
    log->set_level(spdlog::level::debug);
    log->flush_on(spdlog::level::debug);
    return log;
  } catch (const spdlog::spdlog_ex&) {
    throw std::runtime_error(path + ": cannot write the log file (--log)");
  }
}

// Replaces control characters, so that file names and contents cannot control the terminal: bytes
// below a blank, 127, and in UTF-8 U+0080 to U+009F. Very long messages are cut.
std::string Printable(std::string text) {
  constexpr std::size_t kMaxLength = 2000;
  if (text.size() > kMaxLength) text = text.substr(0, kMaxLength) + "...";
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '\n') {
      text[k] = ' ';
    } else if (byte(k) < 0x20 || byte(k) == 0x7f) {
      text[k] = '?';
    } else if (byte(k) == 0xc2 && k + 1 < text.size() && byte(k + 1) >= 0x80 &&
               byte(k + 1) < 0xa0) {
      text.replace(k, 2, "?");
    }
  }
  return text;
}

// The first `width` columns of a text; continuation bytes of UTF-8 have no width.
std::string_view FirstColumns(std::string_view text, std::size_t width) {
  std::size_t columns = 0;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const bool begins = (static_cast<unsigned char>(text[k]) & 0xc0U) != 0x80U;
    if (begins && ++columns > width) return text.substr(0, k);
  }
  return text;
}

// Width of a line that can be overwritten: a wrapped line cannot.
std::size_t WidthOfLine() {
  winsize window{};
  const bool is_known = ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1;
  return is_known ? window.ws_col - 1 : 79;
}

template <class... Arguments>
std::string Formatted(const char* format, Arguments... arguments) {
  std::array<char, 64> text = {};
  std::snprintf(text.data(), text.size(), format, arguments...);
  return text.data();
}

std::string Duration(double seconds) {
  const auto whole = static_cast<int>(std::lround(std::min(seconds, 3.5e6)));
  const int minutes = whole / 60;
  if (minutes < 60) return Formatted("%d:%02d", minutes, whole % 60);
  return Formatted("%d:%02d:%02d", minutes / 60, minutes % 60, whole % 60);
}

}  // namespace

Progress::Progress(const CommonFlags& flags)
    : quiet_(flags.quiet),
      verbose_(flags.verbose && !flags.quiet),
      terminal_(isatty(STDERR_FILENO) != 0),
      colour_(ColoursAreWanted()),
      log_(OpenLog(flags.log)) {
  // Registered so that PrintError finds the log, even after this object is destroyed by an
  // exception on its way to main.
  if (log_) spdlog::register_logger(log_);
  if (terminal_ && !quiet_) ticker_ = std::thread([this] { Tick(); });
}

Progress::~Progress() {
  {
    const std::scoped_lock lock(mutex_);
    ending_ = true;
    ClearLine();
  }
  wake_.notify_all();
  if (ticker_.joinable()) ticker_.join();
}

void Progress::Say(const std::string& line) {
  const std::scoped_lock lock(mutex_);
  const std::string text = Printable(line);
  if (log_) log_->info("{}", text);
  if (!quiet_) Print(text);
}

void Progress::Warn(const std::string& line) {
  const std::scoped_lock lock(mutex_);
  const std::string text = Printable(line);
  if (log_) log_->warn("{}", text);
  Print(Coloured("rotslam: warning:", kYellow, colour_) + " " + text);
}

void Progress::Detail(const std::string& line) {
  const std::scoped_lock lock(mutex_);
  const std::string text = Printable(line);
  if (log_) log_->debug("{}", text);
  if (verbose_) Print(text);
}

void Progress::StartStage(const std::string& name, int total) {
  const std::scoped_lock lock(mutex_);
  stage_ = name;
  total_ = total;
  done_ = 0;
  counters_.clear();
  started_ = shown_ = Clock::now();
  stage_open_ = true;
  if (log_) log_->debug("{} begins", name);
  if (terminal_ && !quiet_) Renew();
}

void Progress::Step(int done, const std::vector<std::string>& counters) {
  const std::scoped_lock lock(mutex_);
  done_ = done;
  counters_ = counters;
  if (quiet_) return;
  const auto now = Clock::now();
  if (terminal_ ? now - shown_ < kTerminalInterval : now - shown_ < kPlainInterval) return;
  if (terminal_) {
    Renew();
    return;
  }
  shown_ = now;
  std::string line = stage_;
  for (const std::string& figure : Figures()) line += "  " + figure;
  Print(line);
}

void Progress::EndStage(const std::string& note) {
  const std::scoped_lock lock(mutex_);
  stage_open_ = false;
  const std::string end =
      ": " + note + (note.empty() ? "" : ", ") + Formatted("%.1f s", SecondsSince(started_));
  if (log_) log_->info("{}{}", stage_, end);
  if (!quiet_) Print(Coloured(stage_, kBold, colour_) + end);
}

std::vector<std::string> Progress::Figures() const {
  const double seconds = std::max(SecondsSince(started_), 1e-6);
  if (done_ == 0) {
    return seconds < 1.0 ? std::vector<std::string>{"..."}
                         : std::vector<std::string>{Formatted("%.0f s", seconds)};
  }
  const double fps = done_ / seconds;
  std::vector<std::string> figures;
  figures.push_back(std::to_string(done_) + (total_ > 0 ? "/" + std::to_string(total_) : ""));
  figures.push_back(Formatted(fps < 100.0 ? "%.1f fps" : "%.0f fps", fps));
  if (total_ > 0) figures.push_back("ETA " + Duration(std::max(0, total_ - done_) / fps));
  figures.insert(figures.end(), counters_.begin(), counters_.end());
  return figures;
}

void Progress::Renew() {
  shown_ = Clock::now();
  const std::size_t width = WidthOfLine();
  const std::string name(FirstColumns(stage_, width));
  std::string rest;
  for (const std::string& figure : Figures()) {
    if (name.size() + rest.size() + 2 + figure.size() > width) break;
    rest += "  " + figure;
  }
  std::fprintf(stderr, "\r\033[K%s%s", Coloured(name, kBold, colour_).c_str(), rest.c_str());
  std::fflush(stderr);
  line_open_ = true;
}

void Progress::Print(const std::string& line) {
  ClearLine();
  std::fprintf(stderr, "%s\n", line.c_str());
}

void Progress::ClearLine() {
  if (!line_open_) return;
  std::fprintf(stderr, "\r\033[K");
  line_open_ = false;
}

void Progress::Tick() {
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kTickInterval, [this] { return ending_; })) {
    if (stage_open_ && Clock::now() - shown_ >= kTickInterval) Renew();
  }
}

void PrintError(std::string message) {
  // Messages of other libraries may have several lines; ours have one.
  while (!message.empty() && message.back() == '\n') message.pop_back();
  message = Printable(message);
  if (const auto log = spdlog::get(kLogName)) log->error("{}", message);
  std::fprintf(
      stderr, "%s %s\n", Coloured("rotslam:", kRed, ColoursAreWanted()).c_str(), message.c_str());
}

}  // namespace rotslam
