#include "rotodom/sensor_orientations/orientation_pairing.h"

#include <algorithm>
#include <cmath>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Orientations up to this many frame intervals apart are interpolated at the frames.
constexpr double kFrameIntervals = 1.2;
// Frames farther apart than this are not interpolated between, in frame intervals.
constexpr double kLongestStep = 2.5;

// A sensor's orientations within this of a frame are averaged, s. Hands turn evenly for that long.
constexpr double kLongestHalfWindowS = 1.0 / 60.0;

double MedianInterval(const std::vector<double>& timestamps_s) {
  std::vector<double> intervals;
  intervals.reserve(timestamps_s.size());
  for (std::size_t k = 1; k < timestamps_s.size(); ++k) {
    intervals.push_back(timestamps_s[k] - timestamps_s[k - 1]);
  }
  return Median(std::move(intervals));
}

OrientationSeries SeriesOf(const ImageOrientations& images, double frame_interval_s) {
  std::vector<bool> is_connected;
  is_connected.reserve(images.step_variance.size());
  for (std::size_t k = 0; k < images.step_variance.size(); ++k) {
    const double step_s = images.timestamps_s[k + 1] - images.timestamps_s[k];
    is_connected.push_back(std::isfinite(images.step_variance[k]) &&
                           step_s <= kLongestStep * frame_interval_s);
  }
  return {images.timestamps_s, images.cam_from_world, is_connected};
}

OrientationSeries SeriesOf(const std::vector<StampedRotation>& given, double max_gap_s) {
  std::vector<double> timestamps_s;
  std::vector<Rotation> sensor_from_world;
  std::vector<bool> is_connected;
  timestamps_s.reserve(given.size());
  sensor_from_world.reserve(given.size());
  is_connected.reserve(given.size());
  for (const StampedRotation& orientation : given) {
    if (!timestamps_s.empty()) {
      is_connected.push_back(orientation.timestamp_s - timestamps_s.back() <= max_gap_s);
    }
    timestamps_s.push_back(orientation.timestamp_s);
    sensor_from_world.push_back(orientation.world_from_cam.Inverse());
  }
  return {timestamps_s, sensor_from_world, is_connected};
}

std::vector<bool> LonelyOrientations(const std::vector<StampedRotation>& given, double max_gap_s) {
  std::vector<bool> is_alone;
  is_alone.reserve(given.size());
  const auto is_far = [&](std::size_t a, std::size_t b) {
    return b >= given.size() || given[b].timestamp_s - given[a].timestamp_s > max_gap_s;
  };
  for (std::size_t k = 0; k < given.size(); ++k) {
    is_alone.push_back((k == 0 || is_far(k - 1, k)) && is_far(k, k + 1));
  }
  return is_alone;
}

}  // namespace

OrientationPairing::OrientationPairing(const ImageOrientations& images,
                                       const std::vector<StampedRotation>& given,
                                       double max_gap_s)
    : frame_interval_s_(MedianInterval(images.timestamps_s)),
      half_window_s_(std::min(0.5 * frame_interval_s_, kLongestHalfWindowS)),
      is_alone_(
          LonelyOrientations(given, std::min(max_gap_s, kFrameIntervals * frame_interval_s_))),
      images_(SeriesOf(images, frame_interval_s_)),
      dense_(SeriesOf(given, std::min(max_gap_s, kFrameIntervals * frame_interval_s_))),
      sparse_(SeriesOf(given, max_gap_s)) {}

int OrientationPairing::NearestFrame(double timestamp_s) const {
  const std::vector<double>& times = images_.timestamps_s();
  const auto after = std::lower_bound(times.begin(), times.end(), timestamp_s);
  if (after == times.begin()) return 0;
  if (after == times.end()) return static_cast<int>(times.size()) - 1;
  const auto k = static_cast<int>(after - times.begin());
  return timestamp_s - times[k - 1] < times[k] - timestamp_s ? k - 1 : k;
}

std::vector<OrientationPair> OrientationPairing::At(double offset_s) const {
  const std::vector<double>& frame_times = images_.timestamps_s();
  std::vector<OrientationPair> pairs;
  pairs.reserve(frame_times.size());
  std::vector<bool> is_paired(frame_times.size(), false);
  for (std::size_t g = 0; g < is_alone_.size(); ++g) {
    if (!is_alone_[g]) continue;
    const double time_s = sparse_.timestamps_s()[g] - offset_s;
    const auto cam_from_world = images_.At(time_s);
    if (!cam_from_world) continue;
    const int frame = NearestFrame(time_s);
    if (is_paired[frame]) continue;
    is_paired[frame] = true;
    pairs.push_back({frame, time_s, *cam_from_world, sparse_[g]});
  }
  for (std::size_t k = 0; k < frame_times.size(); ++k) {
    if (is_paired[k]) continue;
    if (const auto sensor_from_world =
            dense_.AverageAt(frame_times[k] + offset_s, half_window_s_)) {
      pairs.push_back({static_cast<int>(k), frame_times[k], images_[k], *sensor_from_world});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const OrientationPair& a, const OrientationPair& b) {
    return a.frame < b.frame;
  });
  return pairs;
}

}  // namespace rotslam
