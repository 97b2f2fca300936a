#include "apps/cli/live/live_page.h"

#include <algorithm>
#include <chrono>
#include <memory>

#include "apps/live_view/live_view.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {

void AddLivePageFlags(CLI::App& command, LivePageFlags& flags) {
  command
      .add_option_function<int>(
          "--view",
          [&flags](int port) {
            flags.is_on = true;
            flags.port = port;
          },
          "Show the session in the browser, at this port of this machine")
      ->expected(0, 1)
      ->default_str("8080")
      ->check(CLI::Range(0, 65535));
  command.add_option("--view-address",
                     flags.address,
                     "Whoever reaches this address sees the page, too (0.0.0.0: all)");
}

std::function<void(const LiveOutputs::Shown&)> OpenLivePage(const LivePageFlags& flags,
                                                            const Camera& camera,
                                                            Progress& progress) {
  if (!flags.is_on) return nullptr;
  const auto view = std::make_shared<LiveView>(camera, LiveViewOptions{flags.address, flags.port});
  progress.Say("the session is shown at " + view->url());
  const auto start = std::chrono::steady_clock::now();
  return [view, start, num_frames = 0](const LiveOutputs::Shown& shown) mutable {
    LiveViewFrame frame;
    frame.estimate = shown.estimate;
    frame.image = shown.image;
    frame.points_px = shown.points_px;
    frame.map = shown.map;
    frame.stats.latency_ms = shown.latency_ms;
    frame.stats.num_dropped = shown.num_dropped;
    frame.stats.num_loops = shown.map ? shown.map->num_corrections : 0;
    frame.stats.frames_per_s = ++num_frames / std::max(1e-3, SecondsSince(start));
    view->Show(frame);
  };
}

}  // namespace rotslam
