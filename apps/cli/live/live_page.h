#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "apps/cli/live/live_session.h"
#include "apps/cli/terminal/progress.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// The flags of the page that shows a live session.
struct LivePageFlags {
  bool is_on = false;
  int port = 8080;
  std::string address = "127.0.0.1";
};

void AddLivePageFlags(CLI::App& command, LivePageFlags& flags);

/// Serves the page and prints its address. The returned function shows a frame on it and keeps the
/// page up; it is empty where no page is asked for. Throws std::runtime_error on a busy port.
std::function<void(const LiveOutputs::Shown&)> OpenLivePage(const LivePageFlags& flags,
                                                            const Camera& camera,
                                                            Progress& progress);

}  // namespace rotslam
