#include "apps/cli/live/stream_sources.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <set>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <poll.h>
#include <unistd.h>

#include "rotodom/sequence/image_file.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using Bytes = std::vector<unsigned char>;

// No image of a stream is larger.
constexpr std::size_t kMaxImageBytes = 200U << 20U;
constexpr int kPollMs = 50;
// An address that answers nothing for so long when it is opened, or gives no frame for so long, has
// ended.
constexpr int kOpenTimeoutMs = 8'000;
constexpr int kReadTimeoutMs = 20'000;

std::string NumberedName(int number, const char* extension) {
  std::array<char, 32> name = {};
  std::snprintf(name.data(), name.size(), "%06d%s", number, extension);
  return name.data();
}

// Numbers, times and stores the frames of a stream.
class StreamFrames {
 public:
  StreamFrames(const ArrivalTimes& times, const std::optional<fs::path>& folder)
      : times_(times), folder_(folder) {
    if (!folder_) return;
    fs::remove_all(*folder_);  // of an earlier session
    fs::create_directories(*folder_);
    times_file_.open(*folder_ / "times.txt", std::ios::trunc);
    if (!times_file_)
      throw std::runtime_error((*folder_ / "times.txt").string() + ": cannot be written");
    times_file_.precision(17);  // as they were, to the last bit
  }

  Frame Make(const DecodedImage& decoded, const Bytes& bytes, const char* extension) {
    Frame frame;
    frame.id = FrameId{num_frames_};
    frame.timestamp_s = NextTime();
    frame.name = NumberedName(num_frames_++, extension);
    frame.image = decoded.image;
    frame.problem = decoded.problem;
    if (folder_) Store(frame, bytes);
    return frame;
  }

 private:
  double NextTime() {
    if (times_.fps) return num_frames_ / *times_.fps;
    const auto now = std::chrono::steady_clock::now();
    if (num_frames_ == 0) start_ = now;
    // Two may arrive together.
    constexpr double kLeastStep = 1e-6;
    const double arrived_s = std::chrono::duration<double>(now - start_).count();
    newest_s_ = num_frames_ == 0 ? 0.0 : std::max(arrived_s, newest_s_ + kLeastStep);
    return newest_s_;
  }

  void Store(const Frame& frame, const Bytes& bytes) {
    const fs::path file = *folder_ / frame.name;
    std::ofstream out(file, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()),
              static_cast<std::streamsize>(bytes.size()));
    times_file_ << frame.timestamp_s << std::endl;
    if (!out || !times_file_) throw std::runtime_error(file.string() + ": cannot be written");
  }

  ArrivalTimes times_;
  std::optional<fs::path> folder_;
  std::ofstream times_file_;
  std::chrono::steady_clock::time_point start_;
  double newest_s_ = 0.0;
  int num_frames_ = 0;
};

// Cuts a stream of bytes into JPEG and PNG images.
class ImageCutter {
 public:
  void Append(const unsigned char* bytes, std::size_t count) {
    buffer_.insert(buffer_.end(), bytes, bytes + count);
  }

  // The next whole image; nullopt where more bytes are needed.
  std::optional<std::pair<Bytes, const char*>> Take() {
    static constexpr std::array<unsigned char, 3> kJpeg = {0xFF, 0xD8, 0xFF};
    static constexpr std::array<unsigned char, 8> kPng = {
        0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A};
    const auto jpeg = std::search(buffer_.begin(), buffer_.end(), kJpeg.begin(), kJpeg.end());
    const auto png = std::search(buffer_.begin(), buffer_.end(), kPng.begin(), kPng.end());
    const bool is_jpeg = jpeg < png;
    const auto begin = std::min(jpeg, png);
    // What lies in front belongs to no image; the last bytes may be the beginning of one.
    const auto keep = static_cast<std::ptrdiff_t>(kPng.size());
    if (begin == buffer_.end()) {
      if (std::ssize(buffer_) > keep) buffer_.erase(buffer_.begin(), buffer_.end() - keep);
      return std::nullopt;
    }
    buffer_.erase(buffer_.begin(), begin);
    const std::optional<std::size_t> size = is_jpeg ? JpegSize() : PngSize();
    if (!size && buffer_.size() > kMaxImageBytes) {
      throw std::runtime_error(
          "standard input: an image does not end: give JPEG or PNG images one after the "
          "other, as `ffmpeg ... -f image2pipe -` does");
    }
    if (!size) return std::nullopt;
    const auto end = buffer_.begin() + static_cast<std::ptrdiff_t>(*size);
    std::pair<Bytes, const char*> image = {Bytes(buffer_.begin(), end), is_jpeg ? ".jpg" : ".png"};
    buffer_.erase(buffer_.begin(), end);
    return image;
  }

 private:
  std::size_t At(std::size_t place, int num_bytes) const {
    std::size_t value = 0;
    for (int k = 0; k < num_bytes; ++k)
      value = (value << 8U) | buffer_[place + static_cast<std::size_t>(k)];
    return value;
  }

  // Segments have their lengths; entropy-coded data ends at a marker that is neither stuffed nor a
  // restart.
  std::optional<std::size_t> JpegSize() const {
    constexpr unsigned char kEnd = 0xD9;
    constexpr unsigned char kScan = 0xDA;
    std::size_t place = 2;
    while (place + 4 <= buffer_.size()) {
      if (buffer_[place] != 0xFF) return place;  // damaged: what there is so far
      const unsigned char marker = buffer_[place + 1];
      if (marker == kEnd) return place + 2;
      if (marker == 0xFF) {
        ++place;
        continue;
      }
      place += 2 + At(place + 2, 2);
      if (marker != kScan) continue;
      while (place + 2 <= buffer_.size()) {
        const unsigned char next = buffer_[place + 1];
        const bool is_marker =
            buffer_[place] == 0xFF && next != 0 && next != 0xFF && (next & 0xF8U) != 0xD0;
        if (is_marker) break;
        ++place;
      }
      if (place + 2 <= buffer_.size() && buffer_[place + 1] == kEnd) return place + 2;
    }
    if (place + 2 <= buffer_.size() && buffer_[place] == 0xFF && buffer_[place + 1] == kEnd)
      return place + 2;
    return std::nullopt;
  }

