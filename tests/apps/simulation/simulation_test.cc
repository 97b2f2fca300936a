#include "apps/simulation/simulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/simulation/write.h"
#include "rotodom/camera/read_camera.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr SimulationKind kKinds[] = {
    SimulationKind::kGimbal, SimulationKind::kHandheld, SimulationKind::kStreet};

// A folder of this test's own, removed at its end.
class Folder {
 public:
  Folder() {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    path_ = fs::path(testing::TempDir()) / (std::string("rotslam_") + info->name());
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  const fs::path& Path() const { return path_; }

 private:
  fs::path path_;
};

std::string ReadText(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::map<std::string, std::string> FilesBelow(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = ReadText(entry.path());
    }
  }
  return files;
}

SimulationOptions Small(SimulationKind kind) {
  SimulationOptions options;
  options.kind = kind;
  options.camera = CameraWithView(96, 72, 65.0);
  if (kind == SimulationKind::kGimbal) options.frames = 20;
  return options;
}

SimulationOptions WithoutSensor(SimulationOptions options) {
  options.render.noise_grey = 0.0;
  options.render.exposure_variation = 0.0;
  return options;
}

double Sample(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  const int x = static_cast<int>(std::floor(pixel.x()));
  const int y = static_cast<int>(std::floor(pixel.y()));
  const double a = pixel.x() - x;
  const double b = pixel.y() - y;
  const auto at = [&](int i, int j) { return static_cast<double>(image.at<std::uint8_t>(j, i)); };
  return (1 - b) * ((1 - a) * at(x, y) + a * at(x + 1, y)) +
         b * ((1 - a) * at(x, y + 1) + a * at(x + 1, y + 1));
}

// Two pictures and the pixels at which they show the same points of the world.
struct SamePoints {
  cv::Mat image_i;
  cv::Mat image_j;
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pixels;
};

SamePoints FindSamePoints(const Simulation& simulation, int i, int j) {
  const Camera& camera = simulation.GetCamera();
  const World& world = simulation.GetWorld();
  const StampedPose& pose_i = simulation.Truth()[i];
  const StampedPose& pose_j = simulation.Truth()[j];
  SamePoints same{simulation.Render(i), simulation.Render(j), {}};
  for (int y = 4; y < camera.height - 4; y += 3) {
    for (int x = 4; x < camera.width - 4; x += 3) {
      const Eigen::Vector3d ray = pose_i.world_from_cam * *camera.Unproject({x, y});
      const World::Hit hit = world.Cast(pose_i.center_in_world, ray);
      if (hit.surface < 0) continue;
      const Eigen::Vector3d point = pose_i.center_in_world + hit.distance * ray;
      const Eigen::Vector3d towards = point - pose_j.center_in_world;
      const auto pixel = camera.Project(pose_j.world_from_cam.Inverse() * towards);
      if (!pixel || pixel->x() < 4 || pixel->y() < 4 || pixel->x() > camera.width - 5 ||
          pixel->y() > camera.height - 5) {
        continue;
      }
      const World::Hit seen = world.Cast(pose_j.center_in_world, towards);
      if (seen.surface != hit.surface || std::abs(seen.distance - 1.0) > 1e-6) continue;
      same.pixels.emplace_back(Eigen::Vector2d(x, y), *pixel);
    }
  }
  return same;
}

// Median difference in grey, the pixels of image j being moved by `shift`.
double MedianDifference(const SamePoints& same, const Eigen::Vector2d& shift) {
  std::vector<double> differences;
  for (const auto& [pixel_i, pixel_j] : same.pixels) {
    differences.push_back(
        std::abs(Sample(same.image_i, pixel_i) - Sample(same.image_j, pixel_j + shift)));
  }
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return *middle;
}

