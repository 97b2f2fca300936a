// Where the processor time of a whole run goes.
//
//   run_bench SEQUENCE [--camera FILE] [--threads N,N,...] [--frames N]
//
// Runs the system on a sequence once for each number of threads, writes nothing, and prints by
// stage: processor time of the whole process and wall time, in ms a frame, with the share of the
// processor time and how often the stage began (more than once: done again). Below it the parts of
// the stages, from the clocks that the stages keep themselves: the frame's work, the keyframes',
// and each round of bundle adjustment. Images that are read a second time are a line of their own.
// The last line is the peak of memory.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <sys/resource.h>

#include "apps/slam/build_map.h"
#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "apps/slam/slam.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/types/stopwatch.h"
#include "tests/bench/sequence_camera.h"

namespace rotslam {
namespace {

struct Flags {
  std::string sequence;
  std::string camera;
  std::vector<int> threads;
  int frames = -1;  // negative: all
};

std::vector<int> NumbersOf(const std::string& list) {
  std::vector<int> numbers;
  for (std::size_t first = 0; first < list.size();) {
    const std::size_t comma = std::min(list.find(',', first), list.size());
    numbers.push_back(std::stoi(list.substr(first, comma - first)));
    first = comma + 1;
  }
  return numbers;
}

Flags Parse(int argc, char** argv) {
  Flags flags;
  flags.threads = {1, 2};
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    if (word == "--camera" && k + 1 < argc) {
      flags.camera = argv[++k];
    } else if (word == "--threads" && k + 1 < argc) {
      flags.threads = NumbersOf(argv[++k]);
    } else if (word == "--frames" && k + 1 < argc) {
      flags.frames = std::stoi(argv[++k]);
    } else {
      flags.sequence = word;
    }
  }
  if (flags.sequence.empty()) {
    throw std::runtime_error(
        "usage: run_bench SEQUENCE [--camera FILE] [--threads N,N,...] [--frames N]");
  }
  return flags;
}

// Of the process with all its threads.
double ProcessorSeconds() {
  timespec time = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

struct Cost {
  double processor_s = 0.0;
  double wall_s = 0.0;
  int count = 0;
};

// Adds to a cost until it goes out of scope.
class Meter {
 public:
  explicit Meter(Cost& cost) : cost_(cost), stopwatch_(cost.wall_s) { ++cost.count; }
  ~Meter() { cost_.processor_s += ProcessorSeconds() - start_; }
  Meter(const Meter&) = delete;
  Meter& operator=(const Meter&) = delete;

 private:
  Cost& cost_;
  Stopwatch stopwatch_;
  double start_ = ProcessorSeconds();
};

// A sequence that counts what reading it costs.
class MeteredFrames final : public FrameSource {
 public:
  explicit MeteredFrames(FrameSource& frames) : frames_(frames) {}

  std::optional<Frame> Next() override {
    const Meter meter(next_);
    return frames_.Next();
  }
  void Skip(int count) override { frames_.Skip(count); }
  void Rewind() override { frames_.Rewind(); }
  int NumFrames() const override { return frames_.NumFrames(); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId frame, const cv::Mat& image)>& take,
            const std::function<void(const std::string& problem)>& tell) override {
    num_read_again_ += static_cast<int>(frames.size());
    const Meter meter(again_);
    frames_.Read(frames, take, tell);
  }

  const Cost& next() const { return next_; }
  const Cost& again() const { return again_; }
  int num_read_again() const { return num_read_again_; }

 private:
  FrameSource& frames_;
  Cost next_;
  Cost again_;
  int num_read_again_ = 0;
};

// The time from the beginning of each stage to the next one's.
class StageMeter final : public SlamObserver {
 public:
  void OnBegin(SlamStage stage, int /*num_steps*/) override {
    Close();
    present_ = &costs_[stage];
    ++present_->count;
    start_ = std::chrono::steady_clock::now();
    start_processor_s_ = ProcessorSeconds();
  }
  void OnFrame(const FrameProgress& /*progress*/) override { ++num_frames_; }

  void Close() {
    if (present_ == nullptr) return;
    present_->wall_s += SecondsSince(start_);
    present_->processor_s += ProcessorSeconds() - start_processor_s_;
    present_ = nullptr;
  }

  const std::map<SlamStage, Cost>& costs() const { return costs_; }
  int num_frames() const { return num_frames_; }