  std::optional<std::size_t> PngSize() const {
    std::size_t place = 8;
    while (place + 12 <= buffer_.size()) {
      const std::size_t length = At(place, 4);
      const bool is_last = std::memcmp(&buffer_[place + 4], "IEND", 4) == 0;
      place += 12 + length;
      if (place > buffer_.size()) return std::nullopt;
      if (is_last) return place;
    }
    return std::nullopt;
  }

  Bytes buffer_;
};

// Decodes without the scale that 16-bit sequences need: a stream is of 8 bits.
DecodedImage Decode(const Bytes& bytes) {
  DecodedImage decoded = DecodeImageBytes(bytes);
  return decoded.image.empty() ? decoded : ToEightBits(decoded.image);
}

}  // namespace

FramePump::Source ImageStream(int descriptor,
                              const ArrivalTimes& times,
                              const std::optional<fs::path>& folder) {
  struct State {
    StreamFrames frames;
    ImageCutter cutter;
  };
  const auto state = std::make_shared<State>(State{StreamFrames(times, folder), {}});
  return [descriptor, state](const std::function<bool()>& is_over) -> std::optional<Frame> {
    while (!is_over()) {
      if (auto image = state->cutter.Take()) {
        return state->frames.Make(Decode(image->first), image->first, image->second);
      }
      pollfd waiting = {descriptor, POLLIN, 0};
      if (poll(&waiting, 1, kPollMs) <= 0) continue;
      std::array<unsigned char, 1U << 16U> bytes = {};
      const ssize_t count = read(descriptor, bytes.data(), bytes.size());
      if (count <= 0) return std::nullopt;
      state->cutter.Append(bytes.data(), static_cast<std::size_t>(count));
    }
    return std::nullopt;
  };
}

bool IsCaptureSource(const std::string& source) {
  return source.rfind("/dev/", 0) == 0 || source.find("://") != std::string::npos;
}

FramePump::Source CaptureStream(const std::string& source,
                                const ArrivalTimes& times,
                                const std::optional<fs::path>& folder) {
  struct State {
    cv::VideoCapture capture;
    StreamFrames frames;
  };
  const bool is_device = source.rfind("/dev/", 0) == 0;
  const auto open = [&] {
    if (is_device) return cv::VideoCapture(source, cv::CAP_V4L2);
    return cv::VideoCapture(source,
                            cv::CAP_FFMPEG,
                            {cv::CAP_PROP_OPEN_TIMEOUT_MSEC,
                             kOpenTimeoutMs,
                             cv::CAP_PROP_READ_TIMEOUT_MSEC,
                             kReadTimeoutMs});
  };
  const auto state = std::make_shared<State>(State{open(), StreamFrames(times, folder)});
  if (!state->capture.isOpened()) {
    throw std::runtime_error(source + ": cannot be opened: check the " +
                             (is_device ? "device and that nothing else uses it"
                                        : "address and that a player shows it"));
  }
  const bool stores = folder.has_value();
  return [state, stores](const std::function<bool()>& is_over) -> std::optional<Frame> {
    DecodedImage decoded;
    if (is_over() || !state->capture.read(decoded.image)) return std::nullopt;
    decoded.image = decoded.image.clone();  // the capture uses its memory again
    Bytes bytes;
    // As fast as PNG goes: the frame after this one waits for it.
    if (stores) cv::imencode(".png", decoded.image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
    return state->frames.Make(decoded, bytes, ".png");
  };
}

FramePump::Source FollowedFolder(const fs::path& watched,
                                 const ArrivalTimes& times,
                                 const std::optional<fs::path>& folder) {
  if (!fs::is_directory(watched)) {
    throw std::runtime_error(watched.string() + ": is no folder; --follow watches one");
  }
  struct State {
    StreamFrames frames;
    std::set<std::string> seen;
    std::vector<std::string> waiting;  // new ones, the next one last
  };
  const auto state = std::make_shared<State>(State{StreamFrames(times, folder), {}, {}});
  return [watched, state](const std::function<bool()>& is_over) -> std::optional<Frame> {
    while (!is_over()) {
      if (!state->waiting.empty()) {
        const fs::path file = watched / state->waiting.back();
        state->waiting.pop_back();
        std::ifstream in(file, std::ios::binary);
        const Bytes bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
        const std::string extension = file.extension().string();
        return state->frames.Make(Decode(bytes), bytes, extension == ".png" ? ".png" : ".jpg");
      }
      for (const auto& entry : fs::directory_iterator(watched)) {
        const std::string extension = entry.path().extension().string();
        const bool is_image = extension == ".png" || extension == ".jpg" || extension == ".jpeg";
        if (is_image && state->seen.insert(entry.path().filename().string()).second) {
          state->waiting.push_back(entry.path().filename().string());
        }
      }
      std::sort(state->waiting.rbegin(), state->waiting.rend());
      // A file that has just appeared may still be written.
      std::this_thread::sleep_for(std::chrono::milliseconds(kPollMs));
    }
    return std::nullopt;
  };
}

}  // namespace rotslam
