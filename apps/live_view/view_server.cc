#include "apps/live_view/view_server.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>

#include <arpa/inet.h>
#include <httplib.h>
#include <unistd.h>

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

// For pages, and for connections that a browser opens in advance.
constexpr int kNumOtherThreads = 4;

// A piece fits into the socket's buffer whenever the socket is writable at all, so that no call to
// send waits long.
constexpr std::size_t kPieceBytes = 4096;

// A browser that takes nothing for so long is disconnected; it comes back by itself.
constexpr std::chrono::seconds kPatience{5};

// How long one look at a socket takes at most: how long Stop may have to wait.
constexpr int kLookMicroseconds = 100'000;

// No signal is handled in threads that are started while this lives. The one that broken
// connections cause is ignored there alone: for the program it keeps its meaning.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
    sigaction(SIGPIPE, nullptr, &broken_pipe_);
  }
  ~SignalsBlocked() {
    // httplib has changed it.
    sigaction(SIGPIPE, &broken_pipe_, nullptr);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_ = {};
  struct sigaction broken_pipe_ = {};
};

bool IsIpAddress(const std::string& host) {
  unsigned char buffer[sizeof(in6_addr)];
  return inet_pton(AF_INET, host.c_str(), buffer) == 1 ||
         inet_pton(AF_INET6, host.c_str(), buffer) == 1;
}

