#include "apps/cli/live/frame_pump.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

// Where the source waits, it is so many frames ahead.
constexpr std::size_t kMaxWaiting = 4;
// A request to stop is noticed within this.
constexpr auto kPatience = std::chrono::milliseconds(50);

}  // namespace

FramePump::FramePump(Source source, Backlog backlog)
    : backlog_(backlog), thread_([this, from = std::move(source)] { Read(from); }) {}

FramePump::~FramePump() {
  {
    const std::scoped_lock lock(mutex_);
    is_over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

std::optional<Frame> FramePump::Next(const std::function<bool()>& should_stop) {
  std::unique_lock lock(mutex_);
  while (!should_stop()) {
    if (!frames_.empty()) {
      Frame frame = std::move(frames_.front());
      frames_.pop_front();
      changed_.notify_all();
      return frame;
    }
    if (problem_) std::rethrow_exception(problem_);
    if (has_ended_) return std::nullopt;
    changed_.wait_for(lock, kPatience);
  }
  return std::nullopt;
}

int FramePump::num_dropped() const {
  const std::scoped_lock lock(mutex_);
  return num_dropped_;
}

void FramePump::Read(const Source& source) {
  const auto is_over = [this] {
    const std::scoped_lock lock(mutex_);
    return is_over_;
  };
  std::exception_ptr problem;
  try {
    while (std::optional<Frame> frame = source(is_over)) {
      std::unique_lock lock(mutex_);
      if (backlog_ == Backlog::kWait) {
        changed_.wait(lock, [this] { return is_over_ || frames_.size() < kMaxWaiting; });
      } else {
        num_dropped_ += static_cast<int>(frames_.size());
        frames_.clear();
      }
      if (is_over_) return;
      frames_.push_back(*std::move(frame));
      changed_.notify_all();
    }
  } catch (...) {
    problem = std::current_exception();
  }
  {
    const std::scoped_lock lock(mutex_);
    has_ended_ = true;
    problem_ = problem;
  }
  changed_.notify_all();
}

FramePump::Source Paced(FramePump::Source source) {
  struct Pace {
    FramePump::Source source;
    std::optional<Clock::time_point> start;
    double first_s = 0.0;
  };
  const auto pace = std::make_shared<Pace>();
  pace->source = std::move(source);
  return [pace](const std::function<bool()>& is_over) -> std::optional<Frame> {
    std::optional<Frame> frame = pace->source(is_over);
    if (!frame) return std::nullopt;
    if (!pace->start) {
      pace->start = Clock::now();
      pace->first_s = frame->timestamp_s;
    }
    const auto due =
        *pace->start + std::chrono::duration_cast<Clock::duration>(
                           std::chrono::duration<double>(frame->timestamp_s - pace->first_s));
    while (!is_over() && Clock::now() < due) {
      std::this_thread::sleep_until(std::min(due, Clock::now() + Clock::duration(kPatience)));
    }
    return frame;
  };
}

}  // namespace rotslam
