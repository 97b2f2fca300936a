// What `rotslam run` makes of a camera that walks, turns in place and walks on: a table over kinds
// of turns, with the detection of pure rotation and, below, without it.
//
//   gimbal_report [FOLDER]
//
// Sequences are rendered below FOLDER (a temporary one otherwise) and kept there. Columns: root
// mean square and largest error of the turn from frame to frame, deg; largest distance of a frame
// of the turn from the place where the turn began, mm (the estimate scaled as its first part asks);
// scale of the part behind the turn over that of the part before (1 is right) and what segments.csv
// says of it; precision and recall of the frames said to rotate or stand still, first against
// frames that stand exactly, then against those within 0.1 mm of the place, whose flow is a
// fiftieth of a pixel: braking cameras creep. Then how far off the place the farthest frame is that
// is said to stand, mm, and last the position error, mm.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory.h"
#include "tests/apps/command_line.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct Variant {
  std::string name;
  std::vector<std::string> flags;
};

std::vector<Variant> Variants() {
  return {{"yaw 30", {"--turn-deg=30"}},
          {"yaw 120", {}},
          {"yaw 360", {"--turn-deg=360", "--frames=240"}},
          {"pitch 40", {"--turn-axis=pitch", "--turn-deg=40"}},
          {"pitch 360", {"--turn-axis=pitch", "--turn-deg=360", "--frames=240"}},
          {"roll 90", {"--turn-axis=roll", "--turn-deg=90"}},
          {"roll 360", {"--turn-axis=roll", "--turn-deg=360", "--frames=240"}},
          {"yaw 120 slow", {"--frames=300"}},
          {"yaw 120 fast", {"--frames=60"}},
          {"yaw 120 noise 6", {"--noise=6"}},
          {"yaw 120 blur 4", {"--blur=4", "--shutter=0.005"}},
          {"yaw 120 blur 17", {"--blur=6", "--shutter=0.02"}},
          {"yaw 120 boxes", {"--distractors=4"}},
          {"yaw 120 1 cm", {"--lever-arm=0.01"}},
          {"yaw 120 3 cm", {"--lever-arm=0.03"}},
          {"yaw 120 5 cm", {"--lever-arm=0.05"}},
          {"yaw 360 5 cm", {"--turn-deg=360", "--frames=240", "--lever-arm=0.05"}},
          {"pitch 180 10 cm", {"--turn-axis=pitch", "--turn-deg=180", "--lever-arm=0.1"}}};
}

struct Segment {
  int first_frame = 0;
  int last_frame = 0;
  std::string kind;
  std::string scale;
};

std::vector<Segment> ReadSegments(const fs::path& path) {
  std::vector<Segment> segments;
  const std::vector<std::string> lines = Lines(ReadWholeFile(path));
  for (std::size_t k = 1; k < lines.size(); ++k) {
    std::istringstream line(lines[k]);
    Segment& segment = segments.emplace_back();
    std::string cell;
    std::getline(line, cell, ',');
    segment.first_frame = std::stoi(cell);
    std::getline(line, cell, ',');
    segment.last_frame = std::stoi(cell);
    std::getline(line, segment.kind, ',');
    std::getline(line, cell, ',');
    std::getline(line, segment.scale, ',');
  }
  return segments;
}

std::vector<bool> Standing(const std::vector<Segment>& segments, int num_frames) {
  std::vector<bool> standing(num_frames, false);
  for (const Segment& segment : segments) {
    if (segment.kind == "translating") continue;
    for (int n = segment.first_frame; n <= segment.last_frame; ++n) standing[n] = true;
  }
  return standing;
}

struct Score {
  int right = 0;
  int claimed = 0;
  int there = 0;

  double Precision() const { return claimed == 0 ? 1.0 : static_cast<double>(right) / claimed; }
  double Recall() const { return there == 0 ? 1.0 : static_cast<double>(right) / there; }
};

Score Compare(const std::vector<bool>& truth, const std::vector<bool>& estimate) {
  Score score;
  for (std::size_t n = 0; n < truth.size(); ++n) {
    score.right += truth[n] && estimate[n];
    score.claimed += estimate[n];
    score.there += truth[n];
  }
  return score;
}

