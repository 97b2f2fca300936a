#include "rotodom/track_completion/track_completion.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace rotslam {
namespace {

constexpr int kNumViews = 9;
constexpr double kSpacing = 0.25;
constexpr double kWallDepth = 4.0;
constexpr double kReadout_s = 0.03;

Camera SmallPinhole(double readout_s, ReadoutStart readout_from) {
  Camera camera;
  camera.width = 321;  // odd, so that half an image has no last column
  camera.height = 240;
  camera.fx = camera.fy = 300.0;
  camera.cx = 160.0;
  camera.cy = 119.5;
  camera.readout_s = readout_s;
  camera.readout_from = readout_from;
  return camera;
}

// A wall across the view, with spots of all sizes.
class Wall {
 public:
  Wall() : texture_(kSide, kSide, CV_32F, cv::Scalar(0.0)) {
    std::mt19937 random(7);
    for (const double sigma : {1.5, 4.0}) {
      cv::Mat noise(kSide, kSide, CV_32F);
      for (int row = 0; row < kSide; ++row) {
        for (int column = 0; column < kSide; ++column) {
          noise.at<float>(row, column) = static_cast<float>(random() % 2001) - 1000.0F;
        }
      }
      cv::GaussianBlur(noise, noise, cv::Size(), sigma);
      texture_ += noise * (sigma * 0.22);
    }
  }

  double GreyAt(double x, double y) const {
    const double column = kPerMetre * x + kSide / 2;
    const double row = kPerMetre * y + kSide / 2;
    const int left = static_cast<int>(std::floor(column));
    const int top = static_cast<int>(std::floor(row));
    if (left < 0 || top < 0 || left + 1 >= kSide || top + 1 >= kSide) return 128.0;
    const double u = column - left;
    const double v = row - top;
    return 128.0 +
           (1.0 - v) *
               ((1.0 - u) * texture_.at<float>(top, left) + u * texture_.at<float>(top, left + 1)) +
           v * ((1.0 - u) * texture_.at<float>(top + 1, left) +
                u * texture_.at<float>(top + 1, left + 1));
  }

 private:
  static constexpr int kSide = 800;
  static constexpr double kPerMetre = 90.0;
  cv::Mat texture_;
};

const Wall& TheWall() {
  static const Wall wall;
  return wall;
}

// A walk along the wall, looking at it a little from the side.
struct Walk {
  explicit Walk(double readout_s = 0.0, ReadoutStart readout_from = ReadoutStart::kTop)
      : camera(SmallPinhole(readout_s, readout_from)) {
    for (int k = 0; k < kNumViews; ++k) {
      const FrameId frame{k};
      map.cam_from_world[frame] = Rotation::Exp({0.01 * k, 0.15 - 0.03 * k, 0.02 * k});
      map.center_in_world[frame] = {kSpacing * k - 1.0, 0.03 * k, 0.02 * k};
      MapView motion;
      if (readout_s > 0.0) {
        motion.motion.coefficients.col(0) << 0.2, -0.4, 0.3;
        motion.velocity = {0.8, 0.2, 0.1};
      }
      views[frame] = MakeMapView(ImageOf(frame, motion));
      views[frame].motion = motion.motion;
      views[frame].velocity = motion.velocity;
    }
    // Points that the middle view shows.
    for (int row = 30; row < camera.height - 30; row += 30) {
      for (int column = 30; column < camera.width - 30; column += 30) {
        const Rotation world_from_cam = map.cam_from_world.at(Middle()).Inverse();
        const Eigen::Vector3d ray =
            world_from_cam * *camera.Unproject(Eigen::Vector2d(column + 0.3, row + 0.4));
        const Eigen::Vector3d& center = map.center_in_world.at(Middle());
        Track track;
        track.id = TrackId{static_cast<int>(map.tracks.size())};
        map.point_in_world[track.id] = center + ray * ((kWallDepth - center.z()) / ray.z());
        map.tracks.push_back(track);
      }
    }
  }

  static FrameId Middle() { return FrameId{kNumViews / 2}; }

