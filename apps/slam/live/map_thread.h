#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <variant>

#include "apps/slam/live/live_mapper.h"

namespace rotslam {

/// Runs a LiveMapper on a thread of its own. A keyframe's map is taken over at a time that is fixed
/// when the keyframe is given, whether or not it was ready before: what a session emits does not
/// depend on the speed of the machine.
class MapThread {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  MapThread(const Camera& camera, const SlamOptions& options);
  ~MapThread();
  MapThread(const MapThread&) = delete;
  MapThread& operator=(const MapThread&) = delete;

  /// Hands a keyframe or loops to the mapper. The map after it is due at `due_s`, but not before
  /// the map of an earlier call.
  void Post(std::variant<KeyframeInput, LoopInput> input, double due_s);

  /// The newest map that is due by `now_s`, waiting for it where it is not ready; null where there
  /// is none. Throws what the mapper has thrown.
  std::shared_ptr<const LiveMap> TakeDue(double now_s);

  /// Time that TakeDue has waited, s.
  double waited_s() const { return waited_s_; }

 private:
  struct Done {
    std::shared_ptr<const LiveMap> map;
    std::exception_ptr problem;
  };

  void Work();

  LiveMapper mapper_;
  std::mutex mutex_;  // of what follows, up to the thread
  std::condition_variable changed_;
  std::deque<std::variant<KeyframeInput, LoopInput>> jobs_;  // not begun
  std::deque<Done> done_;                                    // not taken, oldest first
  bool is_over_ = false;
  // Of the caller's thread.
  std::deque<double> due_s_;  // of everything given and not taken, oldest first
  std::shared_ptr<const LiveMap> taken_;
  double waited_s_ = 0.0;
  std::thread thread_;
};

}  // namespace rotslam