TrajectoryMetrics MetricsOf(const Trajectory& truth, const Trajectory& estimate, int from, int to) {
  const Trajectory part(estimate.begin() + from, estimate.begin() + to + 1);
  return ComputeMetrics(AssociatePoses(truth, part, {}), {});
}

void Report(const fs::path& sequence, const fs::path& out) {
  const Trajectory truth = ReadTrajectory(sequence / "groundtruth_tum.txt");
  const Trajectory estimate = ReadTrajectory(out / "trajectory_tum.txt");
  const int num_frames = static_cast<int>(truth.size());
  const std::vector<Segment> segments = ReadSegments(out / "segments.csv");
  const std::vector<Segment> true_segments = ReadSegments(sequence / "segments_truth.csv");
  const Segment turn = *std::find_if(true_segments.begin(), true_segments.end(), [](const auto& s) {
    return s.kind == "rotating";
  });
  const TrajectoryMetrics all = MetricsOf(truth, estimate, 0, num_frames - 1);
  const TrajectoryMetrics before = MetricsOf(truth, estimate, 0, turn.first_frame);
  const TrajectoryMetrics after = MetricsOf(truth, estimate, turn.last_frame, num_frames - 1);
  const double scale = before.scale.value_or(NAN);
  const std::vector<bool> found = Standing(segments, num_frames);
  double drift_m = 0.0;
  double farthest_m = 0.0;
  std::vector<bool> exact(num_frames);
  std::vector<bool> near(num_frames);
  const Eigen::Vector3d place = truth[turn.first_frame].center_in_world;
  for (int n = 0; n < num_frames; ++n) {
    const double distance_m = (truth[n].center_in_world - place).norm();
    exact[n] = distance_m == 0.0;
    near[n] = distance_m < 1e-4;
    if (found[n]) farthest_m = std::max(farthest_m, distance_m);
    if (n < turn.first_frame || n > turn.last_frame) continue;
    drift_m = std::max(
        drift_m,
        scale * (estimate[n].center_in_world - estimate[turn.first_frame].center_in_world).norm());
  }
  const Score strict = Compare(exact, found);
  const Score lenient = Compare(near, found);
  std::printf("%8.4f %7.4f %8.3f %8.3f %-10s  %.3f %.3f  %.3f %.3f %8.3f %8.1f\n",
              all.rpe1_deg,
              all.rpe1_max_deg,
              1e3 * drift_m,
              scale / after.scale.value_or(NAN),
              segments.back().scale.c_str(),
              strict.Precision(),
              strict.Recall(),
              lenient.Precision(),
              lenient.Recall(),
              1e3 * farthest_m,
              1e3 * all.ate_m.value_or(NAN));
}

int Main(int argc, char** argv) {
  const TemporaryFolder temporary;
  const fs::path folder = argc > 1 ? fs::path(argv[1]) : temporary.path();
  fs::create_directories(folder);
  std::ofstream(folder / "without.yaml") << "pure_rotation_segments: {enabled: false}\n";
  for (const bool detects : {true, false}) {
    std::printf("%s detection of pure rotation\n", detects ? "with" : "\nwithout");
    std::printf("%-16s %8s %7s %8s %8s %-10s  %s  %s %8s %8s\n",
                "",
                "RPE_1",
                "max",
                "drift",
                "scale",
                "tied by",
                "prec. recall",
                ".1mm: p. r. ",
                "farthest",
                "ATE");
    for (const Variant& variant : Variants()) {
      std::string name = variant.name;
      std::replace(name.begin(), name.end(), ' ', '_');
      const fs::path sequence = folder / name;
      if (!fs::exists(sequence / "groundtruth_tum.txt")) {
        Rotslam({"simulate", "gimbal", "--quiet", "--out=" + sequence.string()}, variant.flags);
      }
      const fs::path out = folder / (name + (detects ? "_with" : "_without"));
      std::vector<std::string> more;
      if (!detects) more = {"--config=" + (folder / "without.yaml").string()};
      const CommandResult run =
          Rotslam({"run", sequence.string(), "--quiet", "--out=" + out.string()}, more);
      std::printf("%-16s ", variant.name.c_str());
      if (fs::exists(out / "trajectory_tum.txt")) {
        Report(sequence, out);
      } else {
        std::printf("%s", run.error.c_str());
      }
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) { return rotslam::Main(argc, argv); }
