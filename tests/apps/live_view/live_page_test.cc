// The page of a live session in a browser: opened without a window by Chromium, where that is
// installed, while a session runs.

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include <Eigen/Core>  // before httplib.h, which brings a macro of a name that Eigen uses
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <nlohmann/json.hpp>

#include "apps/live_view/live_view.h"
#include "rotodom/types/stopwatch.h"
#include "rotodom/types/text_file.h"
#include "tests/apps/chromium.h"
#include "tests/apps/live_view/made_up_session.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;
using testing::HasSubstr;
using testing::IsEmpty;

// Looks at the page while the session runs, loads it anew in the middle, and tells what it has seen
// at the end. The image keeps the page from being complete, so that the browser stays.
constexpr const char* kVisitor = R"js(
<img src="/seen_all" alt="">
<script>
(() => {
  const live = window.live;
  const isLit = (canvas) =>
    canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value > 0);
  const until = (condition) => new Promise((resolve) => {
    const look = () => (condition() ? resolve() : setTimeout(look, 20));
    look();
  });
  // Two frames of the browser: what has come is drawn.
  const drawn = () => new Promise((resolve) => setTimeout(resolve, 350));
  const visit = async () => {
    const before = JSON.parse(sessionStorage.getItem('seen') || 'null');
    if (!before) {
      const seen = {};
      await until(() => live.keyframes.count >= 3);
      await drawn();
      const first = pixelsOf(live);
      seen.lit = first.filter((value, k) => k % 4 === 3 && value > 0).length;
      seen.start = live.markerPosition();
      const count = live.numFrames();
      await until(() => live.numFrames() >= count + 30);
      await drawn();
      seen.end = live.markerPosition();
      seen.changed = differences(first, pixelsOf(live));
      seen.points = live.cloud.count;
      seen.keyframes = live.keyframes.count;
      seen.frames = live.numFrames();
      seen.errors = live.errors;
      sessionStorage.setItem('seen', JSON.stringify(seen));
      location.reload();
      return;
    }
    const seen = before;
    await until(() => live.session.numMessages > 0);
    seen.points_anew = live.cloud.count;
    seen.keyframes_anew = live.keyframes.count;
    seen.frames_anew = live.numFrames();
    await until(() => live.session.isFinished);
    await drawn();
    seen.points_at_end = live.cloud.count;
    seen.keyframes_at_end = live.keyframes.count;
    seen.frames_at_end = live.numFrames();
    seen.state = document.getElementById('state').textContent;
    seen.facts = [...document.querySelectorAll('.fact')].map((fact) => fact.textContent);
    seen.notes = [...document.querySelectorAll('.note')].map((note) => note.textContent);
    seen.picture = isLit(document.getElementById('thumbnail'));
    seen.blank_charts = live.charts.filter((chart) => !isLit(chart.canvas)).length;
    seen.charts = live.charts.length;
    seen.errors = seen.errors.concat(live.errors);
    await fetch('/seen?all=' + encodeURIComponent(JSON.stringify(seen)));
  };
  visit().catch((error) => fetch('/seen?all=' + encodeURIComponent(JSON.stringify({failure: String(error.stack || error)}))));
})();
</script>
)js";

// Stands between the page and the browser: hands on all that LiveView says and adds the visitor.
class VisitedPage {
 public:
  explicit VisitedPage(int port) {
    server_.Get("/", [port](const httplib::Request&, httplib::Response& response) {
      const auto page = httplib::Client("127.0.0.1", port).Get("/");
      ASSERT_TRUE(page);
      std::string policy = page->get_header_value("Content-Security-Policy");
      const std::string images = "img-src ";
      ASSERT_NE(policy.find(images), std::string::npos);
      policy.insert(policy.find(images) + images.size(), "'self' ");
      response.set_header("Content-Security-Policy", policy);
      response.set_content(page->body + kPixelScript + kVisitor, "text/html; charset=utf-8");
    });
    server_.Get("/events", [this, port](const httplib::Request&, httplib::Response& response) {
      ++num_visits_;
      response.set_chunked_content_provider(
          "text/event-stream", [port](std::size_t, httplib::DataSink& sink) {
            httplib::Client("127.0.0.1", port)
                .Get("/events", [&](const char* bytes, std::size_t count) {
                  return sink.write(bytes, count);
                });
            return false;
          });
    });
    server_.Get("/seen_all", [this](const httplib::Request&, httplib::Response& response) {
      const Clock::time_point begin = Clock::now();
      while (!has_seen_ && SecondsSince(begin) < 40.0) Pause();
      response.status = 204;
    });
    server_.Get("/seen", [this](const httplib::Request& request, httplib::Response&) {
      const std::scoped_lock lock(mutex_);
      seen_ = Json::parse(request.get_param_value("all"));
      has_seen_ = true;
    });
    port_ = server_.bind_to_any_port("127.0.0.1");
    thread_ = std::thread([this] { server_.listen_after_bind(); });
    while (!server_.is_running()) Pause();
  }
  ~VisitedPage() {
    server_.stop();
    thread_.join();
  }
  VisitedPage(const VisitedPage&) = delete;
  VisitedPage& operator=(const VisitedPage&) = delete;

