#pragma once

#include <functional>

namespace rotslam {

/// Calls `work(index)` for 0 <= index < count on up to `num_threads` threads and returns when all
/// are done. Which thread takes which index is open, so `work` writes only to its own index: then
/// any number of threads gives the same answer. The first exception thrown by `work` (lowest index)
/// is thrown again here.
void ParallelFor(int count, int num_threads, const std::function<void(int)>& work);

}  // namespace rotslam
