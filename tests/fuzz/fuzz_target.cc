#include "tests/fuzz/fuzz_target.h"

#include <algorithm>
#include <exception>
#include <stdexcept>
#include <typeinfo>
#include <utility>

namespace rotslam {

std::vector<FuzzTarget>& FuzzTargets() {
  static std::vector<FuzzTarget> targets;
  return targets;
}

RegisterFuzzTarget::RegisterFuzzTarget(std::string name, decltype(FuzzTarget::read) read) {
  std::vector<FuzzTarget>& targets = FuzzTargets();
  targets.push_back({std::move(name), std::move(read)});
  std::sort(targets.begin(), targets.end(), [](const FuzzTarget& a, const FuzzTarget& b) {
    return a.name < b.name;
  });
}

std::vector<std::string> CutIntoFiles(std::string_view bytes, std::size_t count) {
  constexpr std::string_view kMark = "\n%%\n";
  std::vector<std::string> files(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t end =
        k + 1 == count ? bytes.size() : std::min(bytes.find(kMark), bytes.size());
    files[k] = bytes.substr(0, end);
    bytes.remove_prefix(std::min(end + kMark.size(), bytes.size()));
  }
  return files;
}

std::string Damaged(std::string file, std::string_view edits) {
  for (; edits.size() >= 4 && !file.empty(); edits.remove_prefix(4)) {
    const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(edits[k]); };
    const std::size_t place = (byte(0) | std::size_t{byte(1)} << 8) % file.size();
    switch (byte(2) % 4) {
      case 0:
        file[place] = edits[3];
        break;
      case 1:
        file.replace(place, 8, std::string(1, edits[3]) + std::string(7, byte(3) < 128 ? 0 : -1));
        break;
      case 2:
        file.erase(place, 1);
        break;
      default:
        file.resize(place);
    }
  }
  return file;
}

std::optional<std::string> ComplaintAbout(const FuzzTarget& target, std::string_view bytes) {
  static const TemporaryFolder folder;
  try {
    target.read(bytes, folder);
    return std::nullopt;
  } catch (const std::exception& error) {
    const std::string message = error.what();
    const std::string what = std::string(typeid(error).name()) + ": " + message;
    // Others derive from it: yaml-cpp's, OpenCV's, the file system's, none of which is our word.
    if (typeid(error) != typeid(std::runtime_error)) return "not a clear error, " + what;
    if (message.find('\n') != std::string::npos) return "more than one line, " + what;
    if (!message.starts_with(folder.path().string())) return "names no file, " + what;
    return std::nullopt;
  }
}

}  // namespace rotslam
