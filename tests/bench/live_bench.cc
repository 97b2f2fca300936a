// How fast and how exact the live mode is.
//
//   live_bench SEQUENCE OUT [--camera FILE] [--threads N] [--realtime] [--finish] [--keep-map]
//
// Gives the frames of a sequence to LiveSlam, with --realtime at the pace of their timestamps: a
// frame that the last one has made late is dropped. With --keep-map loops do not move the map.
// Writes into OUT emitted_tum.txt (orientations as emitted; positions from the first one on),
// orientations_tum.txt (all frames, positions zero) and frames.csv (latency, state, points), and
// latency.svg. Prints one line: latency, lag of the map, states.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "apps/slam/live/live_slam.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/types/stopwatch.h"
#include "tests/bench/sequence_camera.h"

namespace rotslam {
namespace {

struct Flags {
  std::string sequence;
  std::filesystem::path out;
  std::string camera;
  int threads = 2;
  bool realtime = false;
  bool finish = false;
  bool correct_map = true;
};

Flags Parse(int argc, char** argv) {
  Flags flags;
  std::vector<std::string> places;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    if (word == "--camera" && k + 1 < argc) {
      flags.camera = argv[++k];
    } else if (word == "--threads" && k + 1 < argc) {
      flags.threads = std::stoi(argv[++k]);
    } else if (word == "--realtime") {
      flags.realtime = true;
    } else if (word == "--finish") {
      flags.finish = true;
    } else if (word == "--keep-map") {
      flags.correct_map = false;
    } else {
      places.push_back(word);
    }
  }
  if (places.size() != 2) {
    throw std::runtime_error(
        "usage: live_bench SEQUENCE OUT [--camera FILE] [--threads N] [--realtime] [--finish] "
        "[--keep-map]");
  }
  flags.sequence = places[0];
  flags.out = places[1];
  return flags;
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const auto last = static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(share * last + 0.5)];
}

// Latency over frames as a picture: up to twice its 99 % quantile, with lines every 20 ms.
void DrawLatency(const std::filesystem::path& file, const std::vector<double>& latencies_ms) {
  constexpr double kWidth = 1000.0;
  constexpr double kHeight = 300.0;
  constexpr double kLineMs = 20.0;
  if (latencies_ms.empty()) return;
  const double top_ms = std::max(2.0 * kLineMs, 2.0 * Quantile(latencies_ms, 0.99));
  const auto y = [&](double ms) { return kHeight * (1.0 - std::min(ms / top_ms, 1.0)); };
  std::ofstream svg(file);
  svg << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='-60 -20 1080 350' font-size='14' "
         "font-family='sans-serif'>\n<rect x='-60' y='-20' width='1080' height='350' "
         "fill='white'/>\n";
  for (double ms = 0.0; ms <= top_ms; ms += kLineMs) {
    svg << "<path d='M0 " << y(ms) << " H" << kWidth << "' stroke='#ccc'/><text x='-8' y='"
        << y(ms) + 5.0 << "' text-anchor='end'>" << ms << "</text>\n";
  }
  svg << "<path fill='none' stroke='#1f77b4' d='";
  for (std::size_t k = 0; k < latencies_ms.size(); ++k) {
    const double x = kWidth * static_cast<double>(k) / static_cast<double>(latencies_ms.size());
    svg << (k == 0 ? 'M' : 'L') << x << ' ' << y(latencies_ms[k]) << ' ';
  }
  svg << "'/>\n<text x='0' y='" << kHeight + 22.0 << "'>latency of AddFrame, ms, over "
      << latencies_ms.size() << " frames</text>\n</svg>\n";
}