TEST(Simulation, SamePointLooksTheSameFromTwoPlaces) {
  Camera radtan = CameraWithView(320, 240, 80.0);
  radtan.model = CameraModel::kRadtan;
  radtan.distortion = {-0.28, 0.07, 2e-4, -3e-4, 0.0};
  Camera fisheye = CameraWithView(320, 240, 90.0);
  fisheye.model = CameraModel::kEquidistant;
  fisheye.distortion = {0.02, -0.01, 0.003, -0.001, 0.0};
  Camera rational = CameraWithView(320, 240, 80.0);
  rational.model = CameraModel::kRational;
  rational.distortion = {3.1, 1.4, 5e-4, -7e-4, 0.06, 3.4, 2.2, 0.32};
  Camera fov = CameraWithView(320, 240, 90.0);
  fov.model = CameraModel::kFov;
  fov.distortion = {0.9};
  for (const SimulationKind kind : kKinds) {
    for (const Camera& camera : {CameraWithView(320, 240, 65.0), radtan, fisheye, rational, fov}) {
      SimulationOptions options;
      options.kind = kind;
      options.camera = camera;
      const Simulation simulation(WithoutSensor(options));
      const int j = kind == SimulationKind::kStreet ? 1 : 5;
      const SamePoints same = FindSamePoints(simulation, 0, j);
      ASSERT_GT(same.pixels.size(), 1000u);
      const double aligned = MedianDifference(same, {0.0, 0.0});
      // Half a pixel anywhere, as from a wrong pixel centre, shows at once.
      for (const Eigen::Vector2d& shift : {Eigen::Vector2d(0.5, 0.0),
                                           Eigen::Vector2d(-0.5, 0.0),
                                           Eigen::Vector2d(0.0, 0.5),
                                           Eigen::Vector2d(0.0, -0.5)}) {
        EXPECT_LT(aligned, 0.8 * MedianDifference(same, shift))
            << Name(kind) << ", " << Describe(camera) << ", shift " << shift.transpose();
      }
    }
  }
}

TEST(RenderFrame, PixelIsTheAverageOverItsSquare) {
  // The slow, obvious way: 4 x 4 rays a pixel, each with the texture of a quarter of its footprint.
  Light flat;
  flat.ambient = 1.0f;
  flat.diffuse = 0.0f;
  const World world(MakeRoom(3).Surfaces(), flat, {});
  // A narrow view, pixels as fine as those of a 640 x 480 camera.
  const Camera camera = CameraWithView(80, 60, 9.1);
  const Simulation room(Small(SimulationKind::kGimbal));
  RenderOptions options;
  options.noise_grey = 0.0;
  options.exposure_variation = 0.0;
  for (const int k : {0, 10}) {
    const StampedPose& pose = room.Truth()[k];
    const cv::Mat image = RenderFrame(
        {world, {}}, PixelRays(camera), [&](double) { return pose; }, {0.0, 0}, options);
    const auto mean_square = [&](double shift_x, double shift_y) {
      constexpr int kRays = 4;
      double sum = 0.0;
      for (int y = 0; y < camera.height; ++y) {
        for (int x = 0; x < camera.width; ++x) {
          double light = 0.0;
          for (int ray = 0; ray < kRays * kRays; ++ray) {
            const double a = x + shift_x + (ray % kRays + 0.5) / kRays - 0.5;
            const double b = y + shift_y + (ray / kRays + 0.5) / kRays - 0.5;
            const Eigen::Vector3d direction = pose.world_from_cam * *camera.Unproject({a, b});
            const World::Hit hit = world.Cast(pose.center_in_world, direction);
            const Eigen::Vector2d st = world.TextureCoordinates(
                hit.surface, pose.center_in_world + hit.distance * direction);
            light += Albedo(world.Surfaces()[hit.surface].material,
                            st.x(),
                            st.y(),
                            static_cast<float>(hit.distance / camera.fx / kRays));
          }
          const double gap = image.at<std::uint8_t>(y, x) - 255.0 * light / (kRays * kRays);
          sum += gap * gap;
        }
      }
      return sum / (camera.width * camera.height);
    };
    // Small, and least where the picture is: the vertex of a parabola through three shifts.
    const double h = 0.3;
    const double aligned = mean_square(0.0, 0.0);
    EXPECT_LT(std::sqrt(aligned),
              15.0);  // detail near a pixel's size fades sooner than it averages
    const double left = mean_square(-h, 0.0);
    const double right = mean_square(h, 0.0);
    const double above = mean_square(0.0, -h);
    const double below = mean_square(0.0, h);
    EXPECT_NEAR(0.5 * h * (left - right) / (left - 2.0 * aligned + right), 0.0, 0.04) << k;
    EXPECT_NEAR(0.5 * h * (above - below) / (above - 2.0 * aligned + below), 0.0, 0.04) << k;
  }
}

// Every row of a rolling shutter's picture is that row of a picture taken at its time.
class RolledPicture : public testing::TestWithParam<ReadoutStart> {};
INSTANTIATE_TEST_SUITE_P(ReadoutStarts,
                         RolledPicture,
                         testing::Values(ReadoutStart::kTop, ReadoutStart::kRight),
                         [](const auto& start) { return Name(start.param); });

