#pragma once

#include <memory>
#include <string>

#include "apps/live_view/live_view_frame.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

struct LiveViewOptions {
  // Who may open the page: by default only this machine. 0.0.0.0: whoever reaches it.
  std::string address = "127.0.0.1";
  int port = 8080;  // 0: any free one
};

/// A page in the browser that shows a live session: map, path, image, orientations with their
/// standard deviations, numbers. It works without a network, and nothing can be changed through it.
/// Browsers may come, go and be slow as they like; the session does not notice. Frames are shown
/// from one thread. Memory: that of the newest map once more, at most 100,000 points of it; the
/// rest is bounded.
class LiveView {
 public:
  /// Serves the page from now on. Throws std::runtime_error, in one line for people, where the
  /// address or the port cannot be had.
  LiveView(const Camera& camera, const LiveViewOptions& options);
  /// As Finish, and closes all connections, within a second.
  ~LiveView();
  LiveView(const LiveView&) = delete;
  LiveView& operator=(const LiveView&) = delete;

  /// Shows a frame. It copies and returns; all work is done on other threads, which leave frames
  /// out where they come too fast. Images are taken some ten times per second.
  void Show(const LiveViewFrame& frame);

  /// The session is over: the page says so and keeps what it shows, also where it is opened only
  /// now. No frame may be shown afterwards.
  void Finish();

  int port() const;
  /// The address of the page for a browser on this machine.
  std::string url() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rotslam
