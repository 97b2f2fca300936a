#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "apps/cli/live/live_session.h"
#include "apps/cli/terminal/progress.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// Of the page that shows a live session.
struct LivePageFlags {
  bool is_on = false;
  int port = 8080;
  std::string address = "127.0.0.1";
};

void AddLivePageFlags(CLI::App& command, LivePageFlags& flags);

/// Serves the page and says where it is; what it returns shows a frame on it, and keeps it up.
/// Empty where no page is asked for. Throws std::runtime_error where the port cannot be had.
std::function<void(const LiveOutputs::Shown&)> OpenLivePage(const LivePageFlags& flags,
                                                            const Camera& camera,
                                                            Progress& progress);

}  // namespace rotslam
