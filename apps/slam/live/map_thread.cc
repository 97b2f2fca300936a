#include "apps/slam/live/map_thread.h"

#include <algorithm>
#include <utility>

#include "rotodom/types/stopwatch.h"

#ifdef __linux__
#include <sys/resource.h>
#include <unistd.h>
#endif

namespace rotslam {
namespace {

// Frames come first: where the cores do not suffice for both, the map takes what frames leave.
void LowerPriority() {
#ifdef __linux__
  // Of this thread, as only Linux has it. Failure does no harm.
  constexpr int kSteps = 5;
  const int priority = getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), priority + kSteps);
#endif
}

}  // namespace

MapThread::MapThread(const Camera& camera, const SlamOptions& options)
    : mapper_(camera, options), thread_([this] { Work(); }) {}

MapThread::~MapThread() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void MapThread::Post(std::variant<KeyframeInput, LoopInput> input, double due_s) {
  due_s_.push_back(due_s_.empty() ? due_s : std::max(due_s, due_s_.back()));
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(input));
  }
  changed_.notify_all();
}

std::shared_ptr<const LiveMap> MapThread::TakeDue(double now_s) {
  while (!due_s_.empty() && due_s_.front() <= now_s) {
    due_s_.pop_front();
    const Stopwatch stopwatch(waited_s_);
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return !done_.empty(); });
    const Done done = std::move(done_.front());
    done_.pop_front();
    if (done.problem) std::rethrow_exception(done.problem);
    taken_ = done.map;
  }
  return taken_;
}

void MapThread::Work() {
  LowerPriority();
  while (true) {
    std::variant<KeyframeInput, LoopInput> input;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return is_over_ || !jobs_.empty(); });
      if (is_over_) return;
      input = std::move(jobs_.front());
      jobs_.pop_front();
    }
    Done done;
    try {
      const auto* keyframe = std::get_if<KeyframeInput>(&input);
      done.map = keyframe != nullptr ? mapper_.AddKeyframe(*keyframe)
                                     : mapper_.CloseLoops(std::get<LoopInput>(input));
    } catch (...) {
      done.problem = std::current_exception();
    }
    {
      const std::lock_guard lock(mutex_);
      done_.push_back(std::move(done));
    }
    changed_.notify_all();
  }
}

}  // namespace rotslam