TEST_P(RolledPicture, IsMadeOfPicturesAtTheTimesOfItsRows) {
  SimulationOptions options = WithoutSensor(Small(SimulationKind::kHandheld));
  const Simulation global(options);
  Camera rolling = global.GetCamera();
  rolling.readout_s = 0.025;
  rolling.readout_from = GetParam();
  const World world = MakeRoom(options.seed);
  const auto pose_at = [&](double time_s) { return global.PoseAt(time_s); };
  const auto picture = [&](const Camera& camera, double time_s) {
    return RenderFrame({world, {}}, PixelRays(camera), pose_at, {time_s, 0}, options.render);
  };
  const double time_s = global.Truth()[3].timestamp_s;
  const cv::Mat rolled = picture(rolling, time_s);
  const bool is_sideways = GetParam() == ReadoutStart::kRight;
  const auto line = [&](const cv::Mat& image, int index) {
    return is_sideways ? image.col(index) : image.row(index);
  };
  const int count = is_sideways ? rolled.cols : rolled.rows;
  for (const int index : {0, count / 3, count - 1}) {
    const double late_s = rolling.ExposureTime(Eigen::Vector2d::Constant(index));
    const cv::Mat then = line(picture(global.GetCamera(), time_s + late_s), index);
    const cv::Mat middle = line(picture(global.GetCamera(), time_s), index);
    // Pixels stretch a little from one row to the next.
    EXPECT_LT(cv::norm(line(rolled, index), then, cv::NORM_L1),
              0.2 * cv::norm(middle, then, cv::NORM_L1))
        << index;
  }
}

TEST(Simulation, OrbFindsThousandsOfCornersSpreadOverTheImage) {
  for (const SimulationKind kind : kKinds) {
    SimulationOptions options;
    options.kind = kind;
    const Simulation simulation(options);
    const int last = simulation.NumFrames() - 1;
    for (const int k : {0, last}) {
      const cv::Mat image = simulation.Render(k);
      ASSERT_EQ(image.cols, 640);
      ASSERT_EQ(image.rows, 480);
      std::vector<cv::KeyPoint> keypoints;
      cv::ORB::create(2000)->detect(image, keypoints);
      EXPECT_GE(keypoints.size(), 1500u) << Name(kind) << " frame " << k;
      // Over the image: FAST finds corners in most cells of a 8 x 6 grid (a street has its sky).
      std::vector<cv::KeyPoint> corners;
      cv::FAST(image, corners, 20);
      std::array<int, 48> cells = {};
      for (const cv::KeyPoint& corner : corners) {
        ++cells[static_cast<int>(corner.pt.x / 80.0f) + 8 * static_cast<int>(corner.pt.y / 80.0f)];
      }
      const auto covered =
          std::count_if(cells.begin(), cells.end(), [](int count) { return count >= 5; });
      EXPECT_GE(covered, kind == SimulationKind::kStreet ? 26 : 40) << Name(kind) << " frame " << k;
      RecordProperty(std::string(Name(kind)) + std::to_string(k),
                     static_cast<int>(keypoints.size()));
    }
  }
}

TEST(Simulation, SameBytesAtAnyNumberOfThreads) {
  for (const SimulationKind kind : kKinds) {
    SimulationOptions options = Small(kind);
    options.last = 2;
    options.distractors = 2;
    options.render.blur_subframes = 2;
    options.render.color = true;
    const SimulatedSequence one = RenderSequence(options, 1);
    const SimulatedSequence three = RenderSequence(options, 3);
    ASSERT_EQ(one.images.size(), 3u);
    ASSERT_EQ(three.images.size(), 3u);
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(one.images[k].type(), CV_8UC3);
      EXPECT_EQ(cv::norm(one.images[k], three.images[k], cv::NORM_INF), 0.0) << Name(kind) << k;
    }
    options.seed = 2;
    EXPECT_GT(cv::norm(one.images[0], RenderSequence(options, 1).images[0], cv::NORM_INF), 10.0);
  }
}

