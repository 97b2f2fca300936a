// The whole odometry over a sequence: ms per frame per stage, wall and CPU, beside its accuracy.
//
// Sequences: a rendered street and a rendered walk, 60 frames each; and what the environment
// variable ROTSLAM_BENCH_SEQUENCE names, else kitti00 of the shared data, where it is present.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>
#include <malloc.h>
#include <sys/resource.h>

#include "apps/simulation/simulation.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/odometry.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

double WallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// A line of /proc/self/status, in MB: VmRSS is what is used now, VmHWM the most since ResetPeak.
double MemoryMb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kilobytes = 0.0;
    if (word == key + ":" && status >> kilobytes) return kilobytes / 1024.0;
  }
  return 0.0;
}

void ResetPeak() { std::ofstream("/proc/self/clear_refs") << '5'; }

struct Clip {
  Camera camera;
  Trajectory truth;
  std::vector<double> timestamps_s;
  std::vector<cv::Mat> images;
  double decode_ms = 0.0;  // a frame, on the one thread that decodes
};

Clip Rendered(SimulationKind kind) {
  SimulationOptions options;
  options.kind = kind;
  options.last = 59;
  SimulatedSequence sequence = RenderSequence(options, 2);
  Clip clip{sequence.camera, sequence.truth, {}, std::move(sequence.images), 0.0};
  for (const StampedPose& pose : clip.truth) clip.timestamps_s.push_back(pose.timestamp_s);
  return clip;
}

Clip Read(const std::string& path) {
  const auto sequence = OpenSequence(path, {});
  if (!sequence->camera_reference()) throw std::runtime_error(path + ": has no calibration");
  Clip clip;
  clip.camera = MatchToImages(ReadCamera(*sequence->camera_reference()), sequence->image_size());
  const double start = WallSeconds();
  while (auto frame = sequence->Next()) clip.images.push_back(std::move(frame->image));
  clip.decode_ms = 1e3 * (WallSeconds() - start) / static_cast<double>(clip.images.size());
  clip.timestamps_s = sequence->timestamps_s();
  // Truth with one pose a frame counts, interpolation is the eval command's business.
  if (const auto& file = sequence->GroundTruthFile()) {
    clip.truth = ReadTrajectory(*file);
    if (clip.truth.size() != clip.images.size()) clip.truth.clear();
  }
  return clip;
}

const Clip& ClipNamed(const std::string& name) {
  static std::map<std::string, Clip> clips;
  if (const auto known = clips.find(name); known != clips.end()) return known->second;
  if (name == "street") return clips[name] = Rendered(SimulationKind::kStreet);
  if (name == "handheld") return clips[name] = Rendered(SimulationKind::kHandheld);
  return clips[name] = Read(name);
}

void BM_Odometry(benchmark::State& state, const std::string& name) {
  const Clip& clip = ClipNamed(name);
  const int num_frames = static_cast<int>(clip.images.size());
  OdometrySeconds seconds;
  RotationMap cam_from_world;
  double num_inliers = 0.0;
  double memory_mb = 0.0;
  double wall = 0.0;
  double cpu = 0.0;
  for (auto _ : state) {
    malloc_trim(0);
    ResetPeak();
    const double memory_before = MemoryMb("VmRSS");
    const double wall_before = WallSeconds();
    const double cpu_before = CpuSeconds();
    RotationalOdometry odometry(clip.camera, {}, 1, static_cast<int>(state.range(0)));
    num_inliers = 0.0;
    for (int k = 0; k < num_frames; ++k) {
      const FrameEstimate estimate =
          odometry.AddFrame(FrameId{k}, clip.timestamps_s[k], clip.images[k]);
      num_inliers += estimate.report.num_inliers;
      for (const auto& [frame, rotation] : estimate.window) cam_from_world[frame] = rotation;
    }
    wall += WallSeconds() - wall_before;
    cpu += CpuSeconds() - cpu_before;
    const OdometrySeconds& own = odometry.seconds();
    seconds.pyramid += own.pyramid;
    seconds.tracking += own.tracking;
    seconds.detection += own.detection;
    seconds.edges += own.edges;
    seconds.averaging += own.averaging;
    seconds.covariance += own.covariance;
    memory_mb = std::max(memory_mb, MemoryMb("VmHWM") - memory_before);
  }
  const double frames = static_cast<double>(state.iterations()) * num_frames;
  state.counters["decode"] = clip.decode_ms;
  state.counters["pyramid"] = 1e3 * seconds.pyramid / frames;
  state.counters["tracking"] = 1e3 * seconds.tracking / frames;
  state.counters["detection"] = 1e3 * seconds.detection / frames;
  state.counters["edges"] = 1e3 * seconds.edges / frames;
  state.counters["averaging"] = 1e3 * seconds.averaging / frames;
  state.counters["covariance"] = 1e3 * seconds.covariance / frames;
  state.counters["all"] = 1e3 * wall / frames;
  state.counters["all_cpu"] = 1e3 * cpu / frames;
  state.counters["frames_per_s"] = frames / wall;
  state.counters["memory_mb"] = memory_mb;
  state.counters["inliers"] = num_inliers / num_frames;
  if (clip.truth.empty()) return;
  double squared_deg = 0.0;
  for (int k = 1; k < num_frames; ++k) {
    const Rotation truth =
        clip.truth[k].world_from_cam.Inverse() * clip.truth[k - 1].world_from_cam;
    const Rotation turn =
        cam_from_world.at(FrameId{k}) * cam_from_world.at(FrameId{k - 1}).Inverse();
    squared_deg += std::pow((turn * truth.Inverse()).AngleDeg(), 2);
  }
  state.counters["rpe1_mdeg"] = 1e3 * std::sqrt(squared_deg / (num_frames - 1));
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  std::vector<std::string> names = {"street", "handheld"};
  const char* chosen = std::getenv("ROTSLAM_BENCH_SEQUENCE");
  const std::string path = chosen != nullptr ? chosen : ROTSLAM_SHARED_DIR "/data/kitti00";
  if (chosen != nullptr || std::filesystem::exists(path)) names.push_back(path);
  for (const std::string& name : names) {
    benchmark::RegisterBenchmark(
        ("BM_Odometry/" + std::filesystem::path(name).filename().string()).c_str(),
        [name](benchmark::State& state) { rotslam::BM_Odometry(state, name); })
        ->ArgName("threads")
        ->Arg(1)
        ->Arg(2)
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->Unit(benchmark::kMillisecond);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
