#pragma once

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

namespace rotslam {

/// The browser; empty where it is not installed.
inline std::string Chromium() {
  for (const char* path : {"/usr/bin/chromium", "/usr/bin/chromium-browser"}) {
    if (std::filesystem::exists(path)) return path;
  }
  return "";
}

/// Command line that opens a page without a window and writes the document at its end to `dom`, and
/// what the browser says to `log`. It keeps its own files in `folder`.
inline std::string ChromiumCommand(const std::string& url,
                                   const std::string& flags,
                                   const std::filesystem::path& folder,
                                   const std::filesystem::path& dom,
                                   const std::filesystem::path& log) {
  return "timeout 120 " + Chromium() +
         " --headless --no-sandbox --disable-gpu --use-angle=swiftshader"
         " --enable-unsafe-swiftshader --no-first-run --disable-extensions --disable-dev-shm-usage"
         " --enable-logging=stderr --user-data-dir='" +
         (folder / "profile").string() + "' " + flags + " --dump-dom '" + url + "' >'" +
         dom.string() + "' 2>'" + log.string() + "'";
}

/// Put before the script of a visitor: pixelsOf(page) gives the pixels of a page's 3-D view, and
/// differences(a, b) the number of those that differ.
inline constexpr const char* kPixelScript = R"js(
<script>
function differences(a, b) {
  let count = 0;
  for (let k = 0; k < a.length; ++k) count += a[k] !== b[k];
  return count;
}
function pixelsOf(page) {
  page.snapshot();
  const source = document.querySelector('#view canvas');
  const copy = document.createElement('canvas');
  copy.width = source.width;
  copy.height = source.height;
  const context = copy.getContext('2d');
  context.drawImage(source, 0, 0);
  return context.getImageData(0, 0, copy.width, copy.height).data;
}
</script>
)js";

/// Errors and warnings that the page itself has caused.
inline std::vector<std::string> ConsoleMessages(const std::string& log) {
  std::vector<std::string> messages;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    // The driver remarks that reading pixels, which only tests do, is slow.
    if (line.find("GL Driver Message") != std::string::npos) continue;
    if (line.find("CONSOLE") != std::string::npos) messages.push_back(line);
  }
  return messages;
}

}  // namespace rotslam
