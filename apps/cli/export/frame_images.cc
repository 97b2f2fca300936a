#include "apps/cli/export/frame_images.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/cli/export/picture_check.h"
#include "apps/report/run_summary.h"
#include "output/files/atomic_file.h"
#include "output/map/thumbnails_file.h"
#include "rotodom/sequence/frame_thumbnail.h"
#include "rotodom/sequence/image_file.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Images between two steps of the progress.
constexpr int kImagesAtOnce = 32;

// Empty for a run that has none.
ThumbnailTable ThumbnailsOf(const fs::path& run, const ImageObserver& observer) {
  const fs::path file = run / "thumbnails.bin";
  if (fs::exists(file)) {
    ThumbnailTable thumbnails = ReadThumbnails(file);
    if (thumbnails.width == kThumbnailWidth && thumbnails.height == kThumbnailHeight) {
      return thumbnails;
    }
  }
  observer.say("note: " + run.string() +
               " has no thumbnails.bin, an older version has written it: whether the images show "
               "what the run saw is not checked");
  return {};
}

// That the run could not read, as far as it is known.
bool WasUnreadable(const ThumbnailTable& thumbnails, FrameId frame) {
  const auto position = static_cast<std::size_t>(frame.value);
  return position < thumbnails.grey.size() && thumbnails.grey[position].empty();
}

// Numbers as of the frames of a video, with `ending`.
int CountNumbered(const fs::path& folder, const std::string& ending) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string stem = entry.path().stem().string();
    const bool is_number = !stem.empty() && std::all_of(stem.begin(), stem.end(), [](char c) {
      return c >= '0' && c <= '9';
    });
    count += is_number && entry.path().extension() == ending;
  }
  return count;
}

// Gives the frames of a video the ending that their images in `folder` have.
void FollowEnding(const fs::path& folder, RunMap& map) {
  for (const char* ending : {".png", ".jpg", ".jpeg"}) {
    const bool has_some = std::any_of(map.frames.begin(), map.frames.end(), [&](auto& frame) {
      return fs::exists(folder / fs::path(frame.image).replace_extension(ending));
    });
    if (!has_some) continue;
    for (MapFrame& frame : map.frames) {
      frame.image = fs::path(frame.image).replace_extension(ending).string();
    }
    return;
  }
}