TEST(Simulation, PartOfASequenceIsTheSameAsInTheWhole) {
  for (const SimulationKind kind : kKinds) {
    SimulationOptions options = Small(kind);
    const Simulation whole(options);
    options.first = 7;
    options.last = 9;
    const Simulation part(options);
    ASSERT_EQ(part.NumFrames(), 3);
    EXPECT_EQ(part.Truth()[1].timestamp_s, whole.Truth()[8].timestamp_s);
    EXPECT_EQ(part.Truth()[1].center_in_world, whole.Truth()[8].center_in_world);
    EXPECT_EQ(cv::norm(part.Render(1), whole.Render(8), cv::NORM_INF), 0.0) << Name(kind);
  }
}

TEST(Simulation, NoiseHasTheSigmaAskedFor) {
  SimulationOptions options = WithoutSensor(Small(SimulationKind::kHandheld));
  const cv::Mat clean = Simulation(options).Render(0);
  options.render.noise_grey = 4.0;
  const cv::Mat noisy = Simulation(options).Render(0);
  double sum = 0.0;
  double squares = 0.0;
  int count = 0;
  for (int y = 0; y < clean.rows; ++y) {
    for (int x = 0; x < clean.cols; ++x) {
      if (clean.at<std::uint8_t>(y, x) < 20 || clean.at<std::uint8_t>(y, x) > 235) continue;
      const double difference = noisy.at<std::uint8_t>(y, x) - clean.at<std::uint8_t>(y, x);
      sum += difference;
      squares += difference * difference;
      ++count;
    }
  }
  EXPECT_GT(count, 3000);
  EXPECT_NEAR(sum / count, 0.0, 0.3);
  EXPECT_NEAR(std::sqrt(squares / count), 4.0, 0.25);
}

TEST(Simulation, BlurAndDistractorsChangeThePicture) {
  SimulationOptions options = WithoutSensor(Small(SimulationKind::kHandheld));
  const cv::Mat sharp = Simulation(options).Render(0);
  options.render.blur_subframes = 4;
  options.render.shutter_s = 0.1;
  EXPECT_GT(cv::norm(sharp, Simulation(options).Render(0), cv::NORM_L1) /
                static_cast<double>(sharp.total()),
            1.0);
  options.render.blur_subframes = 1;
  options.distractors = 8;
  const Simulation busy(options);
  double change = 0.0;  // some frame shows one of them
  options.distractors = 0;
  const Simulation still(options);
  for (int k = 0; k < 150; k += 30) {
    change = std::max(change, cv::norm(busy.Render(k), still.Render(k), cv::NORM_L1));
  }
  EXPECT_GT(change / static_cast<double>(sharp.total()), 1.0);
}

TEST(GimbalPath, TurnsInPlaceToANewView) {
  for (const double lever_arm_m : {0.0, 0.1}) {
    SimulationOptions options = Small(SimulationKind::kGimbal);
    options.frames = 0;
    options.lever_arm_m = lever_arm_m;
    const Simulation simulation(options);
    const Trajectory& truth = simulation.Truth();
    ASSERT_EQ(truth.size(), 120u);
    ASSERT_EQ(simulation.Segments().size(), 3u);
    const PathSegment turn = simulation.Segments()[1];
    EXPECT_EQ(turn.kind, MotionKind::kRotating);
    EXPECT_EQ(simulation.Segments()[0].last_frame + 1, turn.first_frame);
    EXPECT_EQ(simulation.Segments()[2].first_frame, turn.last_frame + 1);
    double farthest = 0.0;
    for (int k = turn.first_frame; k <= turn.last_frame; ++k) {
      farthest = std::max(
          farthest, (truth[k].center_in_world - truth[turn.first_frame].center_in_world).norm());
    }
    if (lever_arm_m == 0.0) {
      EXPECT_EQ(farthest, 0.0);
    } else {
      EXPECT_NEAR(farthest, 2.0 * lever_arm_m * std::sin(60.0 * kRadFromDeg), 0.02);
    }
    const Rotation turned =
        truth[turn.first_frame].world_from_cam.Inverse() * truth[turn.last_frame].world_from_cam;
    EXPECT_GT(turned.AngleDeg(), 115.0);
    EXPECT_LT(turned.AngleDeg(), 125.0);
    for (std::size_t k = 1; k < truth.size(); ++k) {
      const Rotation step = truth[k - 1].world_from_cam.Inverse() * truth[k].world_from_cam;
      EXPECT_LT(step.AngleDeg(), 5.0) << k;
    }
    // Both other segments get somewhere.
    EXPECT_GT((truth[35].center_in_world - truth[0].center_in_world).norm(), 0.8);
    EXPECT_GT((truth[119].center_in_world - truth[84].center_in_world).norm(), 0.8);
  }
}