std::string LowerCase(std::string text) {
  std::transform(
      text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// The host of a header `Host: name:port` or `[address]:port`.
std::string HostOf(const std::string& header) {
  std::string host = header.substr(0, header.rfind(':'));
  if (header.starts_with('[')) {
    host = header.substr(1, std::max<std::size_t>(1, header.find(']')) - 1);
  }
  return LowerCase(host);
}

// As the network calls it; empty where it has no name.
std::string NameOfThisMachine() {
  char name[HOST_NAME_MAX + 1] = {};
  if (gethostname(name, sizeof(name) - 1) != 0) return "";
  return LowerCase(name);
}

// A site that has its own name point here comes under that name.
bool IsOurs(const std::string& host, const std::string& address) {
  if (host == "localhost" || host == LowerCase(address) || IsIpAddress(host)) return true;
  const std::string machine = NameOfThisMachine();
  return !machine.empty() && (host == machine || host.starts_with(machine + "."));
}

std::string WhyNot(const std::string& address, int port, int error) {
  const std::string place = address + ":" + std::to_string(port);
  if (error == EADDRINUSE) {
    return "the page cannot be shown at " + place +
           ": the port is in use; give another port, or 0 for any free one";
  }
  if (error == EACCES) {
    return "the page cannot be shown at " + place +
           ": ports below 1024 are reserved; give a higher one, or 0 for any free one";
  }
  return "the page cannot be shown at " + place +
         ": this is no address of this machine; 127.0.0.1 always is";
}

}  // namespace

class ViewServer::Impl {
 public:
  Impl(std::string address, int port, ViewContent content)
      : address_(std::move(address)), content_(std::move(content)) {
    if (port < 0 || port > 65535) {
      throw std::runtime_error("the page cannot be shown at port " + std::to_string(port) +
                               ": ports are 1 to 65535, or 0 for any free one");
    }
    const SignalsBlocked blocked;
    server_ = std::make_unique<httplib::Server>();
    Configure();
    // httplib's own choice would let two programs share a port.
    server_->set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    errno = 0;
    port_ = port;
    if (port == 0) {
      port_ = server_->bind_to_any_port(address_);
    } else if (!server_->bind_to_port(address_, port)) {
      port_ = -1;
    }
    if (port_ < 0) throw std::runtime_error(WhyNot(address_, port, errno));
    thread_ = std::thread([this] { server_->listen_after_bind(); });
    // To stop it has an effect only then.
    while (!server_->is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  ~Impl() { Stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  int port() const { return port_; }

  void Stop() {
    is_over_ = true;
    server_->stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  using Handled = httplib::Server::HandlerResponse;

  void Configure() {
    server_->new_task_queue = [] {
      return new httplib::ThreadPool(kMaxStreams + kNumOtherThreads);
    };
    // A connection for each request: an idle one would keep a thread.
    server_->set_keep_alive_max_count(1);
    server_->set_keep_alive_timeout(1);
    server_->set_read_timeout(1);
    server_->set_write_timeout(0, kLookMicroseconds);
    server_->set_payload_max_length(0);
    server_->set_tcp_nodelay(true);
    server_->set_default_headers(
        {{"Cache-Control", "no-store"},
         {"X-Content-Type-Options", "nosniff"},
         {"Referrer-Policy", "no-referrer"},
         {"Content-Security-Policy",
          "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
          "img-src data:; connect-src 'self'; frame-ancestors 'none'"}});
    server_->set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          return Refuse(request, response);
        });
    server_->Get("/", [this](const httplib::Request&, httplib::Response& response) {
      // With a length, which keeps it from being compressed at every request.
      response.set_content_provider(
          content_.page.size(),
          "text/html; charset=utf-8",
          [this](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
            return Send(std::string_view(content_.page).substr(offset, length), sink);
          });
    });
    server_->Get("/events", [this](const httplib::Request&, httplib::Response& response) {
      OpenStream(response);
    });
  }

  Handled Refuse(const httplib::Request& request, httplib::Response& response) const {
    if (request.method != "GET") {
      response.status = 405;
      response.set_header("Allow", "GET");
      response.set_content("This page can only be read.\n", "text/plain");
      return Handled::Handled;
    }
    if (!IsOurs(HostOf(request.get_header_value("Host")), address_)) {
      response.status = 403;
      response.set_content("Open this page by its address.\n", "text/plain");
      return Handled::Handled;
    }
    return Handled::Unhandled;
  }

  void OpenStream(httplib::Response& response) {
    // Counts until the last copy of the provider has gone.
    if (++num_streams_ > kMaxStreams) {
      --num_streams_;
      response.status = 503;
      response.set_content("Too many pages are open.\n", "text/plain");
      return;
    }
    const std::shared_ptr<void> counted(nullptr, [this](void*) { --num_streams_; });
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, counted, next = content_.open_stream()](std::size_t, httplib::DataSink& sink) {
          const ViewText text = next();
          if (!Send(text.text, sink)) return false;
          if (text.is_last) sink.done();
          return true;
        });
  }

  // Piece by piece, so that a browser that takes nothing holds up neither this thread for long nor
  // Stop.
  bool Send(std::string_view text, httplib::DataSink& sink) const {
    while (!text.empty()) {
      const Clock::time_point begin = Clock::now();
      for (Clock::time_point look = begin; !sink.is_writable(); look = Clock::now()) {
        const Clock::time_point now = Clock::now();
        // Only for a connection that is there it takes its time.
        const bool is_gone = now - look < std::chrono::microseconds(kLookMicroseconds / 2);
        if (is_over_ || is_gone || now - begin > kPatience) return false;
      }
      if (is_over_) return false;
      const std::string_view piece = text.substr(0, kPieceBytes);
      if (!sink.write(piece.data(), piece.size())) return false;
      text.remove_prefix(piece.size());
    }
    return true;
  }

  std::string address_;
  ViewContent content_;
  std::unique_ptr<httplib::Server> server_;
  int port_ = -1;
  std::atomic<bool> is_over_ = false;
  std::atomic<int> num_streams_ = 0;
  std::thread thread_;
};

ViewServer::ViewServer(const std::string& address, int port, ViewContent content)
    : impl_(std::make_unique<Impl>(address, port, std::move(content))) {}

ViewServer::~ViewServer() = default;

int ViewServer::port() const { return impl_->port(); }

void ViewServer::Stop() { impl_->Stop(); }

}  // namespace rotslam