// A run that has read all frames of its sequence; nullopt where its summary does not tell.
std::optional<int> NumFramesOfWhole(const fs::path& run) {
  const auto summary = ReadJsonObject(run / "summary.json");
  if (!summary) return std::nullopt;
  try {
    const SequenceOptions options = SequenceOptionsOf(*summary);
    if (options.first != 0 || options.last >= 0 || options.stride != 1) return std::nullopt;
    return summary->at("counts").at("frames").get<int>();
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

// ffmpeg, left to itself, gives a video of changing rate frames at a steady one.
void CheckCount(const fs::path& run, const fs::path& folder, const RunMap& map) {
  const std::optional<int> expected = NumFramesOfWhole(run);
  if (!expected || map.frames.empty()) return;
  const int count = CountNumbered(folder, fs::path(map.frames.front().image).extension().string());
  if (count <= *expected) return;
  throw std::runtime_error(folder.string() + ": has " + std::to_string(count) +
                           " images, the run has read " + std::to_string(*expected) +
                           " frames; --extract DIR writes those");
}

OfferedPicture ReadPicture(const fs::path& folder, const MapFrame& frame, const Camera& camera) {
  const fs::path file = folder / frame.image;
  if (!fs::exists(file)) {
    throw std::runtime_error(file.string() + ": is not there, the image of frame " +
                             std::to_string(frame.id.value) + "; --extract DIR writes all images");
  }
  const auto [image, problem] = ReadImageFile(file);
  if (image.empty()) throw std::runtime_error(file.string() + ": " + problem);
  if (image.cols != camera.width || image.rows != camera.height) {
    throw std::runtime_error(file.string() + ": is " + std::to_string(image.cols) + "x" +
                             std::to_string(image.rows) + ", the run's images were " +
                             std::to_string(camera.width) + "x" + std::to_string(camera.height));
  }
  return {frame.id, file.string(), MakeFrameThumbnail(image)};
}

std::string SequenceOf(const fs::path& run, const nlohmann::ordered_json& summary) {
  const nlohmann::ordered_json& sequence = summary.at("sequence");
  if (!sequence.contains("path")) {
    throw std::runtime_error(run.string() + ": does not say where its images are");
  }
  return sequence.at("path");
}

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
}

void WritePng(const fs::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes);
  ReplaceFile(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

void CopyImage(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
  if (error) throw std::runtime_error(to.string() + ": cannot be written: " + error.message());
}

// Frames of the run by the name of their image.
void WriteFrame(const fs::path& folder,
                const RunMap& map,
                const Frame& frame,
                const ImageChange& change) {
  const MapFrame& known = map.frames[static_cast<std::size_t>(frame.id.value)];
  const std::string name = frame.name + (map.is_video ? ".png" : "");
  if (known.id != frame.id || known.image != name) {
    throw std::runtime_error(map.image_folder + ": frame " + std::to_string(frame.id.value) +
                             " is " + name + ", when the run read it it was " + known.image);
  }
  const fs::path file = folder / known.image;
  MakeFolder(file.parent_path());
  if (change) {
    WritePng(fs::path(file).replace_extension(".png"), change(frame.id, frame.image));
  } else if (map.is_video) {
    WritePng(file, frame.image);
  } else {
    CopyImage(fs::path(map.image_folder) / known.image, file);
  }
}

}  // namespace

void CheckImages(const fs::path& run,
                 const fs::path& folder,
                 int num_threads,
                 const ImageObserver& observer,
                 RunMap& map) {
  if (!fs::is_directory(folder)) {
    throw std::runtime_error(folder.string() + ": is no folder of images");
  }
  if (map.is_video) {
    FollowEnding(folder, map);
    CheckCount(run, folder, map);
  }
  const ThumbnailTable thumbnails = ThumbnailsOf(run, observer);
  std::vector<const MapFrame*> frames;
  for (const MapFrame& frame : map.frames) {
    if (!WasUnreadable(thumbnails, frame.id)) frames.push_back(&frame);
  }
  const int count = static_cast<int>(frames.size());
  std::vector<OfferedPicture> pictures(frames.size());
  for (int first = 0; first < count; first += kImagesAtOnce) {
    ParallelFor(std::min(kImagesAtOnce, count - first), num_threads, [&](int k) {
      pictures[first + k] = ReadPicture(folder, *frames[first + k], map.camera);
    });
    observer.step(std::min(count, first + kImagesAtOnce), count);
  }
  if (const auto problem = FindWrongPicture(thumbnails, pictures)) {
    throw std::runtime_error(*problem + "; --extract DIR writes the right ones");
  }
}

void ExtractImages(const fs::path& run,
                   const fs::path& folder,
                   const ImageChange& change,
                   const ImageObserver& observer,
                   const RunMap& map) {
  const nlohmann::ordered_json summary = ReadSummaryOf(run);
  const std::string path = SequenceOf(run, summary);
  const std::unique_ptr<Sequence> sequence = OpenSequence(path, SequenceOptionsOf(summary));
  const ThumbnailTable thumbnails = ThumbnailsOf(run, observer);
  MakeFolder(folder);
  std::error_code error;
  if (fs::equivalent(folder, sequence->image_folder(), error)) {
    throw std::runtime_error(folder.string() + ": the images are there already");
  }
  const int count = static_cast<int>(map.frames.size());
  int num_read = 0;
  std::vector<OfferedPicture> pictures;
  while (const std::optional<Frame> frame = sequence->Next()) {
    if (num_read == count) break;
    observer.step(++num_read, count);
    if (frame->image.empty()) continue;
    WriteFrame(folder, map, *frame, change);
    pictures.push_back({frame->id, path + ": " + frame->name, MakeFrameThumbnail(frame->image)});
  }
  if (num_read < count) {
    throw std::runtime_error(path + ": has " + std::to_string(num_read) +
                             " frames, the run has read " + std::to_string(count));
  }
  if (const auto problem = FindWrongPicture(thumbnails, pictures)) {
    throw std::runtime_error(*problem + ": it has changed since; run the sequence again");
  }
}

void ChangeImages(const fs::path& from,
                  const fs::path& to,
                  const ImageChange& change,
                  const ImageObserver& observer,
                  const RunMap& map) {
  int num_done = 0;
  for (const MapFrame& frame : map.frames) {
    const DecodedImage decoded = ReadImageFile(from / frame.image);
    observer.step(++num_done, static_cast<int>(map.frames.size()));
    if (decoded.image.empty()) continue;
    const fs::path file = (to / frame.image).replace_extension(".png");
    MakeFolder(file.parent_path());
    WritePng(file, change(frame.id, decoded.image));
  }
}

}  // namespace rotslam
