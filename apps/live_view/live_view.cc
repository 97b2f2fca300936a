#include "apps/live_view/live_view.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "apps/live_view/view_image.h"
#include "apps/live_view/view_server.h"
#include "apps/live_view/view_state.h"
#include "apps/page/embedded_file.h"
#include "apps/page/page_parts.h"

ROTSLAM_EMBED(live_page, ROTSLAM_LIVE_VIEW_DIR "/live_page.html");
ROTSLAM_EMBED(live_style, ROTSLAM_LIVE_VIEW_DIR "/live.css");
ROTSLAM_EMBED(live_data_script, ROTSLAM_LIVE_VIEW_DIR "/live_data.js");
ROTSLAM_EMBED(live_scene_script, ROTSLAM_LIVE_VIEW_DIR "/live_scene.js");
ROTSLAM_EMBED(live_panels_script, ROTSLAM_LIVE_VIEW_DIR "/live_panels.js");

namespace rotslam {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kImagePeriod{95};
// Of the messages to one browser: smooth to the eye, and half as many as frames.
constexpr std::chrono::milliseconds kMessagePeriod{50};
// A sign of life, which finds out whether the browser is still there.
constexpr std::chrono::seconds kSignOfLife{5};
// How long browsers have at the end to learn that it is one.
constexpr std::chrono::milliseconds kFarewell{500};
// Frames that may wait for the thread that takes them in.
constexpr std::size_t kMaxWaiting = 600;

std::string LivePage() {
  std::vector<PagePart> parts = SharedPageParts();
  parts.insert(parts.end(),
               {{"{{live_style}}", ROTSLAM_EMBEDDED(live_style)},
                {"{{live_data_script}}", ROTSLAM_EMBEDDED(live_data_script)},
                {"{{live_scene_script}}", ROTSLAM_EMBEDDED(live_scene_script)},
                {"{{live_panels_script}}", ROTSLAM_EMBEDDED(live_panels_script)}});
  return FillPage(ROTSLAM_EMBEDDED(live_page), parts);
}

}  // namespace

class LiveView::Impl {
 public:
  Impl(const Camera& camera, const LiveViewOptions& options)
      : address_(options.address),
        state_(camera),
        server_(options.address, options.port, {LivePage(), [this] { return OpenStream(); }}),
        thread_([this] { Work(); }) {}

  ~Impl() {
    Finish();
    const Clock::time_point begin = Clock::now();
    while (num_streams_ > 0 && Clock::now() - begin < kFarewell) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    {
      const std::scoped_lock lock(input_mutex_, state_mutex_);
      is_over_ = true;
    }
    input_changed_.notify_all();
    state_changed_.notify_all();
    server_.Stop();
    thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void Show(const LiveViewFrame& frame) {
    const Clock::time_point now = Clock::now();
    std::optional<ViewImage> image;
    if (!frame.image.empty() && now >= next_image_) {
      next_image_ = now + kImagePeriod;
      image = ViewImage{frame.estimate.frame.value, frame.image.clone(), frame.points_px};
    }
    {
      const std::scoped_lock lock(input_mutex_);
      if (input_.frames.size() == kMaxWaiting) input_.frames.pop_front();
      input_.frames.push_back({frame.estimate, frame.stats});
      if (frame.map) input_.map = frame.map;
      if (image) input_.image = std::move(image);
      is_new_ = true;
    }
    input_changed_.notify_one();
  }

  void Finish() {
    {
      const std::scoped_lock lock(input_mutex_);
      input_.is_finished = true;
      is_new_ = true;
    }
    input_changed_.notify_one();
  }

  int port() const { return server_.port(); }

  std::string url() const {
    const bool is_any = address_ == "0.0.0.0" || address_ == "::";
    const std::string host = is_any ? "127.0.0.1" : address_;
    const bool is_ipv6 = host.find(':') != std::string::npos;
    return "http://" + (is_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(port()) + "/";
  }

 private:
  struct FrameInput {
    LiveEstimate estimate;
    LiveViewStats stats;
  };
  // What has been given and not taken in; of map and image the newest alone.
  struct Input {
    std::deque<FrameInput> frames;
    std::shared_ptr<const LiveMap> map;
    std::optional<ViewImage> image;
    bool is_finished = false;
  };

  // Takes in what is given, on a thread of its own.
  void Work() {
    std::optional<ViewImage> newest_image;
    for (;;) {
      Input input;
      {
        std::unique_lock lock(input_mutex_);
        input_changed_.wait(lock, [this] { return is_over_ || is_new_; });
        if (is_over_) return;
        is_new_ = false;
        std::swap(input, input_);
      }
      {
        const std::scoped_lock lock(state_mutex_);
        for (const FrameInput& frame : input.frames) state_.Add(frame.estimate, frame.stats);
        state_.SetMap(input.map);
      }
      state_changed_.notify_all();
      if (input.image) newest_image = std::move(input.image);
      if (newest_image && (num_streams_ > 0 || input.is_finished)) {
        ShowImage(*newest_image);
        newest_image.reset();
      }
      if (!input.is_finished) continue;
      {
        const std::scoped_lock lock(state_mutex_);
        state_.Finish();
      }
      state_changed_.notify_all();
    }
  }

  void ShowImage(const ViewImage& image) {
    try {
      nlohmann::ordered_json encoded = EncodedViewImage(image);
      const std::scoped_lock lock(state_mutex_);
      state_.SetImage(std::move(encoded));
    } catch (const cv::Exception&) {
      // The page goes without.
      return;
    }
    state_changed_.notify_all();
  }

  NextText OpenStream() {
    ++num_streams_;
    {
      // An image may have waited for somebody to see it.
      const std::scoped_lock lock(input_mutex_);
      is_new_ = true;
    }
    input_changed_.notify_one();
    const std::shared_ptr<void> counted(nullptr, [this](void*) { --num_streams_; });
    return [this, counted, cursor = ViewCursor(), next_time = Clock::now()]() mutable {
      std::unique_lock lock(state_mutex_);
      state_changed_.wait_until(lock, next_time, [this] { return is_over_; });
      state_changed_.wait_for(
          lock, kSignOfLife, [&] { return is_over_ || state_.IsAhead(cursor); });
      next_time = Clock::now() + kMessagePeriod;
      if (is_over_) return ViewText{"", true};
      if (!state_.IsAhead(cursor)) return ViewText{":\n\n"};
      return ViewText{"data: " + state_.TakeMessage(cursor) + "\n\n", state_.is_finished()};
    };
  }

  const std::string address_;
  std::atomic<int> num_streams_ = 0;
  Clock::time_point next_image_;  // of the caller's thread

  std::mutex input_mutex_;
  std::condition_variable input_changed_;
  Input input_;
  bool is_new_ = false;
  bool is_over_ = false;  // written under both mutexes

  std::mutex state_mutex_;
  std::condition_variable state_changed_;
  ViewState state_;

  ViewServer server_;
  std::thread thread_;
};

LiveView::LiveView(const Camera& camera, const LiveViewOptions& options)
    : impl_(std::make_unique<Impl>(camera, options)) {}

LiveView::~LiveView() = default;

void LiveView::Show(const LiveViewFrame& frame) { impl_->Show(frame); }

void LiveView::Finish() { impl_->Finish(); }

int LiveView::port() const { return impl_->port(); }

std::string LiveView::url() const { return impl_->url(); }

}  // namespace rotslam
