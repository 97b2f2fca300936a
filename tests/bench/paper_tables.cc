// Tables I and II of the paper and the data of its figure "runtime", for its method as published
// and for ours, and what each difference between the two is worth.
//
//   paper_tables [--seeds N] [--last FRAME] [--runtime FILE.csv] [--camera FILE] SEQUENCE ...
//
// A sequence is a folder with images, calibration and ground truth: KITTI odometry, what `rotslam
// simulate` writes, or any other form that `rotslam run` reads. --camera is for the sequences
// behind it. With --seeds the paper's method runs N times with other random numbers, and medians
// are shown, as in the paper (five); ours once. Tables are Markdown and the same at every run, but
// for those of time, which come last.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <time.h>

#include "apps/paper_method/equal_averaging.h"
#include "apps/paper_method/paper_graph.h"
#include "apps/paper_method/paper_loops.h"
#include "apps/paper_method/paper_options.h"
#include "apps/paper_method/spread_orb.h"
#include "apps/paper_method/window_matching.h"
#include "output/trajectory/metrics.h"
#include "output/trajectory/trajectory.h"
#include "output/trajectory/trajectory_match.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/features/view.h"
#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/frame_record.h"
#include "rotodom/loop/looped_odometry.h"
#include "rotodom/relative_rotation/relative_rotation.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Of the process: all its threads.
double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Adds the CPU time until it goes out of scope.
class CpuWatch {
 public:
  explicit CpuWatch(double& seconds) : seconds_(seconds) {}
  ~CpuWatch() { seconds_ += CpuSeconds() - start_; }
  CpuWatch(const CpuWatch&) = delete;
  CpuWatch& operator=(const CpuWatch&) = delete;

 private:
  double& seconds_;
  double start_ = CpuSeconds();
};

struct Arguments {
  struct Input {
    std::string path;
    std::string camera;  // empty: the one that lies with the images
  };
  std::vector<Input> inputs;
  int num_seeds = 1;
  int last = -1;
  std::string runtime;
};

Arguments Parse(int argc, char** argv) {
  Arguments arguments;
  std::string camera;
  for (int k = 1; k < argc; ++k) {
    const std::string word = argv[k];
    const bool is_flag = word.starts_with("--");
    if (is_flag && k + 1 == argc) throw std::runtime_error(word + " needs a value");
    if (word == "--seeds") {
      arguments.num_seeds = std::stoi(argv[++k]);
    } else if (word == "--last") {
      arguments.last = std::stoi(argv[++k]);
    } else if (word == "--runtime") {
      arguments.runtime = argv[++k];
    } else if (word == "--camera") {
      camera = argv[++k];
    } else if (is_flag) {
      throw std::runtime_error("what is " + word + "?");
    } else {
      arguments.inputs.push_back({word, camera});
    }
  }
  if (arguments.inputs.empty() || arguments.num_seeds < 1) {
    throw std::runtime_error(
        "usage: paper_tables [--seeds N] [--last FRAME] [--runtime FILE.csv] [--camera FILE] "
        "SEQUENCE ...");
  }
  return arguments;
}

// ---- solvers

// Estimates each pair of a frame once and gives the same edge to all graphs that ask for it. Their
// starts are the same, too, as long as every pair before has an edge.
PairSolver Shared(const PairSolver& solver) {
  struct Known {
    FrameId newest;
    std::map<FrameId, std::optional<RelativeRotation>> edges;
  };
  return [solver, known = std::make_shared<Known>()](
             const PairMatches& matches, const Rotation& start, std::uint64_t seed) {
    if (known->newest != matches.j) *known = {matches.j, {}};
    const auto found = known->edges.find(matches.i);
    if (found != known->edges.end()) return found->second;
    return known->edges.emplace(matches.i, solver(matches, start, seed)).first->second;
  };
}

