#include "apps/live_view/live_view.h"

#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <unistd.h>

#include "apps/live_view/view_state.h"
#include "apps/page/page_parts.h"
#include "rotodom/types/stopwatch.h"
#include "tests/apps/live_view/made_up_session.h"

namespace rotslam {
namespace {

using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kHost = "127.0.0.1";

std::string FromBase64(const std::string& text) {
  static const std::string kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned word = 0;
  int num_bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    word = (word << 6) | static_cast<unsigned>(kDigits.find(c));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes += static_cast<char>((word >> num_bits) & 255U);
  }
  return bytes;
}

template <class T>
std::vector<T> Decoded(const Json& array) {
  const std::string bytes = FromBase64(array.at("data").get<std::string>());
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

// What a browser knows of the session from the messages it got.
class Browser {
 public:
  void Take(const Json& message) {
    if (message.contains("whole")) *this = Browser();
    ++num_messages_;
    if (message.contains("samples")) {
      for (const int frame : Decoded<std::int32_t>(message.at("samples").at("frame"))) {
        frames.push_back(frame);
      }
    }
    if (message.contains("map")) {
      const Json& map = message.at("map");
      revision = map.at("revision");
      TakeRows(map.at("points"), position);
      TakeRows(map.at("keyframes"), keyframe_position);
    }
    if (message.contains("image")) last_image = message.at("image").at("frame");
    finished = message.at("finished");
  }

  int num_messages() const { return num_messages_; }

  std::vector<int> frames;
  std::vector<std::array<float, 3>> position;
  std::vector<std::array<float, 3>> keyframe_position;
  int revision = 0;
  int last_image = -1;
  bool finished = false;

 private:
  static void TakeRows(const Json& part, std::vector<std::array<float, 3>>& rows) {
    rows.resize(part.at("count").get<std::size_t>());
    const auto values = Decoded<float>(part.at("position"));
    std::vector<std::int32_t> at;
    if (part.contains("row")) at = Decoded<std::int32_t>(part.at("row"));
    for (std::size_t k = 0; 3 * k < values.size(); ++k) {
      rows.at(at.empty() ? k : at[k]) = {values[3 * k], values[3 * k + 1], values[3 * k + 2]};
    }
  }

  int num_messages_ = 0;
};

std::vector<std::array<float, 3>> Sorted(std::vector<std::array<float, 3>> rows) {
  std::sort(rows.begin(), rows.end());
  return rows;
}

std::array<float, 3> Single(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

void ExpectShows(const Browser& browser, const LiveMap& map) {
  std::vector<std::array<float, 3>> points;
  points.reserve(map.points.size());
  for (const LivePoint& point : map.points) points.push_back(Single(point.point_in_world));
  EXPECT_EQ(Sorted(browser.position), Sorted(points));
  ASSERT_EQ(browser.keyframe_position.size(), map.keyframes.size());
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    EXPECT_EQ(browser.keyframe_position[k], Single(map.keyframes[k].center_in_world));
  }
  EXPECT_EQ(browser.revision, map.revision);
}

// Reads the stream of events until `is_enough` or for 10 s.
Browser Listen(int port, const std::function<bool(const Browser&)>& is_enough) {
  Browser browser;
  std::string text;
  const Clock::time_point begin = Clock::now();
  httplib::Client client(kHost, port);
  client.Get("/events", [&](const char* bytes, std::size_t count) {
    text.append(bytes, count);
    for (std::size_t end = 0; (end = text.find("\n\n")) != std::string::npos;) {
      const std::string event = text.substr(0, end);
      text.erase(0, end + 2);
      if (event.starts_with("data: ")) browser.Take(Json::parse(event.substr(6)));
    }
    return !is_enough(browser) && SecondsSince(begin) < 10.0;
  });
  return browser;
}

TEST(FillPage, PutsPartsInPlaceOfMarks) {
  const std::vector<PagePart> parts = {{"{{a}}", "{{b}}"}, {"{{b}}", "2"}};
  EXPECT_EQ(FillPage("<{{b}}{{a}}{{b}}>", parts), "<2{{b}}2>");
  EXPECT_EQ(FillPage("no marks", parts), "no marks");
  EXPECT_THROW(FillPage("{{c}}", parts), std::logic_error);
}

TEST(ViewState, DeltasAddUpToTheMap) {
  ViewState state(SessionCamera());
  MadeUpSession session(50);
  Browser always;
  Browser seldom;
  ViewCursor always_cursor;
  ViewCursor seldom_cursor;
  std::size_t largest_delta = 0;
  for (int k = 0; k < 200; ++k) {
    const LiveViewFrame frame = session.Next();
    state.Add(frame.estimate, frame.stats);
    state.SetMap(frame.map);
    EXPECT_TRUE(state.IsAhead(always_cursor));
    const std::string message = state.TakeMessage(always_cursor);
    EXPECT_FALSE(state.IsAhead(always_cursor));
    if (k > 110) largest_delta = std::max(largest_delta, message.size());
    always.Take(Json::parse(message));
    if (k % 37 == 0) seldom.Take(Json::parse(state.TakeMessage(seldom_cursor)));
    if (frame.map) ExpectShows(always, *frame.map);
  }
  seldom.Take(Json::parse(state.TakeMessage(seldom_cursor)));
  ExpectShows(seldom, *session.map());
  ViewCursor late_cursor;
  const std::string whole = state.TakeMessage(late_cursor);
  Browser late;
  late.Take(Json::parse(whole));
  ExpectShows(late, *session.map());
  EXPECT_EQ(late.frames.size(), 200U);
  EXPECT_EQ(always.frames, late.frames);
  EXPECT_LT(3 * largest_delta, whole.size()) << "more than what is new was sent";
}

TEST(ViewState, StaysBoundedForAnHour) {
  ShownSamples samples;
  LiveEstimate estimate;
  for (int k = 0; k < 108'000; ++k) {
    estimate.frame = FrameId{k};
    estimate.timestamp_s = k / 30.0;
    samples.Add(estimate);
  }
  const auto frames = Decoded<std::int32_t>(Json(samples.After(-1)).at("frame"));
  EXPECT_LE(frames.size(),
            static_cast<std::size_t>(ShownSamples::kMaxOlder + 2 * ShownSamples::kNumNewest));
  EXPECT_GT(frames.size(), 2000U);
  EXPECT_EQ(frames.front(), 0);
  EXPECT_EQ(frames.back(), 107'999);
  int largest_step = 0;
  for (std::size_t k = 1; k < frames.size(); ++k) {
    largest_step = std::max(largest_step, frames[k] - frames[k - 1]);
  }
  EXPECT_LE(largest_step, 64);
}

TEST(ViewState, ThinsOutAVeryLargeMap) {
  LiveMap map;
  map.revision = 1;
  for (int k = 0; k < 250'000; ++k) map.points.push_back({TrackId{k}, {1.0 * k, 0.0, 1.0}, {}});
  ShownMap shown;
  shown.Update(map);
  EXPECT_LE(shown.num_points(), ShownMap::kMaxPoints);
  EXPECT_GT(shown.num_points(), ShownMap::kMaxPoints / 2);
}

TEST(LiveView, ServesItsPageAndNothingElse) {
  const LiveView view(SessionCamera(), {.port = 0});
  EXPECT_EQ(view.url(), "http://127.0.0.1:" + std::to_string(view.port()) + "/");
  httplib::Client client(kHost, view.port());
  const auto page = client.Get("/");
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_THAT(page->body, HasSubstr("<title>rotslam live</title>"));
  EXPECT_THAT(page->body, HasSubstr("new EventSource("));
  // Nothing comes from elsewhere.
  EXPECT_THAT(page->body, Not(HasSubstr("src=\"http")));
  EXPECT_THAT(page->body, Not(HasSubstr("href=\"http")));
  EXPECT_EQ(client.Get("/etc/passwd")->status, 404);
  EXPECT_EQ(client.Get("/../../etc/passwd")->status, 404);
  EXPECT_EQ(client.Post("/", "x=1", "text/plain")->status, 405);
  EXPECT_EQ(client.Put("/events", "x", "text/plain")->status, 405);
  EXPECT_EQ(client.Delete("/")->status, 405);
  for (const char* ours : {"localhost:80", "LOCALHOST", "[::1]:8080", "192.0.2.7:8080"}) {
    EXPECT_EQ(client.Get("/", httplib::Headers{{"Host", ours}})->status, 200) << ours;
  }
  EXPECT_EQ(client.Get("/", httplib::Headers{{"Host", "elsewhere.example"}})->status, 403);
  EXPECT_EQ(client.Get("/events", httplib::Headers{{"Host", "elsewhere.example:80"}})->status, 403);
}

TEST(LiveView, StreamsASession) {
  LiveView view(SessionCamera(), {.port = 0});
  MadeUpSession session(50);
  Browser browser;
  std::thread listener(
      [&] { browser = Listen(view.port(), [](const Browser& now) { return now.finished; }); });
  for (int k = 0; k < 150; ++k) {
    view.Show(session.Next());
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  view.Finish();
  listener.join();
  EXPECT_TRUE(browser.finished);
  EXPECT_GT(browser.num_messages(), 4);
  EXPECT_GT(browser.last_image, 60);
  EXPECT_EQ(browser.frames.size(), 150U);
  ExpectShows(browser, *session.map());
  const Browser late = Listen(view.port(), [](const Browser& now) { return now.last_image >= 0; });
  EXPECT_TRUE(late.finished);
  EXPECT_EQ(late.num_messages(), 1);
  ExpectShows(late, *session.map());
}

TEST(LiveView, TellsBrowsersOfItsEnd) {
  auto view = std::make_unique<LiveView>(SessionCamera(), LiveViewOptions{.port = 0});
  MadeUpSession session(50);
  view->Show(session.Next());
  std::atomic<int> num_messages = 0;
  Browser browser;
  std::thread listener([&, port = view->port()] {
    browser = Listen(port, [&](const Browser& now) {
      num_messages = now.num_messages();
      return false;
    });
  });
  while (num_messages == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const Clock::time_point begin = Clock::now();
  view.reset();
  listener.join();
  EXPECT_LT(SecondsSince(begin), 3.0);
  EXPECT_TRUE(browser.finished);
}

// Nobody has looked before.
TEST(LiveView, ShowsASessionThatIsOver) {
  LiveView view(SessionCamera(), {.port = 0});
  MadeUpSession session(50);
  for (int k = 0; k < 40; ++k) view.Show(session.Next());
  view.Finish();
  const Browser late = Listen(view.port(), [](const Browser& now) { return now.finished; });
  EXPECT_TRUE(late.finished);
  EXPECT_GE(late.last_image, 0);
  ExpectShows(late, *session.map());
}

TEST(LiveView, SaysThatThePortIsInUse) {
  const LiveView first(SessionCamera(), {.port = 0});
  try {
    const LiveView second(SessionCamera(), {.port = first.port()});
    FAIL() << "two pages at one port";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(error.what(),
              "the page cannot be shown at 127.0.0.1:" + std::to_string(first.port()) +
                  ": the port is in use; give another port, or 0 for any free one");
  }
  EXPECT_THROW(LiveView(SessionCamera(), {.port = 70'000}), std::runtime_error);
  try {
    const LiveView elsewhere(SessionCamera(), {"192.0.2.1", 0});
    FAIL() << "an address of another machine";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no address of this machine"));
  }
}

// A browser that asks for the stream and never reads.
class DeafBrowser {
 public:
  explicit DeafBrowser(int port) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    const int small = 4096;
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small));
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    inet_pton(AF_INET, kHost, &address.sin_addr);
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    const std::string request = "GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
    EXPECT_EQ(send(socket_, request.data(), request.size(), 0),
              static_cast<ssize_t>(request.size()));
  }
  ~DeafBrowser() { close(socket_); }
  DeafBrowser(const DeafBrowser&) = delete;
  DeafBrowser& operator=(const DeafBrowser&) = delete;

 private:
  int socket_;
};

TEST(LiveView, DoesNotWaitForABrowserThatNeverReads) {
  auto view = std::make_unique<LiveView>(SessionCamera(), LiveViewOptions{.port = 0});
  MadeUpSession session(4000);
  std::optional<DeafBrowser> deaf(view->port());
  std::optional<DeafBrowser> deaf_too(view->port());
  double longest_s = 0.0;
  for (int k = 0; k < 100; ++k) {
    const LiveViewFrame frame = session.Next();
    const Clock::time_point begin = Clock::now();
    view->Show(frame);
    longest_s = std::max(longest_s, SecondsSince(begin));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  // A browser takes much longer to be given up.
  EXPECT_LT(longest_s, 0.5);
  const std::size_t num_points = session.map()->points.size();
  const Browser other =
      Listen(view->port(), [&](const Browser& now) { return now.position.size() == num_points; });
  ExpectShows(other, *session.map());
  const Clock::time_point begin = Clock::now();
  view.reset();
  EXPECT_LT(SecondsSince(begin), 3.0) << "the end waits for browsers that never read";
}

TEST(LiveView, TellsABrowserTooManySo) {
  const LiveView view(SessionCamera(), {.port = 0});
  std::vector<std::unique_ptr<DeafBrowser>> others;
  for (int k = 0; k < 8; ++k) others.push_back(std::make_unique<DeafBrowser>(view.port()));
  httplib::Client client(kHost, view.port());
  int status = 0;
  for (int k = 0; k < 100 && status != 503; ++k) {
    client.Get(
        "/events",
        [&](const httplib::Response& response) {
          status = response.status;
          return status != 200;
        },
        [](const char*, std::size_t) { return true; });
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(status, 503);
  EXPECT_EQ(client.Get("/")->status, 200);
}

}  // namespace
}  // namespace rotslam