  cv::Mat ImageOf(FrameId frame, const MapView& motion) const {
    cv::Mat image(camera.height, camera.width, CV_8U);
    for (int row = 0; row < camera.height; ++row) {
      for (int column = 0; column < camera.width; ++column) {
        const Eigen::Vector2d px(column, row);
        const double late_s = camera.ExposureTime(px);
        const Rotation world_from_cam =
            (motion.motion.After(late_s) * map.cam_from_world.at(frame)).Inverse();
        const Eigen::Vector3d center = map.center_in_world.at(frame) + late_s * motion.velocity;
        const Eigen::Vector3d ray = world_from_cam * *camera.Unproject(px);
        const Eigen::Vector3d on_wall = center + ray * ((kWallDepth - center.z()) / ray.z());
        image.at<std::uint8_t>(row, column) =
            cv::saturate_cast<std::uint8_t>(TheWall().GreyAt(on_wall.x(), on_wall.y()));
      }
    }
    return image;
  }

  // The frame's image once more, blurred by a turn.
  void BlurBy(FrameId frame, const Eigen::Vector3d& turn) {
    constexpr int kSamples = 16;
    const Rotation halfway = map.cam_from_world.at(frame);
    cv::Mat sum(camera.height, camera.width, CV_32F, cv::Scalar(0.0));
    for (int k = 0; k < kSamples; ++k) {
      map.cam_from_world[frame] = Rotation::Exp(((k + 0.5) / kSamples - 0.5) * turn) * halfway;
      cv::accumulate(ImageOf(frame, {}), sum);
    }
    map.cam_from_world[frame] = halfway;
    sum.convertTo(sum, CV_8U, 1.0 / kSamples);
    views[frame] = MakeMapView(sum);
    views[frame].rotation_while_exposed = turn;
  }

  Eigen::Vector2d TruePx(FrameId frame, TrackId track) const {
    return *camera.Project(map.cam_from_world.at(frame) *
                           (map.point_in_world.at(track) - map.center_in_world.at(frame)));
  }

  bool Shows(FrameId frame, TrackId track, double border_px) const {
    const Eigen::Vector2d px = TruePx(frame, track);
    return px.x() > border_px && px.y() > border_px && px.x() < camera.width - 1 - border_px &&
           px.y() < camera.height - 1 - border_px;
  }

  // Sightings of every point in the frames first .. last, where these show it.
  void See(int first, int last) {
    for (Track& track : map.tracks) {
      for (int k = first; k <= last; ++k) {
        const FrameId frame{k};
        if (!Shows(frame, track.id, 0.0)) continue;
        const Eigen::Vector2d px = TruePx(frame, track.id);
        track.observations.push_back({frame, px, *camera.Unproject(px), 1.0});
      }
    }
  }

  std::vector<Track> Complete(int num_threads = 1) const {
    return CompleteTracks(map, views, camera, {}, num_threads);
  }

  Camera camera;
  Reconstruction map;
  MapViews views;
};

double Quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

std::vector<double> ErrorsPx(const Walk& walk, const std::vector<Track>& tracks) {
  std::vector<double> errors_px;
  for (const Track& track : tracks) {
    for (const Observation& seen : track.observations) {
      errors_px.push_back((seen.keypoint_px - walk.TruePx(seen.frame, track.id)).norm());
    }
  }
  return errors_px;
}

// How far a track's observations are from agreeing on one point: their errors less the track's
// mean.
std::vector<double> DisagreementsPx(const Walk& walk, const std::vector<Track>& tracks) {
  std::vector<double> disagreements_px;
  for (const Track& track : tracks) {
    std::vector<Eigen::Vector2d> errors;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Observation& seen : track.observations) {
      errors.push_back(seen.keypoint_px - walk.TruePx(seen.frame, track.id));
      mean += errors.back() / static_cast<double>(track.observations.size());
    }
    for (const Eigen::Vector2d& error : errors) disagreements_px.push_back((error - mean).norm());
  }
  return disagreements_px;
}