// Our estimator on matches of any origin.
PairSolver OurPairs(double focal_px) {
  return [focal_px](const PairMatches& matches,
                    const Rotation& start,
                    std::uint64_t seed) -> std::optional<RelativeRotation> {
    const auto estimate = EstimateRelativeRotation({matches.pairs}, start, focal_px, {}, seed);
    if (!estimate) return std::nullopt;
    RelativeRotation edge;
    edge.i = matches.i;
    edge.j = matches.j;
    edge.j_from_i = estimate->j_from_i;
    edge.covariance = estimate->covariance;
    edge.num_inliers = static_cast<int>(estimate->inliers.size());
    return edge;
  };
}

// The edges that our odometry has estimated for its newest frame.
PairSolver KnownEdges(const std::vector<EdgeWithMatches>& connections) {
  return [&connections](const PairMatches& matches,
                        const Rotation&,
                        std::uint64_t) -> std::optional<RelativeRotation> {
    for (const EdgeWithMatches& connection : connections) {
      if (connection.edge.i == matches.i) return connection.edge;
    }
    return std::nullopt;
  };
}

WindowAverager OurAverager() {
  return [](const ViewGraph& graph,
            const RotationMap& cam_from_world,
            const std::set<FrameId>& free_views) {
    return AverageRotations(graph, cam_from_world, free_views, {});
  };
}

// ---- what is measured

// A variant of the method: its graph, and how long its averaging took, by frame.
struct Variant {
  PaperGraph graph;
  std::shared_ptr<std::vector<double>> averaging_ms;
};

Variant MakeVariant(AveragingMode mode,
                    const PairSolver& solver,
                    const WindowAverager& averager,
                    std::uint64_t seed) {
  auto times = std::make_shared<std::vector<double>>();
  PaperGraphOptions options;
  options.averaging.mode = mode;
  options.min_edge_inliers = PaperDefaults().view_graph.min_edge_inliers;
  options.solver = solver;
  options.averager = [averager, times](const ViewGraph& graph,
                                       const RotationMap& cam_from_world,
                                       const std::set<FrameId>& free_views) {
    double seconds = 0.0;
    RotationMap averaged;
    {
      const CpuWatch watch(seconds);
      averaged = averager(graph, cam_from_world, free_views);
    }
    times->push_back(1e3 * seconds);
    return averaged;
  };
  options.seed = seed;
  return {PaperGraph(options), times};
}

// The names of the rows of the ablation, which are also keys of Results.
const char* const kChained = "chaining";
const char* const kWindow = "window";
const char* const kLoops = "with loops";

struct Score {
  double rpe1_deg = 0.0;
  double rpen_deg = 0.0;
  double r_err = -1.0;  // below zero: the path is shorter than 100 m
};

struct Row {
  std::string name;
  Score score;
};

struct Results {
  std::string name;
  int num_frames = 0;
  std::map<std::string, Score> theirs;  // chained, window, loops
  std::map<std::string, Score> ours;
  std::vector<Row> ablation;
  int their_loops = 0;  // of the first seed
  int our_loops = 0;
  int their_unconnected = 0;
  int our_unconnected = 0;
  double their_ms = 0.0;  // CPU per frame
  double our_ms = 0.0;
  // Averaging alone, by frame: theirs and ours, of the window and of all.
  std::vector<double> their_window_ms;
  std::vector<double> their_global_ms;
  std::vector<double> our_window_ms;
  std::vector<double> our_global_ms;
};