TEST(Paths, AreSmooth) {
  const CameraPath paths[] = {GimbalPath({}), HandheldPath({}), StreetPath({})};
  for (const CameraPath& path : paths) {
    // Second differences over h are the acceleration; it may not jump (C2): between neighbours it
    // changes by no more than what a bounded third derivative allows.
    const double h = 1e-3;
    Eigen::Vector3d previous = Eigen::Vector3d::Zero();
    Eigen::Vector3d previous_turn = Eigen::Vector3d::Zero();
    for (double t = 0.1; t < path.num_frames / path.fps - 0.1; t += h) {
      const StampedPose a = path.at(t - h);
      const StampedPose b = path.at(t);
      const StampedPose c = path.at(t + h);
      const Eigen::Vector3d acceleration =
          (a.center_in_world - 2.0 * b.center_in_world + c.center_in_world) / (h * h);
      const Eigen::Vector3d turn = ((b.world_from_cam.Inverse() * c.world_from_cam).Log() -
                                    (a.world_from_cam.Inverse() * b.world_from_cam).Log()) /
                                   (h * h);
      if (t > 0.1 + 0.5 * h) {
        EXPECT_LT((acceleration - previous).norm(), 0.1) << t;
        EXPECT_LT((turn - previous_turn).norm(), 0.4) << t;
      }
      previous = acceleration;
      previous_turn = turn;
    }
  }
}

TEST(Paths, StayClearOfTheWorld) {
  for (const SimulationKind kind : kKinds) {
    const Simulation simulation(Small(kind));
    for (const StampedPose& pose : simulation.Truth()) {
      for (int k = 0; k < 16; ++k) {
        const double angle = k * 22.5 * kRadFromDeg;
        const Eigen::Vector3d ray(std::sin(angle), 0.0, std::cos(angle));
        const World::Hit hit = simulation.GetWorld().Cast(pose.center_in_world, ray);
        EXPECT_GT(hit.distance, kind == SimulationKind::kStreet ? 2.0 : 0.3)
            << Name(kind) << " at " << pose.center_in_world.transpose() << ", " << k;
      }
    }
  }
}

// Nothing stands within two metres of any pose, a metre above the road: the height of a parked car.
void ExpectFreeRoad(const World& world, const Trajectory& path) {
  for (const StampedPose& pose : path) {
    for (int k = 0; k < 32; ++k) {
      const double angle = k * 11.25 * kRadFromDeg;
      const Eigen::Vector3d ray(std::sin(angle), 0.0, std::cos(angle));
      const Eigen::Vector3d start = pose.center_in_world + Eigen::Vector3d(0.0, 0.65, 0.0);
      EXPECT_GT(world.Cast(start, ray).distance, 2.0) << start.transpose() << ", " << k;
    }
  }
}

TEST(MakeStreet, NeverBlocksTheRoad) {
  Trajectory path;  // an eight: the road crosses itself
  for (int k = 0; k < 300; ++k) {
    const double angle = 2.0 * 180.0 * kRadFromDeg * k / 300.0;
    StampedPose pose;
    pose.center_in_world = {
        45.0 * std::sin(2.0 * angle), 2.0 * std::sin(angle), 70.0 * std::sin(angle)};
    path.push_back(pose);
  }
  const World world = MakeStreet(path, {});
  EXPECT_GT(world.Surfaces().size(), 1000u);
  ExpectFreeRoad(world, path);
}

TEST(MakeStreet, NeverBlocksARoadDrivenBothWays) {
  // Out, round a bend, and back beside the way out, from 12 m off it to right upon it.
  constexpr double kLength = 150.0;
  constexpr double kRadius = 6.0;
  Trajectory path;
  const auto add = [&](double x, double z) {
    StampedPose pose;
    pose.center_in_world = {x, 0.0, z};
    path.push_back(pose);
  };
  for (double z = 0.0; z < kLength; z += 1.5) add(0.0, z);
  for (int k = 0; k < 13; ++k) {
    const double angle = k * 15.0 * kRadFromDeg;
    add(kRadius * (1.0 - std::cos(angle)), kLength + kRadius * std::sin(angle));
  }
  for (double z = kLength; z > 0.0; z -= 1.5) add(2.0 * kRadius * z / kLength, z);
  ExpectFreeRoad(MakeStreet(path, {}), path);
}