void ExpectFindsNearlyAll(const Walk& walk, double median_px) {
  const std::vector<Track> tracks = walk.Complete();
  ASSERT_EQ(tracks.size(), walk.map.tracks.size());
  int num_shown = 0;
  for (const Track& track : walk.map.tracks) {
    for (int k = 0; k < kNumViews; ++k) num_shown += walk.Shows(FrameId{k}, track.id, 12.0) ? 1 : 0;
  }
  EXPECT_GT(NumObservations(tracks), 0.9 * num_shown);
  EXPECT_GT(NumObservations(tracks), 2 * NumObservations(walk.map.tracks));
  const std::vector<double> errors_px = ErrorsPx(walk, tracks);
  EXPECT_LT(Quantile(errors_px, 0.5), median_px);
  EXPECT_LT(Quantile(errors_px, 0.95), 0.2);
  testing::Test::RecordProperty("median_px", std::to_string(Quantile(errors_px, 0.5)));
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    EXPECT_EQ(tracks[t].id, walk.map.tracks[t].id);
    for (std::size_t k = 0; k < tracks[t].observations.size(); ++k) {
      const Observation& seen = tracks[t].observations[k];
      EXPECT_TRUE(k == 0 || tracks[t].observations[k - 1].frame < seen.frame);
      EXPECT_LT((*walk.camera.Project(seen.bearing) - seen.keypoint_px).norm(), 1e-6);
    }
  }
}

TEST(CompleteTracks, FindsPointsInAllViewsThatShowThem) {
  Walk walk;
  walk.See(3, 5);
  ExpectFindsNearlyAll(walk, 0.05);
}

TEST(CompleteTracks, FindsThemWhereTheMapIsPixelsOff) {
  Walk walk;
  walk.See(3, 5);
  const Walk truth = walk;
  std::mt19937 random(3);
  for (auto& [frame, rotation] : walk.map.cam_from_world) {
    // Up to 3 px.
    const auto angle = [&] { return 0.01 * (static_cast<double>(random()) / 4294967296.0 - 0.5); };
    const Eigen::Vector3d turn(angle(), angle(), angle());
    if (frame.value < 3 || frame.value > 5) rotation = Rotation::Exp(turn) * rotation;
  }
  const std::vector<Track> tracks = walk.Complete();
  EXPECT_GT(NumObservations(tracks), 0.9 * NumObservations(truth.Complete()));
  EXPECT_LT(Quantile(ErrorsPx(truth, tracks), 0.5), 0.06);
}

class ThroughAShutter : public testing::TestWithParam<ReadoutStart> {};
INSTANTIATE_TEST_SUITE_P(CompleteTracks,
                         ThroughAShutter,
                         testing::Values(ReadoutStart::kTop, ReadoutStart::kRight),
                         [](const auto& start) { return Name(start.param); });

TEST_P(ThroughAShutter, FindsThem) {
  Walk walk(kReadout_s, GetParam());
  walk.See(3, 5);
  ExpectFindsNearlyAll(walk, 0.07);
  // Without the motion, rows at the border are out by pixels.
  for (auto& [frame, view] : walk.views) {
    view.motion = {};
    view.velocity.setZero();
  }
  EXPECT_GT(Quantile(ErrorsPx(walk, walk.Complete()), 0.5), 0.3);
}

// Every second view, by 6 to 9 px.
TEST(CompleteTracks, FindsSharpPatchesInBlurredViews) {
  Walk walk;
  walk.See(3, 5);
  for (const int k : {1, 3, 5, 7}) walk.BlurBy(FrameId{k}, {0.01, 0.02 + 0.001 * k, 0.0});
  std::vector<double> alike_px = ErrorsPx(walk, walk.Complete());
  for (auto& [frame, view] : walk.views) view.rotation_while_exposed.setZero();
  std::vector<double> blurred_px = ErrorsPx(walk, walk.Complete());
  RecordProperty("alike_px", std::to_string(Quantile(alike_px, 0.9)));
  RecordProperty("blurred_px", std::to_string(Quantile(blurred_px, 0.9)));
  EXPECT_GT(alike_px.size(), blurred_px.size());
  EXPECT_LT(Quantile(alike_px, 0.9), 0.1);
  EXPECT_LT(Quantile(alike_px, 0.9), 0.5 * Quantile(blurred_px, 0.9));
}

TEST(CompleteTracks, TakesBackWhatDriftHasMoved) {
  Walk walk;
  walk.See(0, kNumViews - 1);
  const int given = NumObservations(walk.map.tracks);
  for (Track& track : walk.map.tracks) {
    for (Observation& seen : track.observations) {
      seen.keypoint_px +=
          0.2 * (seen.frame.value - Walk::Middle().value) * Eigen::Vector2d(0.6, 0.8);
      seen.bearing = *walk.camera.Unproject(seen.keypoint_px);
    }
  }
  ASSERT_GT(Quantile(DisagreementsPx(walk, walk.map.tracks), 0.5), 0.3);
  const std::vector<Track> tracks = walk.Complete();
  EXPECT_EQ(NumObservations(tracks), given);
  EXPECT_LT(Quantile(DisagreementsPx(walk, tracks), 0.5), 0.05);
}

