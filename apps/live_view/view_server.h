#pragma once

#include <functional>
#include <memory>
#include <string>

namespace rotslam {

/// A piece of a stream of events.
struct ViewText {
  std::string text;
  bool is_last = false;  // the stream ends behind it
};

/// Gives the next message for a browser. It may wait some seconds for one.
using NextText = std::function<ViewText()>;

/// The pages and streams of a server.
struct ViewContent {
  std::string page;  // HTML, at /
  // Of a browser that opens the stream of events, at /events; it is called from the browser's own
  // thread until the browser is gone.
  std::function<NextText()> open_stream;
};

/// An HTTP server for a page and a stream of server-sent events. Browsers can only read: it answers
/// nothing but GET. Requests under the name of another site are refused, so that no page of that
/// site can read ours (DNS rebinding).
class ViewServer {
 public:
  /// So many browsers may read the stream at once; the next are told so.
  static constexpr int kMaxStreams = 8;

  /// Serves from now on. Throws std::runtime_error, in one line for people, where the address or
  /// the port cannot be had.
  ViewServer(const std::string& address, int port, ViewContent content);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  int port() const;

  /// Ends all connections, and serves no more. Waits for the threads; those within NextText have to
  /// return by themselves.
  void Stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace rotslam