// Two laps of a circle, the second a metre farther out.
std::string PosesOfTwoLaps(int frames_a_lap) {
  std::ostringstream text;
  for (int k = 0; k < 2 * frames_a_lap; ++k) {
    const double angle = 360.0 * kRadFromDeg * k / frames_a_lap;
    const double radius = k < frames_a_lap ? 60.0 : 61.0;
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    text << c << " 0 " << s << ' ' << radius * (1.0 - c) << " 0 1 0 0 " << -s << " 0 " << c << ' '
         << radius * s << '\n';
  }
  return text.str();
}

// ORB matches that are clearly better than the next best.
std::size_t ClearMatches(const cv::Mat& image_i, const cv::Mat& image_j) {
  const auto orb = cv::ORB::create(1000);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors_i;
  cv::Mat descriptors_j;
  orb->detectAndCompute(image_i, cv::noArray(), keypoints, descriptors_i);
  orb->detectAndCompute(image_j, cv::noArray(), keypoints, descriptors_j);
  std::vector<std::vector<cv::DMatch>> matches;
  cv::BFMatcher(cv::NORM_HAMMING).knnMatch(descriptors_i, descriptors_j, matches, 2);
  return static_cast<std::size_t>(std::count_if(matches.begin(), matches.end(), [](const auto& m) {
    return m.size() == 2 && m[0].distance < 64.0f && m[0].distance < 0.8f * m[1].distance;
  }));
}

TEST(MakeStreet, LooksTheSameTheSecondTimeAndNowhereElse) {
  constexpr int kLap = 200;
  const Folder folder;
  const fs::path file = folder.Path() / "poses.txt";
  std::ofstream(file) << PosesOfTwoLaps(kLap);
  SimulationOptions options;
  options.kind = SimulationKind::kStreet;
  options.poses = file;
  options.camera = CameraWithView(512, 160, 82.0);
  const Simulation simulation(options);
  for (const int k : {20, 90}) {
    const cv::Mat first = simulation.Render(k);
    const std::size_t again = ClearMatches(first, simulation.Render(k + kLap));
    const std::size_t elsewhere = std::max(ClearMatches(first, simulation.Render(k + 40)),
                                           ClearMatches(first, simulation.Render(k + 80)));
    RecordProperty("again" + std::to_string(k), static_cast<int>(again));
    RecordProperty("elsewhere" + std::to_string(k), static_cast<int>(elsewhere));
    EXPECT_GT(again, 80u) << k;
    EXPECT_LT(elsewhere, 30u) << k;
  }
}

TEST(MakeStreet, LeavesRoomForTheCarOnRealLoops) {
  for (const char* name : {"00", "05", "07"}) {
    const fs::path file =
        fs::path(ROTSLAM_SHARED_DIR) / "data/kitti_trajectories" / (std::string(name) + ".txt");
    if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
    const Trajectory path = ReadKittiPoses(file);
    const World world = MakeStreet(path, {});
    ExpectFreeRoad(world, path);
    // Two passes may lie a metre apart in height; the ground between them must not swallow one.
    for (const StampedPose& pose : path) {
      const double height = world.Cast(pose.center_in_world, Eigen::Vector3d::UnitY()).distance;
      EXPECT_GT(height, 0.9) << name << " at " << pose.center_in_world.transpose();
      EXPECT_LT(height, 2.4) << name << " at " << pose.center_in_world.transpose();
    }
  }
}

TEST(World, TreeFindsWhatTryingAllSurfacesFinds) {
  const World world = MakeRoom(3);
  const int count = static_cast<int>(world.Surfaces().size());
  for (int k = 0; k < 500; ++k) {
    const auto number = [&](int which) {
      return 2.0 * UnitFrom(HashBits(5, k, which), 0, 32) - 1.0;
    };
    const Eigen::Vector3d origin(1.5 * number(0), -1.5 + 0.4 * number(1), 0.9 * number(2));
    const Eigen::Vector3d ray(number(3), number(4), number(5));
    double nearest = std::numeric_limits<double>::infinity();
    for (int s = 0; s < count; ++s) {
      const Surface& surface = world.Surfaces()[s];
      Eigen::Matrix3d A;
      A << surface.edge_u, surface.edge_v, -ray;
      const Eigen::Vector3d uvt = A.inverse() * (origin - surface.origin);
      const bool inside = uvt.x() >= 0.0 && uvt.x() <= 1.0 && uvt.y() >= 0.0 && uvt.y() <= 1.0;
      if (inside && uvt.z() > 1e-3) nearest = std::min(nearest, uvt.z());
    }
    const World::Hit hit = world.Cast(origin, ray);
    ASSERT_GE(hit.surface, 0);  // the room is closed
    EXPECT_NEAR(hit.distance, nearest, 1e-9 * nearest) << k;
    EXPECT_EQ(world.Cast(origin, ray, k % count).distance, hit.distance);
  }
}

