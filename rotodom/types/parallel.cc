#include "rotodom/types/parallel.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

namespace rotslam {
namespace {

// Threads that wait for work, so that a call wakes them up instead of starting new ones. There are
// as many as were ever wanted at once.
class WorkerPool {
 public:
  // Calls `run` here and on up to `num_others` waiting threads; returns when all have returned.
  void Run(int num_others, const std::function<void()>& run) {
    Job job{run, num_others};
    {
      const std::lock_guard lock(mutex_);
      jobs_.push_back(&job);
      num_wanted_ += num_others;
      while (num_idle_ < num_wanted_) Start();
    }
    wake_.notify_all();
    run();
    std::unique_lock lock(mutex_);
    if (job.num_open > 0) {
      num_wanted_ -= job.num_open;
      std::erase(jobs_, &job);
    }
    job.done.wait(lock, [&] { return job.num_running == 0; });
  }

 private:
  struct Job {
    const std::function<void()>& run;
    int num_open;  // threads that may still join
    int num_running = 0;
    std::condition_variable done = {};
  };

  void Start() {
    ++num_idle_;
    threads_.emplace_back([this](const std::stop_token& stop) { Work(stop); });
  }

  void Work(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (wake_.wait(lock, stop, [this] { return !jobs_.empty(); })) {
      Job& job = *jobs_.front();
      if (--job.num_open == 0) jobs_.pop_front();
      ++job.num_running;
      --num_wanted_;
      --num_idle_;
      lock.unlock();
      job.run();
      lock.lock();
      ++num_idle_;
      if (--job.num_running == 0) job.done.notify_one();
    }
  }

  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::deque<Job*> jobs_;
  int num_idle_ = 0;    // threads, those that have been woken up included
  int num_wanted_ = 0;  // by all jobs
  std::vector<std::jthread> threads_;
};

WorkerPool& Workers() {
  static WorkerPool workers;
  return workers;
}

}  // namespace

void ParallelFor(int count, int num_threads, const std::function<void(int)>& work) {
  const int num_workers = std::clamp(num_threads, 1, std::max(count, 1));
  if (num_workers == 1) {
    for (int index = 0; index < count; ++index) work(index);
    return;
  }
  // A counter that all want at once costs more than a small piece of work: several at a time, as
  // long as the last ones do not keep the others waiting.
  constexpr int kLeastShares = 64;
  const int share = std::max(count / (num_workers * kLeastShares), 1);
  std::atomic<int> next = 0;
  std::vector<std::exception_ptr> errors(count);
  Workers().Run(num_workers - 1, [&] {
    for (int first = next.fetch_add(share); first < count; first = next.fetch_add(share)) {
      for (int index = first; index < std::min(first + share, count); ++index) {
        try {
          work(index);
        } catch (...) {
          errors[index] = std::current_exception();
        }
      }
    }
  });
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace rotslam
