#include "rotodom/types/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace rotslam {

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
  const auto run = [&] {
    for (int first = next.fetch_add(share); first < count; first = next.fetch_add(share)) {
      for (int index = first; index < std::min(first + share, count); ++index) {
        try {
          work(index);
        } catch (...) {
          errors[index] = std::current_exception();
        }
      }
    }
  };
  {
    std::vector<std::jthread> workers;
    for (int k = 1; k < num_workers; ++k) workers.emplace_back(run);
    run();
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace rotslam