TEST(ReadKittiPoses, DrivesThroughTheVeryPoses) {
  const Folder folder;
  const fs::path file = folder.Path() / "poses.txt";
  std::ofstream stream(file);
  Trajectory poses;
  for (int k = 0; k < 30; ++k) {
    const double yaw = 0.02 * k;
    const Eigen::Matrix3d R = Rotation::Exp({0.01 * std::sin(k), yaw, 0.0}).Matrix();
    const Eigen::Vector3d center(0.02 * k * k, 0.05 * std::sin(k), 0.9 * k);
    stream.precision(17);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) stream << R(row, column) << ' ';
      stream << center[row] << (row == 2 ? '\n' : ' ');
    }
    poses.push_back({0.0, Rotation::FromMatrix(R), center});
  }
  stream.close();
  SimulationOptions options = Small(SimulationKind::kStreet);
  options.poses = file.string();
  options.fps = 30.0;  // times that microseconds cannot say exactly
  const Simulation simulation(options);
  ASSERT_EQ(simulation.NumFrames(), 30);
  for (int k = 0; k < 30; ++k) {
    const StampedPose& pose = simulation.Truth()[k];
    EXPECT_LT((pose.center_in_world - poses[k].center_in_world).norm(), 1e-12);
    EXPECT_LT((pose.world_from_cam.Inverse() * poses[k].world_from_cam).Angle(), 1e-12);
  }
  options.speed_scale = 0.5;
  const Simulation slow(options);
  ASSERT_EQ(slow.NumFrames(), 59);
  EXPECT_LT((slow.Truth()[40].center_in_world - poses[20].center_in_world).norm(), 1e-12);
  // The road lies under the camera, at its height, all along.
  for (const StampedPose& pose : simulation.Truth()) {
    const World::Hit hit = simulation.GetWorld().Cast(pose.center_in_world, {0.0, 1.0, 0.0});
    EXPECT_NEAR(hit.distance, 1.65, 0.2);
  }
}