Score ScoreOf(const RotationMap& cam_from_world,
              const std::vector<double>& timestamps_s,
              const TrajectoryFile& truth) {
  TrajectoryFile estimate;
  for (const auto& [frame, rotation] : cam_from_world) {
    estimate.poses.push_back(
        {timestamps_s[frame.value], rotation.Inverse(), Eigen::Vector3d::Zero()});
  }
  MatchOptions options;
  options.is_estimate_known = true;
  options.metrics.num_threads = 2;
  const MatchedTrajectories matched =
      MatchTrajectories({truth, "truth"}, {estimate, "estimate"}, options);
  const TrajectoryMetrics metrics = ComputeMetrics(matched.pairs, options.metrics);
  return {metrics.rpe1_deg, metrics.rpen_deg, metrics.r_err_deg_per_100m.value_or(-1.0)};
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

Score MedianScore(const std::vector<Score>& scores) {
  std::vector<double> rpe1_deg;
  std::vector<double> rpen_deg;
  std::vector<double> r_err;
  for (const Score& score : scores) {
    rpe1_deg.push_back(score.rpe1_deg);
    rpen_deg.push_back(score.rpen_deg);
    r_err.push_back(score.r_err);
  }
  return {MedianOf(rpe1_deg), MedianOf(rpen_deg), MedianOf(r_err)};
}

// ---- one sequence

// The paper's method with one seed, on the matches that all seeds share.
class Theirs {
 public:
  explicit Theirs(std::uint64_t seed, const std::shared_ptr<const Vocabulary>& vocabulary)
      : solver_(Shared(EigensolverPairs())),
        chained_(MakeVariant(AveragingMode::kOff, solver_, AverageEqually, seed)),
        window_(MakeVariant(AveragingMode::kWindow, solver_, AverageEqually, seed)),
        looped_(MakeVariant(AveragingMode::kWindow, solver_, AverageEqually, seed)),
        loops_(vocabulary, CandidateOptions(), PaperDefaults().matching) {}

  void AddFrame(const std::shared_ptr<const OrbView>& view,
                const std::vector<PairMatches>& matches) {
    window_.graph.AddFrame(view->frame, matches);
    chained_.graph.AddFrame(view->frame, matches);
    const PaperGraph::Step step = looped_.graph.AddFrame(view->frame, matches);
    num_unconnected_ += step.predicted_only;
    std::vector<FrameId> neighbours;
    for (const RelativeRotation& edge : step.edges) neighbours.push_back(edge.i);
    if (view->keypoints_px.empty()) return;
    std::vector<PairMatches> candidates;
    for (PaperLoop& loop : loops_.AddFrame(view, neighbours)) {
      candidates.push_back(std::move(loop.matches));
    }
    std::vector<RelativeRotation> accepted;
    for (const auto& edge : looped_.graph.VerifyLoops(candidates)) {
      if (!edge) continue;
      accepted.push_back(*edge);
      loops_.Join(edge->i, edge->j);
    }
    looped_.graph.CloseLoops(accepted);
    num_loops_ += static_cast<int>(accepted.size());
  }

  const PairSolver& solver() const { return solver_; }
  const Variant& chained() const { return chained_; }
  const Variant& window() const { return window_; }
  const Variant& looped() const { return looped_; }
  int num_loops() const { return num_loops_; }
  int num_unconnected() const { return num_unconnected_; }

 private:
  PairSolver solver_;
  Variant chained_;
  Variant window_;
  Variant looped_;
  PaperLoops loops_;
  int num_loops_ = 0;
  int num_unconnected_ = 0;
};

// Our front end: tracked points of the newest frames, and what our odometry makes of them.
class Ours {
 public:
  Ours(const Camera& camera, const std::shared_ptr<const Vocabulary>& vocabulary)
      : odometry_(camera, Options(vocabulary)) {}

  // Returns the frame's tracked points as matches with the four frames before it.
  std::vector<PairMatches> AddFrame(const Frame& frame) {
    FrameRecord record;
    const LoopedEstimate estimate =
        odometry_.AddFrame(frame.id, frame.timestamp_s, frame.image, &record);
    Count(estimate.loops);
    num_unconnected_ += estimate.report.predicted_only && frame.id.value > 0;
    connections_ = std::move(record.estimate.connections);
    for (const auto& [view, rotation] : record.estimate.window) window_[view] = rotation;
    // The edges are as averaged here; chaining takes the one to the frame before, or the best.
    const EdgeWithMatches* newest = nullptr;
    for (const EdgeWithMatches& connection : connections_) {
      if (newest == nullptr || connection.edge.i > newest->edge.i) newest = &connection;
    }
    if (newest == nullptr) {
      const FrameId before{frame.id.value - 1};
      chained_[frame.id] = chained_.contains(before) ? chained_.at(before) : Rotation();
    } else {
      chained_[frame.id] = newest->edge.j_from_i * chained_.at(newest->edge.i);
    }
    std::vector<PairMatches> matches;
    for (const Features& older : recent_) {
      matches.push_back(CommonPoints(older, record.estimate.features));
    }
    recent_.push_front(std::move(record.estimate.features));
    if (recent_.size() > 4) recent_.pop_back();
    return matches;
  }

  void Finish() { Count(odometry_.Finish()); }

  const std::vector<EdgeWithMatches>& connections() const { return connections_; }
  const RotationMap& chained() const { return chained_; }
  const RotationMap& window() const { return window_; }
  const RotationMap& looped() const { return odometry_.result().cam_from_world; }
  int num_loops() const { return num_loops_; }
  int num_unconnected() const { return num_unconnected_; }

 private:
  static LoopedOdometryOptions Options(const std::shared_ptr<const Vocabulary>& vocabulary) {
    LoopedOdometryOptions options;
    options.vocabulary = vocabulary;
    options.keep_features = true;  // records then have them
    options.num_threads = 1;
    return options;
  }
  void Count(const std::vector<LoopCheck>& checks) {
    for (const LoopCheck& check : checks) num_loops_ += check.accepted;
  }
  static PairMatches CommonPoints(const Features& i, const Features& j) {
    PairMatches matches{i.frame, j.frame, {}};
    for (int k = 0; k < j.size(); ++k) {
      const int in_i = FindTrack(i, j.tracks[k]);
      if (in_i >= 0) matches.pairs.push_back({i.bearings[in_i], j.bearings[k]});
    }
    return matches;
  }

  LoopedOdometry odometry_;
  std::deque<Features> recent_;  // newest first
  std::vector<EdgeWithMatches> connections_;
  RotationMap chained_;
  RotationMap window_;
  int num_loops_ = 0;
  int num_unconnected_ = 0;
};

// One part exchanged at a time, all windowed and without loops.
class Ablation {
 public:
  Ablation(double focal_px, const PairSolver& eigensolver, const Ours& ours) : ours_(ours) {
    const PairSolver ours_on_orb = Shared(OurPairs(focal_px));
    Add("ORB, our solver, equal weights", ours_on_orb, AverageEqually, false);
    Add("ORB, our solver, our weights", ours_on_orb, OurAverager(), false);
    Add("tracked points, their solver, equal weights",
        Shared(EigensolverPairs()),
        AverageEqually,
        true);
    // Called at every frame while `connections` are those of that frame.
    const PairSolver known =
        [this](const PairMatches& matches, const Rotation& start, std::uint64_t seed) {
          return KnownEdges(ours_.connections())(matches, start, seed);
        };
    Add("tracked points, our solver, equal weights", known, AverageEqually, true);
    Add("tracked points, our solver, our weights", known, OurAverager(), true);
    // The figure on runtime.
    their_global_ = std::make_unique<Variant>(
        MakeVariant(AveragingMode::kGlobal, eigensolver, AverageEqually, 1));
    our_global_ =
        std::make_unique<Variant>(MakeVariant(AveragingMode::kGlobal, known, OurAverager(), 1));
  }

  void AddFrame(FrameId frame,
                const std::vector<PairMatches>& orb,
                const std::vector<PairMatches>& tracked) {
    for (Part& part : parts_) {
      part.variant->graph.AddFrame(frame, part.is_tracked ? tracked : orb);
    }
    their_global_->graph.AddFrame(frame, orb);
    our_global_->graph.AddFrame(frame, tracked);
  }

  std::vector<Row> Rows(const std::vector<double>& timestamps_s,
                        const TrajectoryFile& truth) const {
    std::vector<Row> rows;
    for (const Part& part : parts_) {
      rows.push_back(
          {part.name, ScoreOf(part.variant->graph.cam_from_world(), timestamps_s, truth)});
    }
    return rows;
  }
  const std::vector<double>& our_window_ms() const { return *parts_.back().variant->averaging_ms; }
  const std::vector<double>& their_global_ms() const { return *their_global_->averaging_ms; }
  const std::vector<double>& our_global_ms() const { return *our_global_->averaging_ms; }

 private:
  struct Part {
    std::string name;
    bool is_tracked = false;
    std::unique_ptr<Variant> variant;
  };
  void Add(const std::string& name,
           const PairSolver& solver,
           const WindowAverager& averager,
           bool is_tracked) {
    parts_.push_back(
        {name,
         is_tracked,
         std::make_unique<Variant>(MakeVariant(AveragingMode::kWindow, solver, averager, 1))});
  }

  const Ours& ours_;
  std::vector<Part> parts_;
  std::unique_ptr<Variant> their_global_;
  std::unique_ptr<Variant> our_global_;
};

std::string NameOf(std::string path) {
  while (path.ends_with('/')) path.pop_back();
  return path.substr(path.find_last_of('/') + 1);
}

// A sequence with all that it is scored by.
struct OpenedInput {
  std::unique_ptr<Sequence> sequence;
  Camera camera;
  TrajectoryFile truth;
};

OpenedInput Open(const Arguments::Input& input, int last) {
  SequenceOptions options;
  options.last = last;
  OpenedInput opened;
  opened.sequence = OpenSequence(input.path, options);
  const auto& reference = opened.sequence->camera_reference();
  if (input.camera.empty() && !reference) {
    throw std::runtime_error(input.path + ": no calibration lies with the images; name --camera");
  }
  const auto& truth_file = opened.sequence->GroundTruthFile();
  if (!truth_file) throw std::runtime_error(input.path + ": no ground truth lies with the images");
  opened.camera = MatchToImages(
      ReadCamera(input.camera.empty() ? *reference : ParseCameraReference(input.camera)),
      opened.sequence->image_size());
  opened.truth = ReadTrajectoryFile(*truth_file, TimesBeside(*truth_file));
  return opened;
}

Results Measure(const Arguments::Input& input, const Arguments& arguments) {
  const auto [sequence, camera, truth] = Open(input, arguments.last);
  const auto vocabulary = std::make_shared<const Vocabulary>(DefaultVocabulary());
  const OdometryOptions paper = PaperDefaults();
  std::vector<std::unique_ptr<Theirs>> theirs;
  for (int seed = 1; seed <= arguments.num_seeds; ++seed) {
    theirs.push_back(std::make_unique<Theirs>(std::uint64_t(seed), vocabulary));
  }
  Ours ours(camera, vocabulary);
  Ablation ablation(camera.MeanFocal(), theirs.front()->solver(), ours);

  Results results;
  results.name = NameOf(input.path);
  double their_seconds = 0.0;
  double other_seeds_seconds = 0.0;
  double our_seconds = 0.0;
  std::deque<std::shared_ptr<const OrbView>> window;  // newest first
  std::vector<double> timestamps_s;
  while (std::optional<Frame> frame = sequence->Next()) {
    if (frame->image.empty()) throw std::runtime_error(input.path + ": " + frame->problem);
    timestamps_s.push_back(frame->timestamp_s);
    std::vector<PairMatches> orb;
    {
      const CpuWatch watch(their_seconds);
      const auto view = std::make_shared<const OrbView>(
          ToOrbView(ExtractSpreadOrb(frame->image, frame->id, camera, paper.features, 1)));
      for (const auto& older : window) {
        orb.push_back(ToPairMatches(*older, *view, MatchInWindow(*older, *view, paper.matching)));
      }
      window.push_front(view);
      if (static_cast<int>(window.size()) > paper.view_graph.window_frames) window.pop_back();
      theirs.front()->AddFrame(view, orb);
    }
    for (std::size_t k = 1; k < theirs.size(); ++k) {
      const CpuWatch watch(other_seeds_seconds);
      theirs[k]->AddFrame(window.front(), orb);
    }
    std::vector<PairMatches> tracked;
    {
      const CpuWatch watch(our_seconds);
      tracked = ours.AddFrame(*frame);
    }
    ablation.AddFrame(frame->id, orb, tracked);
    if (frame->id.value % 50 == 0) {
      std::fprintf(stderr, "\r%s: frame %d", results.name.c_str(), frame->id.value);
    }
  }
  ours.Finish();
  std::fprintf(stderr, "\n");

  const TrajectoryFile& true_path = truth;
  const auto score = [&](const RotationMap& rotations) {
    return ScoreOf(rotations, timestamps_s, true_path);
  };
  std::map<std::string, std::vector<Score>> scores;
  for (const auto& run : theirs) {
    scores[kChained].push_back(score(run->chained().graph.cam_from_world()));
    scores[kWindow].push_back(score(run->window().graph.cam_from_world()));
    scores[kLoops].push_back(score(run->looped().graph.cam_from_world()));
  }
  for (const auto& [name, of_seeds] : scores) results.theirs[name] = MedianScore(of_seeds);
  results.ours[kChained] = score(ours.chained());
  results.ours[kWindow] = score(ours.window());
  results.ours[kLoops] = score(ours.looped());
  results.ablation = ablation.Rows(timestamps_s, truth);
  results.num_frames = static_cast<int>(timestamps_s.size());
  results.their_loops = theirs.front()->num_loops();
  results.our_loops = ours.num_loops();
  results.their_unconnected = theirs.front()->num_unconnected();
  results.our_unconnected = ours.num_unconnected();
  results.their_ms = 1e3 * their_seconds / results.num_frames;
  results.our_ms = 1e3 * our_seconds / results.num_frames;
  results.their_window_ms = *theirs.front()->window().averaging_ms;
  results.their_global_ms = ablation.their_global_ms();
  results.our_window_ms = ablation.our_window_ms();
  results.our_global_ms = ablation.our_global_ms();
  return results;
}

// ---- printing

std::string Text(double value) {
  if (value < 0.0) return "-";
  char text[32];
  std::snprintf(text, sizeof text, value < 0.1 ? "%.4f" : value < 1.0 ? "%.3f" : "%.2f", value);
  return text;
}

void PrintTables(const std::vector<Results>& all) {
  std::printf("Table I: without loops, RPE_1 / RPE_n [deg]\n\n");
  std::printf(
      "| sequence | frames | theirs, chaining | theirs, window | ours, chaining | ours, window "
      "|\n");
  std::printf("|---|---|---|---|---|---|\n");
  const auto pair = [](const Score& score) {
    return Text(score.rpe1_deg) + " / " + Text(score.rpen_deg);
  };
  for (const Results& results : all) {
    std::printf("| %s | %d | %s | %s | %s | %s |\n",
                results.name.c_str(),
                results.num_frames,
                pair(results.theirs.at(kChained)).c_str(),
                pair(results.theirs.at(kWindow)).c_str(),
                pair(results.ours.at(kChained)).c_str(),
                pair(results.ours.at(kWindow)).c_str());
  }
  std::printf("\nTable II: with loops, r_err [deg/100 m] / RPE_1 / RPE_n [deg]\n\n");
  std::printf(
      "| sequence | theirs | ours | loops: theirs, ours | frames without an edge: theirs, ours "
      "|\n");
  std::printf("|---|---|---|---|---|\n");
  const auto triple = [&](const Score& score) { return Text(score.r_err) + " / " + pair(score); };
  for (const Results& results : all) {
    std::printf("| %s | %s | %s | %d, %d | %d, %d |\n",
                results.name.c_str(),
                triple(results.theirs.at(kLoops)).c_str(),
                triple(results.ours.at(kLoops)).c_str(),
                results.their_loops,
                results.our_loops,
                results.their_unconnected,
                results.our_unconnected);
  }
  std::printf("\nWhat each part is worth: windowed, RPE_1 / RPE_n [deg]\n\n| |");
  for (const Results& results : all) std::printf(" %s |", results.name.c_str());
  std::printf("\n|---|");
  for (std::size_t k = 0; k < all.size(); ++k) std::printf("---|");
  const auto row = [&](const std::string& name, const auto& score_of) {
    std::printf("\n| %s |", name.c_str());
    for (const Results& results : all) std::printf(" %s |", pair(score_of(results)).c_str());
  };
  row("theirs: ORB, eigensolver, equal weights",
      [](const Results& results) { return results.theirs.at(kWindow); });
  for (std::size_t k = 0; k < all.front().ablation.size(); ++k) {
    row(all.front().ablation[k].name,
        [k](const Results& results) { return results.ablation[k].score; });
  }
  row("ours: the same and edges to keyframes",
      [](const Results& results) { return results.ours.at(kWindow); });
  row("ours with loops", [](const Results& results) { return results.ours.at(kLoops); });
  std::printf("\n");
}

double MeanMs(const std::vector<double>& times, std::size_t from, std::size_t to) {
  double sum = 0.0;
  for (std::size_t k = from; k < to; ++k) sum += times[k];
  return to > from ? sum / static_cast<double>(to - from) : 0.0;
}

void PrintTimes(const std::vector<Results>& all) {
  std::printf(
      "\nTime, CPU: ms a frame of all, with loops; and of averaging alone, first and last "
      "tenth\n\n");
  std::printf(
      "| sequence | theirs | ours | their window | their global | our window | our global |\n");
  std::printf("|---|---|---|---|---|---|---|\n");
  for (const Results& results : all) {
    const auto growth = [](const std::vector<double>& times) {
      const std::size_t tenth = times.size() / 10;
      return Text(MeanMs(times, 0, tenth)) + ", " +
             Text(MeanMs(times, times.size() - tenth, times.size()));
    };
    std::printf("| %s | %.0f | %.0f | %s | %s | %s | %s |\n",
                results.name.c_str(),
                results.their_ms,
                results.our_ms,
                growth(results.their_window_ms).c_str(),
                growth(results.their_global_ms).c_str(),
                growth(results.our_window_ms).c_str(),
                growth(results.our_global_ms).c_str());
  }
}

// The figure's data: averaging alone, by frame.
void WriteRuntime(const std::string& path, const std::vector<Results>& all) {
  std::ofstream file(path);
  file << "sequence,frame,their_window_ms,their_global_ms,our_window_ms,our_global_ms\n";
  for (const Results& results : all) {
    const std::size_t count = std::min({results.their_window_ms.size(),
                                        results.their_global_ms.size(),
                                        results.our_window_ms.size(),
                                        results.our_global_ms.size()});
    for (std::size_t k = 0; k < count; ++k) {
      file << results.name << ',' << k + 1 << ',' << results.their_window_ms[k] << ','
           << results.their_global_ms[k] << ',' << results.our_window_ms[k] << ','
           << results.our_global_ms[k] << '\n';
    }
  }
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

int Main(int argc, char** argv) {
  const Arguments arguments = Parse(argc, argv);
  // What cannot be measured is told before the first hour has gone by.
  for (const Arguments::Input& input : arguments.inputs) Open(input, arguments.last);
  std::vector<Results> all;
  for (const Arguments::Input& input : arguments.inputs) all.push_back(Measure(input, arguments));
  PrintTables(all);
  PrintTimes(all);
  if (!arguments.runtime.empty()) WriteRuntime(arguments.runtime, all);
  return 0;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    return rotslam::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "paper_tables: %s\n", error.what());
    return 1;
  }
}