TEST(CompleteTracks, KeepsWhatIsFarFromWhereThePointWasFound) {
  Walk walk;
  walk.See(0, kNumViews - 1);
  Track& track = walk.map.tracks[walk.map.tracks.size() / 2];
  Observation& seen = track.observations.front();
  seen.keypoint_px += Eigen::Vector2d(5.0, 0.0);
  const std::vector<Track> tracks = walk.Complete();
  EXPECT_EQ(tracks[walk.map.tracks.size() / 2].observations.front().keypoint_px, seen.keypoint_px);
}

TEST(CompleteTracks, LeavesOutWhatIsHidden) {
  Walk walk;
  walk.See(3, 5);
  const FrameId hidden{6};
  // The wall elsewhere: structure as rich, another picture.
  const cv::Mat other = walk.views.at(FrameId{0}).image;
  cv::Mat turned;
  cv::rotate(other, turned, cv::ROTATE_180);
  walk.views[hidden] = MakeMapView(turned);
  std::ptrdiff_t num_found = 0;
  for (const Track& track : walk.Complete()) {
    num_found += std::count_if(track.observations.begin(),
                               track.observations.end(),
                               [&](const Observation& seen) { return seen.frame == hidden; });
  }
  EXPECT_LE(num_found, 1);
}

TEST(CompleteTracks, LeavesOutViewsFromAnotherSide) {
  Walk walk;
  walk.See(3, 5);
  // Half the depth: everything is twice as large there.
  const FrameId near{kNumViews};
  walk.map.cam_from_world[near] = Rotation();
  walk.map.center_in_world[near] = {0.0, 0.0, 0.5 * kWallDepth};
  walk.views[near] = MakeMapView(walk.ImageOf(near, {}));
  for (const Track& track : walk.Complete()) {
    for (const Observation& seen : track.observations) EXPECT_NE(seen.frame, near);
  }
}

TEST(CompleteTracks, PassesOverWhatItHasNoImageOrPoseOf) {
  Walk walk;
  walk.See(3, 5);
  const FrameId without_image{2};
  const FrameId without_pose{6};
  walk.views.erase(without_image);
  walk.map.cam_from_world.erase(without_pose);
  walk.map.point_in_world.erase(walk.map.tracks[0].id);
  const std::vector<Track> tracks = walk.Complete();
  EXPECT_EQ(tracks[0].observations.size(), walk.map.tracks[0].observations.size());
  for (const Track& track : tracks) {
    for (const Observation& seen : track.observations) {
      EXPECT_NE(seen.frame, without_image);
      EXPECT_NE(seen.frame, without_pose);
    }
  }
  EXPECT_EQ(NumObservations(CompleteTracks(walk.map, {}, walk.camera, {}, 1)),
            NumObservations(walk.map.tracks));
}

TEST(CompleteTracks, GivesTheSameOnAnyNumberOfThreads) {
  Walk walk;
  walk.See(3, 5);
  const std::vector<Track> one = walk.Complete(1);
  const std::vector<Track> three = walk.Complete(3);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t t = 0; t < one.size(); ++t) {
    ASSERT_EQ(one[t].observations.size(), three[t].observations.size());
    for (std::size_t k = 0; k < one[t].observations.size(); ++k) {
      EXPECT_EQ(one[t].observations[k].keypoint_px, three[t].observations[k].keypoint_px);
    }
  }
}

TEST(CompleteTracks, RefusesOptionsOutOfRange) {
  const Walk walk;
  const auto expect_refused = [&](const CompletionOptions& options, const std::string& name) {
    ASSERT_TRUE(options.Problem().has_value()) << name;
    EXPECT_EQ(options.Problem()->find(name), 0U) << *options.Problem();
    EXPECT_THROW(CompleteTracks(walk.map, walk.views, walk.camera, options, 1),
                 std::invalid_argument);
  };
  EXPECT_FALSE(CompletionOptions().Problem().has_value());
  expect_refused({.reach_px = 0.0}, "reach_px");
  expect_refused({.min_correlation = 1.0}, "min_correlation");
  expect_refused({.max_views = 0}, "max_views");
}

}  // namespace
}  // namespace rotslam