  static void Pause() { std::this_thread::sleep_for(std::chrono::milliseconds(10)); }

  int port() const { return port_; }
  int num_visits() const { return num_visits_; }
  bool has_seen() const { return has_seen_; }
  Json seen() const {
    const std::scoped_lock lock(mutex_);
    return seen_;
  }

 private:
  httplib::Server server_;
  std::thread thread_;
  int port_ = -1;
  std::atomic<int> num_visits_ = 0;
  std::atomic<bool> has_seen_ = false;
  mutable std::mutex mutex_;
  Json seen_;
};

TEST(LivePage, ShowsASessionThatRuns) {
  if (Chromium().empty()) GTEST_SKIP() << "chromium is not installed: no page is opened";
  const TemporaryFolder folder;
  const fs::path log = folder.path() / "log";
  LiveView view(SessionCamera(), {.port = 0});
  VisitedPage page(view.port());
  const std::string line = ChromiumCommand("http://127.0.0.1:" + std::to_string(page.port()) + "/",
                                           "--window-size=800,700",
                                           folder.path(),
                                           "/dev/null",
                                           log);
  int status = -1;
  std::thread browser([&] { status = std::system(line.c_str()); });
  MadeUpSession session(60);
  const Clock::time_point begin = Clock::now();
  // Some frames more after the page was loaded anew.
  for (int num_more = 30; num_more > 0 && SecondsSince(begin) < 40.0; VisitedPage::Pause()) {
    view.Show(session.Next());
    if (page.num_visits() >= 2) --num_more;
  }
  view.Finish();
  while (!page.has_seen() && SecondsSince(begin) < 50.0) VisitedPage::Pause();
  browser.join();
  const std::string said = ReadText(log);
  ASSERT_TRUE(page.has_seen()) << said;
  EXPECT_EQ(status, 0) << said;
  EXPECT_THAT(ConsoleMessages(said), IsEmpty());
  const Json seen = page.seen();
  ASSERT_FALSE(seen.contains("failure")) << seen.at("failure");
  EXPECT_EQ(seen.at("errors").dump(), "[]");
  EXPECT_GT(seen.at("lit").get<int>(), 500) << "the view is blank";
  EXPECT_GT(seen.at("changed").get<int>(), 500) << "the view does not change";
  EXPECT_NE(seen.at("start"), seen.at("end")) << "the camera does not move";
  // What comes first after loading anew has all that was there before.
  EXPECT_GE(seen.at("points_anew").get<int>(), seen.at("points").get<int>());
  EXPECT_GE(seen.at("keyframes_anew").get<int>(), seen.at("keyframes").get<int>());
  EXPECT_GE(seen.at("frames_anew").get<int>(), seen.at("frames").get<int>());
  const LiveMap& map = *session.map();
  EXPECT_EQ(seen.at("points_at_end").get<std::size_t>(), map.points.size());
  EXPECT_EQ(seen.at("keyframes_at_end").get<std::size_t>(), map.keyframes.size());
  EXPECT_EQ(seen.at("state"), "finished");
  EXPECT_THAT(seen.at("notes").dump(), HasSubstr("The session is over."));
  EXPECT_THAT(seen.at("facts").dump(), HasSubstr("12.0 mslatency"));
  EXPECT_EQ(seen.at("picture"), true);
  EXPECT_EQ(seen.at("charts"), 3);
  EXPECT_EQ(seen.at("blank_charts"), 0);
}

}  // namespace
}  // namespace rotslam