int Main(const Flags& flags) {
  SequenceSource source(flags.sequence, {});
  const Sequence& sequence = source.sequence();
  const Camera camera = CameraOfSequence(sequence, flags.camera);
  SlamOptions options;
  options.num_threads = flags.threads;
  LiveOptions live;
  live.correct_map = flags.correct_map;
  LiveSlam slam(camera, options, live);
  std::filesystem::create_directories(flags.out);
  std::ofstream csv(flags.out / "frames.csv");
  csv << "frame,latency_ms,state,points,revision,lag_s\n";
  Trajectory emitted;
  Trajectory orientations;
  std::vector<double> latencies_ms;
  std::map<std::string, int> states;
  int num_dropped = 0;
  int first_position = -1;
  std::vector<double> lags_s;
  const auto start = std::chrono::steady_clock::now();
  double first_s = -1.0;
  while (std::optional<Frame> frame = source.Next()) {
    if (first_s < 0.0) first_s = frame->timestamp_s;
    const double ahead_s = frame->timestamp_s - first_s - SecondsSince(start);
    if (flags.realtime && ahead_s > 0.0) {
      std::this_thread::sleep_for(std::chrono::duration<double>(ahead_s));
    } else if (flags.realtime && ahead_s < -0.2) {
      ++num_dropped;
      continue;
    }
    const auto begin = std::chrono::steady_clock::now();
    const LiveEstimate estimate = slam.AddFrame(frame->timestamp_s, frame->image, frame->name);
    const double latency_ms = 1e3 * SecondsSince(begin);
    latencies_ms.push_back(latency_ms);
    ++states[ToString(estimate.state)];
    const auto map = slam.Map();
    const double lag_s = map ? estimate.timestamp_s - map->Newest()->timestamp_s : -1.0;
    if (map) lags_s.push_back(lag_s);
    csv << estimate.frame.value << ',' << latency_ms << ',' << ToString(estimate.state) << ','
        << estimate.num_points << ',' << estimate.map_revision << ',' << lag_s << '\n';
    const Rotation world_from_cam = estimate.cam_from_world.Inverse();
    orientations.push_back({estimate.timestamp_s, world_from_cam});
    if (!estimate.center_in_world) continue;
    if (first_position < 0) first_position = estimate.frame.value;
    emitted.push_back({estimate.timestamp_s, world_from_cam, *estimate.center_in_world});
  }
  WriteTumTrajectory(flags.out / "emitted_tum.txt", emitted);
  WriteTumTrajectory(flags.out / "orientations_tum.txt", orientations);
  DrawLatency(flags.out / "latency.svg", latencies_ms);
  const auto num_end = std::min(std::ssize(latencies_ms), std::ptrdiff_t{500});
  std::printf(
      "%zu frames, latency median %.1f p99 %.1f worst %.1f ms, waited %.2f s in all, "
      "median of the first 500 %.1f and last 500 %.1f ms, dropped %d, first position %d, lag of "
      "the "
      "map median %.2f s",
      latencies_ms.size(),
      Quantile(latencies_ms, 0.5),
      Quantile(latencies_ms, 0.99),
      Quantile(latencies_ms, 1.0),
      slam.waited_s(),
      Quantile({latencies_ms.begin(), latencies_ms.begin() + num_end}, 0.5),
      Quantile({latencies_ms.end() - num_end, latencies_ms.end()}, 0.5),
      num_dropped,
      first_position,
      Quantile(lags_s, 0.5));
  for (const auto& [state, count] : states) std::printf(", %s %d", state.c_str(), count);
  if (const auto map = slam.Map()) {
    Trajectory keyframes;
    for (const LiveKeyframe& keyframe : map->keyframes) {
      keyframes.push_back(
          {keyframe.timestamp_s, keyframe.cam_from_world.Inverse(), keyframe.center_in_world});
    }
    WriteTumTrajectory(flags.out / "keyframes_tum.txt", keyframes);
    std::printf(", %zu keyframes, %zu points, %d corrections",
                map->keyframes.size(),
                map->points.size(),
                map->num_corrections);
  }
  std::printf("\n");
  if (flags.finish) {
    SlamObserver nobody;
    const auto begin = std::chrono::steady_clock::now();
    source.Rewind();
    const SlamResult result = slam.Finish(&source, nobody);
    Trajectory finished;
    for (const auto& [frame, rotation] : result.map.cam_from_world) {
      finished.push_back({result.orientations.timestamps_s[frame.value],
                          rotation.Inverse(),
                          result.map.center_in_world.at(frame)});
    }
    WriteTumTrajectory(flags.out / "finished_tum.txt", finished);
    std::printf("finished in %.1f s\n", SecondsSince(begin));
  }
  return 0;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    return rotslam::Main(rotslam::Parse(argc, argv));
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "live_bench: %s\n", problem.what());
    return 1;
  }
}
