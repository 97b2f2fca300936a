// The odometry with loops, on a camera that turns away from where it began and comes back another
// way, in a world that is infinitely far away.

#include "rotodom/loop/looped_odometry.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "rotodom/loop/frame_record.h"
#include "tests/rotodom/features/textured_world.h"

namespace rotslam {
namespace {

constexpr double kFps = 30.0;
constexpr double kStepDeg = 3.0;

// Right and down across the wall, straight up, and back to the left: three sides of a triangle.
std::vector<Rotation> ThereAndBack() {
  const std::vector<Eigen::Vector2d> corners_deg = {{-24, -20}, {24, 20}, {24, -20}, {-24, -20}};
  std::vector<Rotation> cam_from_world;
  for (std::size_t k = 0; k + 1 < corners_deg.size(); ++k) {
    const Eigen::Vector2d way_deg = corners_deg[k + 1] - corners_deg[k];
    const int num_steps = static_cast<int>(std::round(way_deg.norm() / kStepDeg));
    for (int step = 0; step < num_steps; ++step) {
      const Eigen::Vector2d at_deg = corners_deg[k] + way_deg * step / num_steps;
      cam_from_world.push_back(Rotation::Exp({at_deg.y() * kRadFromDeg, 0.0, 0.0}) *
                               Rotation::Exp({0.0, -at_deg.x() * kRadFromDeg, 0.0}));
    }
  }
  cam_from_world.push_back(cam_from_world.front());
  return cam_from_world;
}

std::vector<cv::Mat> Film(const std::vector<Rotation>& cam_from_world, std::uint64_t world_seed) {
  const TexturedWorld world(world_seed);
  std::vector<cv::Mat> images;
  images.reserve(cam_from_world.size());
  for (const Rotation& orientation : cam_from_world) {
    images.push_back(world.View(SmallCamera(), orientation));
  }
  return images;
}

const std::vector<cv::Mat>& Images() {
  static const std::vector<cv::Mat> images = Film(ThereAndBack(), 1);
  return images;
}

OdometryOptions FewFeatures() {
  OdometryOptions options;
  options.features.max_features = 500;
  return options;
}

LoopOptions WithoutLoops() {
  LoopOptions options;
  options.use_loops = false;
  return options;
}

struct LoopedRun {
  OdometryResult result;
  std::vector<LoopedEstimate> estimates;
  std::vector<LoopCheck> accepted;
  int num_places = 0;
};

LoopedRun Follow(const std::vector<cv::Mat>& images,
                 const OdometryOptions& odometry_options = FewFeatures(),
                 const LoopOptions& loop_options = {},
                 int num_threads = 1) {
  LoopedOdometry odometry(SmallCamera(),
                          {odometry_options, loop_options, nullptr, true, 1, num_threads});
  LoopedRun run;
  const auto keep_accepted = [&](const std::vector<LoopCheck>& checks) {
    for (const LoopCheck& check : checks) {
      if (check.accepted) run.accepted.push_back(check);
    }
  };
  for (int k = 0; k < static_cast<int>(images.size()); ++k) {
    run.estimates.push_back(odometry.AddFrame(FrameId{k}, k / kFps, images[k]));
    keep_accepted(run.estimates.back().loops);
  }
  keep_accepted(odometry.Finish());
  run.num_places = odometry.num_places();
  run.result = odometry.TakeResult();
  return run;
}

const LoopedRun& WholeRun() {
  static const LoopedRun run = Follow(Images());
  return run;
}

RotationMap PlainOdometry(const std::vector<cv::Mat>& images,
                          const OdometryOptions& options = FewFeatures()) {
  RotationalOdometry odometry(SmallCamera(), options, 1, 1);
  OdometryResult result;
  for (int k = 0; k < static_cast<int>(images.size()); ++k) {
    result.Add(odometry.AddFrame(FrameId{k}, k / kFps, images[k]), false);
  }
  return result.cam_from_world;
}

void ExpectSameBytes(const RotationMap& a, const RotationMap& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [frame, rotation] : a) {
    EXPECT_EQ(rotation.Quaternion().coeffs(), b.at(frame).Quaternion().coeffs()) << frame.value;
  }
}

TEST(LoopedOdometry, FindsTheStartAgainAndNothingElse) {
  const LoopedRun& run = WholeRun();
  ASSERT_FALSE(run.accepted.empty());
  const std::vector<Rotation> truth = ThereAndBack();
  for (const LoopCheck& check : run.accepted) {
    EXPECT_GT(check.frame.value - check.match.value, 20);
    const Rotation turn = truth[check.frame.value] * truth[check.match.value].Inverse();
    EXPECT_LT(turn.AngleDeg(), 40.0);  // of 65 deg that the camera sees
    EXPECT_GT(check.score, 0.0);
    EXPECT_LE(check.score, 1.0);
    EXPECT_GE(check.num_edges, 1);
    const RelativeRotation* edge = run.result.graph.FindEdge(check.match, check.frame);
    ASSERT_NE(edge, nullptr);
    EXPECT_EQ(edge->num_inliers, check.num_inliers);
    EXPECT_LT((edge->j_from_i * turn.Inverse()).AngleDeg(), 0.2);
  }
}

// No edge says quite the same of blurred corners: none is taken, but the points are the same.
TEST(LoopedOdometry, JoinsTracksWhereItDoesNotKnowTheTurn) {
  LoopOptions options;
  options.verification.max_cycle_deg = 1e-9;
  options.verification.max_cycle_sigmas = 1e3;
  const LoopedRun run = Follow(Images(), FewFeatures(), options);
  const LoopedRun without = Follow(Images(), FewFeatures(), WithoutLoops());
  EXPECT_FALSE(run.accepted.empty());
  for (const LoopCheck& check : run.accepted) EXPECT_EQ(check.num_edges, 0);
  EXPECT_EQ(run.result.graph.edges().size(), without.result.graph.edges().size());
  std::size_t num_matches = 0;
  for (const EdgeMatches& matches : run.result.edge_matches) num_matches += matches.pairs.size();
  for (const EdgeMatches& matches : without.result.edge_matches) {
    num_matches -= matches.pairs.size();
  }
  EXPECT_GT(num_matches, 100U);
  EXPECT_LT(num_matches, 5000U);
}

TEST(LoopedOdometry, LeavesWhatIsRight) {
  const std::vector<Rotation> truth = ThereAndBack();
  for (const auto& [frame, rotation] : WholeRun().result.cam_from_world) {
    const Rotation turn = truth[frame.value] * truth.front().Inverse();
    EXPECT_LT((rotation * turn.Inverse()).AngleDeg(), 0.1) << frame.value;
  }
}

constexpr int kFramesBefore = 17;

// Across the wall, a cut to another wall, and back on the first one, somewhere else than before the
// cut.
struct Cut {
  std::vector<cv::Mat> images;
  std::vector<Rotation> cam_from_world;
  int first_back = 0;  // on the first wall
};

const Cut& TwoWalls() {
  static const Cut cut = [] {
    const auto turn = [](double from_deg, double step_deg, int count) {
      std::vector<Rotation> turned;
      for (int k = 0; k < count; ++k) {
        turned.push_back(Rotation::Exp({0.0, -(from_deg + k * step_deg) * kRadFromDeg, 0.0}));
      }
      return turned;
    };
    Cut made;
    const auto append = [&](const std::vector<Rotation>& orientations, std::uint64_t wall) {
      const std::vector<cv::Mat> images = Film(orientations, wall);
      made.images.insert(made.images.end(), images.begin(), images.end());
      made.cam_from_world.insert(
          made.cam_from_world.end(), orientations.begin(), orientations.end());
    };
    append(turn(-24.0, kStepDeg, kFramesBefore), 1);
    // Fewer than the window holds: it reaches across.
    append(turn(0.0, kStepDeg, 5), 2);
    made.first_back = static_cast<int>(made.images.size());
    append(turn(12.0, -kStepDeg, 13), 1);
    return made;
  }();
  return cut;
}

double ErrorDeg(const RotationMap& cam_from_world, int frame) {
  const std::vector<Rotation>& truth = TwoWalls().cam_from_world;
  const Rotation turn = truth[frame] * truth.front().Inverse();
  return (cam_from_world.at(FrameId{frame}) * turn.Inverse()).AngleDeg();
}

TEST(LoopedOdometry, JoinsPiecesOfTheViewGraph) {
  const LoopedRun run = Follow(TwoWalls().images);
  const int last = static_cast<int>(TwoWalls().images.size()) - 1;
  ASSERT_GT(ErrorDeg(PlainOdometry(TwoWalls().images), last), 5.0);
  for (int frame = TwoWalls().first_back; frame <= last; ++frame) {
    EXPECT_LT(ErrorDeg(run.result.cam_from_world, frame), 0.2) << frame;
  }
  for (int frame = 0; frame < kFramesBefore; ++frame) {
    EXPECT_LT(ErrorDeg(run.result.cam_from_world, frame), 0.2) << frame;
  }
  // No way is known between the walls.
  for (const LoopCheck& check : run.accepted) {
    EXPECT_GE(check.frame.value, TwoWalls().first_back);
    EXPECT_LT(check.match.value, kFramesBefore);
  }
}

TEST(LoopedOdometry, SaysAtOnceWhatTheLastAveragingLeft) {
  const LoopedRun run = Follow(TwoWalls().images);
  EXPECT_TRUE(std::any_of(run.estimates.begin(), run.estimates.end(), [](const auto& estimate) {
    return estimate.has_averaged;
  }));
  const int last = static_cast<int>(TwoWalls().images.size()) - 1;
  EXPECT_LT(ErrorDeg({{FrameId{last}, run.estimates.back().cam_from_world}}, last), 0.2);
}

TEST(LoopedOdometry, MatchesOfLoopsNameFeatures) {
  const OdometryResult& result = WholeRun().result;
  int num_loop_matches = 0;
  for (const EdgeMatches& edge : result.edge_matches) {
    for (const auto& [i, j] : edge.pairs) {
      ASSERT_LT(i, result.features.at(edge.frame_i).size());
      ASSERT_LT(j, result.features.at(edge.frame_j).size());
    }
    if (edge.frame_j.value - edge.frame_i.value > 40) {
      num_loop_matches += static_cast<int>(edge.pairs.size());
    }
  }
  EXPECT_GT(num_loop_matches, 40);
}

TEST(LoopedOdometry, IsTheOdometryWhereNothingComesBack) {
  constexpr int kWayThere = 18;
  const std::vector<cv::Mat> images(Images().begin(), Images().begin() + kWayThere);
  const LoopedRun run = Follow(images);
  EXPECT_TRUE(run.accepted.empty());
  EXPECT_GT(run.num_places, 1);
  ExpectSameBytes(run.result.cam_from_world, PlainOdometry(images));
}

TEST(LoopedOdometry, GivesAwayThePlacesThatItRemembers) {
  LoopedOdometry odometry(SmallCamera(), {FewFeatures()});
  for (int k = 0; k < 10; ++k) odometry.AddFrame(FrameId{k}, k / kFps, Images()[k]);
  odometry.Finish();
  const int num_places = odometry.num_places();
  const std::map<FrameId, Features> places = odometry.TakePlaces();
  EXPECT_GT(num_places, 1);
  EXPECT_EQ(static_cast<int>(places.size()), num_places);
  for (const auto& [frame, corners] : places) {
    EXPECT_EQ(corners.frame, frame);
    EXPECT_GT(corners.size(), 100);
    EXPECT_EQ(corners.descriptors.rows, corners.size());
  }
  EXPECT_TRUE(odometry.TakePlaces().empty());
}

TEST(LoopedOdometry, IsTheOdometryWithoutLoops) {
  const LoopedRun run = Follow(Images(), FewFeatures(), WithoutLoops());
  EXPECT_EQ(run.num_places, 0);
  ExpectSameBytes(run.result.cam_from_world, PlainOdometry(Images()));
}

TEST(LoopedOdometry, ChainsWhereNothingIsAveraged) {
  OdometryOptions options = FewFeatures();
  options.averaging.mode = AveragingMode::kOff;
  const LoopedRun run = Follow(Images(), options);
  EXPECT_EQ(run.num_places, 0);
  ExpectSameBytes(run.result.cam_from_world, PlainOdometry(Images(), options));
}

TEST(LoopedOdometry, GivesTheSameBytesOnTwoThreads) {
  const LoopedRun run = Follow(Images(), FewFeatures(), {}, 2);
  ExpectSameBytes(run.result.cam_from_world, WholeRun().result.cam_from_world);
  ASSERT_EQ(run.accepted.size(), WholeRun().accepted.size());
  for (std::size_t k = 0; k < run.accepted.size(); ++k) {
    EXPECT_EQ(run.accepted[k].frame, WholeRun().accepted[k].frame);
    EXPECT_EQ(run.accepted[k].match, WholeRun().accepted[k].match);
    EXPECT_EQ(run.accepted[k].angle_deg, WholeRun().accepted[k].angle_deg);
  }
}

// All that a run knows, as bytes.
std::string BytesOf(OdometryResult result) {
  ArchiveWriter archive;
  archive(result.graph, result.cam_from_world, result.edge_matches, result.features);
  archive(result.covariance);
  return archive.TakeBytes();
}

template <class Value>
std::string ToBytes(Value value) {
  ArchiveWriter archive;
  archive(value);
  return archive.TakeBytes();
}

template <class Value>
Value FromBytes(const std::string& bytes) {
  Value value;
  ArchiveReader archive(bytes);
  archive(value);
  archive.ExpectEnd();
  return value;
}

struct UpdatesKeyframes {
  const char* name;
  double readout_s;
  bool keep_features;
  int num_threads;  // of the one that goes on
};
std::ostream& operator<<(std::ostream& stream, const UpdatesKeyframes& remembering) {
  return stream << remembering.name;
}

class GoingOn : public testing::TestWithParam<UpdatesKeyframes> {
 protected:
  static LoopedOdometry Make(int num_threads) {
    Camera camera = SmallCamera();
    camera.readout_s = GetParam().readout_s;
    LoopOptions loops;
    loops.min_correction_deg = 0.0;  // every loop is averaged
    loops.handover_frames = 3;
    return LoopedOdometry(
        camera, {FewFeatures(), loops, nullptr, GetParam().keep_features, 1, num_threads});
  }
};
INSTANTIATE_TEST_SUITE_P(LoopedOdometry,
                         GoingOn,
                         testing::Values(UpdatesKeyframes{"Tracks", 0.0, true, 1},
                                         UpdatesKeyframes{"TwoThreads", 0.0, true, 2},
                                         UpdatesKeyframes{"NoTracks", 0.0, false, 1},
                                         UpdatesKeyframes{"RollingShutter", 0.002, true, 1}),
                         testing::PrintToStringParamName());

TEST_P(GoingOn, IsTheSameToTheLastBit) {
  const int count = static_cast<int>(Images().size());
  // The image of one of the first frames could not be read.
  const auto image = [](int frame) { return frame == 7 ? cv::Mat() : Images()[frame]; };
  LoopedOdometry whole = Make(1);
  std::vector<std::string> records;
  std::vector<std::string> states;
  std::vector<LoopedEstimate> estimates;
  int num_loops = 0;
  for (int k = 0; k < count; ++k) {
    FrameRecord record;
    estimates.push_back(whole.AddFrame(FrameId{k}, k / kFps, image(k), &record));
    num_loops += static_cast<int>(record.loops.connections.size());
    records.push_back(ToBytes(std::move(record)));
    states.push_back(whole.SaveState());
  }
  whole.Finish();
  EXPECT_GT(num_loops, 0);
  EXPECT_TRUE(std::any_of(estimates.begin(), estimates.end(), [](const LoopedEstimate& estimate) {
    return estimate.has_averaged;
  }));
  // While an averaging runs, too, which is the case in the last ones.
  for (const int stop : {1, 8, count - 3, count - 1, count}) {
    SCOPED_TRACE(stop);
    LoopedOdometry resumed = Make(GetParam().num_threads);
    for (int k = 0; k < count; ++k) {
      const LoopedEstimate estimate = k < stop ? resumed.Replay(FromBytes<FrameRecord>(records[k]))
                                               : resumed.AddFrame(FrameId{k}, k / kFps, image(k));
      EXPECT_EQ(ToBytes(estimate.cam_from_world), ToBytes(estimates[k].cam_from_world)) << k;
      EXPECT_EQ(ToBytes(estimate.covariance), ToBytes(estimates[k].covariance)) << k;
      EXPECT_EQ(ToBytes(estimate.loops), ToBytes(estimates[k].loops)) << k;
      if (k + 1 == stop) resumed.RestoreState(states[k]);
    }
    resumed.Finish();
    EXPECT_EQ(resumed.num_places(), whole.num_places());
    EXPECT_TRUE(BytesOf(resumed.result()) == BytesOf(whole.result()));
  }
}

TEST(LoopedOdometry, ANewOneStandsWhereNothingHasBeenSeen) {
  LoopedOdometry odometry(SmallCamera(), {FewFeatures()});
  const std::string state = odometry.SaveState();
  odometry.RestoreState(state);
  EXPECT_EQ(odometry.SaveState(), state);
}

TEST(LoopedOdometry, NoticesAStateThatIsCutShort) {
  LoopedOdometry odometry(SmallCamera(), {FewFeatures()});
  for (int k = 0; k < 6; ++k) odometry.AddFrame(FrameId{k}, k / kFps, Images()[k]);
  const std::string state = odometry.SaveState();
  odometry.RestoreState(state);
  const std::string again = odometry.SaveState();
  EXPECT_TRUE(again == state);
  for (std::size_t size = 0; size < state.size(); size += 997) {
    EXPECT_THROW(odometry.RestoreState(state.substr(0, size)), std::runtime_error) << size;
  }
  EXPECT_THROW(odometry.RestoreState(state + "x"), std::runtime_error);
}

TEST(LoopedOdometry, KnowsEveryFramesCovariance) {
  EXPECT_EQ(WholeRun().result.covariance.size(), Images().size());
}

TEST(LoopedOdometry, RefusesOptionsOutOfRange) {
  const auto message = [](const LoopOptions& options) -> std::string {
    try {
      const LoopedOdometry odometry(SmallCamera(), {{}, options, nullptr, false});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  LoopOptions options;
  options.verification.min_inliers = 0;
  EXPECT_EQ(message(options), "loop: verification.min_inliers is 0, must be at least 1");
  options = {};
  options.candidates.group_size = -1;
  EXPECT_EQ(message(options), "loop: candidates.group_size is -1, must be zero or more");
  options = {};
  options.handover_frames = -1;
  EXPECT_EQ(message(options), "loop: handover_frames is -1, must be zero or more");
}

}  // namespace
}  // namespace rotslam