TEST(ReadKittiPoses, NamesFileAndLineOfWhatIsWrong) {
  const Folder folder;
  const fs::path file = folder.Path() / "poses.txt";
  const auto message = [&](const std::string& text) -> std::string {
    std::ofstream(file) << text;
    try {
      ReadKittiPoses(file.string());
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  EXPECT_THAT(message(good + "1 0 0 0 0 1 0 0 0 0 1\n"), testing::HasSubstr("poses.txt:2: "));
  EXPECT_THAT(message(good + good + "1 0 0 0 0 1 0 0 0 0 1 0 7\n"), testing::HasSubstr(":3: "));
  EXPECT_THAT(message("2 0 0 0 0 1 0 0 0 0 1 0\n"), testing::HasSubstr("not a rotation"));
  EXPECT_THAT(message("1 0 0 0 0 1 0 0 0 x 1 0\n"), testing::HasSubstr(":1: "));
  EXPECT_THAT(message(""), testing::HasSubstr("fewer than two poses"));
  EXPECT_THROW(ReadKittiPoses((folder.Path() / "missing.txt").string()), std::runtime_error);
}

TEST(WriteSequence, TumFilesHoldTheTruth) {
  const Folder folder;
  const Simulation simulation(Small(SimulationKind::kGimbal));
  WriteSequence(simulation, folder.Path(), {});
  EXPECT_EQ(ReadCamera(folder.Path() / "camera.yaml"), simulation.GetCamera());
  EXPECT_EQ(ReadText(folder.Path() / "groundtruth.txt"),
            ReadText(folder.Path() / "groundtruth_tum.txt"));
  EXPECT_EQ(ReadText(folder.Path() / "segments_truth.csv"),
            "first_frame,last_frame,kind\n0,5,translating\n6,13,rotating\n14,19,translating\n");
  std::istringstream lines(ReadText(folder.Path() / "groundtruth_tum.txt"));
  std::string line;
  int count = 0;
  while (std::getline(lines, line)) {
    if (line[0] == '#') continue;
    std::istringstream numbers(line);
    double t, x, y, z, qx, qy, qz, qw;
    ASSERT_TRUE(numbers >> t >> x >> y >> z >> qx >> qy >> qz >> qw) << line;
    const StampedPose& pose = simulation.Truth()[count];
    EXPECT_NEAR(t, pose.timestamp_s, 1e-9);
    EXPECT_LT((Eigen::Vector3d(x, y, z) - pose.center_in_world).norm(), 1e-11);
    const Rotation read(Eigen::Quaterniond(qw, qx, qy, qz));
    EXPECT_LT((read.Inverse() * pose.world_from_cam).Angle(), 1e-9);
    EXPECT_LT((simulation.PoseAt(t).world_from_cam.Inverse() * read).Angle(), 1e-9);
    ++count;
  }
  EXPECT_EQ(count, 20);
  const cv::Mat image = cv::imread((folder.Path() / "rgb/1000.166667.png").string(), -1);
  EXPECT_EQ(cv::norm(image, simulation.Render(5), cv::NORM_INF), 0.0);
  // Another sequence must not mingle with this one; the same may be written again.
  WriteSequence(simulation, folder.Path(), {});
  SimulationOptions other = Small(SimulationKind::kHandheld);
  other.frames = 3;
  EXPECT_THROW(WriteSequence(Simulation(other), folder.Path(), {}), std::runtime_error);
}

TEST(WriteSequence, EurocFilesAreTheSameAtAnyNumberOfThreads) {
  const Folder folder;
  SimulationOptions options = Small(SimulationKind::kHandheld);
  options.frames = 7;
  options.camera.model = CameraModel::kRadtan;
  options.camera.distortion = {-0.2, 0.05, 1e-4, 2e-4, 0.0};
  const Simulation simulation(options);
  WriteOptions write;
  write.layout = SequenceLayout::kEuroc;
  WriteSequence(simulation, folder.Path() / "a", write);
  write.num_threads = 3;
  WriteSequence(simulation, folder.Path() / "b", write);
  const auto a = FilesBelow(folder.Path() / "a");
  EXPECT_EQ(a, FilesBelow(folder.Path() / "b"));
  EXPECT_EQ(a.size(), 7u + 5u);
  EXPECT_TRUE(a.contains("mav0/cam0/data/1000033333000.png"));
  EXPECT_TRUE(a.contains("mav0/state_groundtruth_estimate0/data.csv"));
  EXPECT_EQ(ReadCamera(folder.Path() / "a/mav0/cam0/sensor.yaml"), simulation.GetCamera());
}

TEST(WriteSequence, RefusesALayoutThatCannotTellOfARollingShutter) {
  SimulationOptions options = Small(SimulationKind::kHandheld);
  options.camera.readout_s = 0.02;
  const Folder folder;
  WriteOptions write;
  write.layout = SequenceLayout::kEuroc;
  EXPECT_THROW(WriteSequence(Simulation(options), folder.Path(), write), std::invalid_argument);
}

TEST(WriteSequence, RefusesALayoutThatCannotTellOfTheLens) {
  SimulationOptions options = Small(SimulationKind::kHandheld);
  options.camera.model = CameraModel::kFov;
  options.camera.distortion = {0.9};
  const Folder folder;
  WriteOptions write;
  write.layout = SequenceLayout::kEuroc;
  EXPECT_THROW(WriteSequence(Simulation(options), folder.Path(), write), std::invalid_argument);
}

TEST(WriteSequence, SaysWhereItCannotWrite) {
  const Folder folder;
  std::ofstream(folder.Path() / "file") << "in the way";
  const Simulation simulation(Small(SimulationKind::kGimbal));
  try {
    WriteSequence(simulation, folder.Path() / "file", {});
    FAIL() << "wrote into a file";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr((folder.Path() / "file").string()));
  }
}

TEST(SimulationOptions, ProblemNamesTheField) {
  SimulationOptions options;
  EXPECT_EQ(options.Problem(), std::nullopt);
  options.speed_scale = 0.0;
  EXPECT_THAT(*options.Problem(), testing::HasSubstr("speed_scale"));
  EXPECT_THROW(Simulation{options}, std::invalid_argument);
  options = {};
  options.render.noise_grey = -1.0;
  EXPECT_THAT(*options.Problem(), testing::HasSubstr("noise_grey"));
  options = {};
  options.first = 500;
  EXPECT_THROW(Simulation{options}, std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