 private:
  std::map<SlamStage, Cost> costs_;
  Cost* present_ = nullptr;
  std::chrono::steady_clock::time_point start_;
  double start_processor_s_ = 0.0;
  int num_frames_ = 0;  // tracked, those tracked again included
};

void PrintPart(const std::string& name, double seconds, int num_frames) {
  if (seconds > 0.0) std::printf("    %-28s %17.2f\n", name.c_str(), 1e3 * seconds / num_frames);
}

void PrintOrientationParts(const Orientations& orientations, int num_frames) {
  const OdometrySeconds& odometry = orientations.seconds;
  const LoopSeconds& loops = orientations.loop_seconds;
  const std::vector<std::pair<const char*, double>> parts = {
      {"pyramids", odometry.pyramid},
      {"tracking", odometry.tracking},
      {"detection", odometry.detection},
      {"relative rotations", odometry.edges},
      {"averaging", odometry.averaging},
      {"covariances", odometry.covariance},
      {"loops: descriptors", loops.description},
      {"loops: candidates", loops.candidates},
      {"loops: verification", loops.verification},
      {"loops: averaging", orientations.global_averaging_seconds}};
  for (const auto& [name, seconds] : parts) PrintPart(name, seconds, num_frames);
}

void PrintMapParts(const MapResult& map, int num_frames) {
  std::printf("  of the map (%zu keyframes, %zu tracks), wall ms a frame:\n",
              map.keyframes.size(),
              map.keyframe_tracks.size());
  PrintPart("known rotation", map.krot.seconds, num_frames);
  for (const BundleSummary& bundle : map.bundles) {
    for (const BundleRoundSummary& round : bundle.rounds) {
      const std::string name = "round " + round.name + ", " + std::to_string(round.iterations) +
                               " steps, " + std::to_string(round.num_observations / 1000) + "k";
      PrintPart(name, round.seconds, num_frames);
      PrintPart("  of which Ceres", round.solver_seconds, num_frames);
    }
    PrintPart("adjustment, all", bundle.seconds, num_frames);
  }
  PrintPart("bracket of the result", map.final_bracket.seconds, num_frames);
}

void PrintRun(const Flags& flags, int num_threads) {
  SequenceOptions sequence_options;
  if (flags.frames > 0) sequence_options.last = flags.frames - 1;
  SequenceSource source(flags.sequence, sequence_options);
  const Sequence& sequence = source.sequence();
  const Camera camera = CameraOfSequence(sequence, flags.camera);
  SlamOptions options;
  options.num_threads = num_threads;
  MeteredFrames frames(source);
  StageMeter stages;
  Cost all;
  SlamResult result;
  {
    const Meter meter(all);
    result = RunSlam(frames, camera, options, stages);
    stages.Close();
  }
  const int num_frames = static_cast<int>(result.orientations.timestamps_s.size());
  std::printf("%s, %d frames, %d threads: %.1f ms a frame of processor time, %.1f of wall time\n",
              flags.sequence.c_str(),
              num_frames,
              num_threads,
              1e3 * all.processor_s / num_frames,
              1e3 * all.wall_s / num_frames);
  std::printf("  %-30s %8s %8s %6s %6s\n", "stage", "CPU", "wall", "share", "times");
  const auto print = [&](const std::string& name, const Cost& cost) {
    std::printf("  %-30s %8.2f %8.2f %5.1f%% %6d\n",
                name.c_str(),
                1e3 * cost.processor_s / num_frames,
                1e3 * cost.wall_s / num_frames,
                100.0 * cost.processor_s / all.processor_s,
                cost.count);
  };
  for (const auto& [stage, cost] : stages.costs()) print(ToString(stage), cost);
  print("of these: reading images", frames.next());
  print("of these: reading them again", frames.again());
  std::printf(
      "  tracked %d frames, read %d images again\n", stages.num_frames(), frames.num_read_again());
  std::printf("  of the orientations (without what was tracked again), wall ms a frame:\n");
  PrintOrientationParts(result.orientations, num_frames);
  PrintMapParts(result.map, num_frames);
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("  peak of memory so far: %.0f MB\n", static_cast<double>(usage.ru_maxrss) / 1024.0);
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    const rotslam::Flags flags = rotslam::Parse(argc, argv);
    for (const int threads : flags.threads) rotslam::PrintRun(flags, threads);
    return 0;
  } catch (const std::exception& problem) {
    std::fprintf(stderr, "run_bench: %s\n", problem.what());
    return 1;
  }
}
