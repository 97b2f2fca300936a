#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "rotodom/sequence/frames.h"

namespace rotslam {

/// How frames are handled that come faster than they are taken.
enum class Backlog {
  kDrop,  // the newest one replaces those that wait, as with a camera
  kWait,  // the source waits
};

/// Reads frames on a thread of its own.
class FramePump {
 public:
  /// Gives the next frame, nullopt after the last. Once `is_over` says so, it returns soon.
  using Source = std::function<std::optional<Frame>(const std::function<bool()>& is_over)>;

  FramePump(Source source, Backlog backlog);
  ~FramePump();
  FramePump(const FramePump&) = delete;
  FramePump& operator=(const FramePump&) = delete;

  /// The next frame, waiting for it; nullopt after the last, or once `should_stop` says so. Throws
  /// what the source has thrown.
  std::optional<Frame> Next(const std::function<bool()>& should_stop);

  /// Frames that were left out so far.
  int num_dropped() const;

 private:
  void Read(const Source& source);

  Backlog backlog_;
  mutable std::mutex mutex_;  // of what follows, up to the thread
  std::condition_variable changed_;
  std::deque<Frame> frames_;
  bool is_over_ = false;    // nobody takes frames any more
  bool has_ended_ = false;  // the source
  std::exception_ptr problem_;
  int num_dropped_ = 0;
  std::thread thread_;
};

/// Gives the frames of another source at the pace of their timestamps, the first one at once.
FramePump::Source Paced(FramePump::Source source);

}  // namespace rotslam
