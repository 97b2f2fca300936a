#include "apps/live_view/shown_samples.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "apps/page/camera_angles.h"
#include "apps/page/encoded_array.h"

namespace rotslam {
namespace {

template <class Vector>
void AppendTo(std::vector<float>& values, const Vector& vector) {
  values.insert(values.end(), vector.data(), vector.data() + vector.size());
}

}  // namespace

void ShownSamples::Add(const LiveEstimate& estimate) {
  if (estimate.frame.value <= NewestFrame()) return;
  if (samples_.empty()) first_time_s_ = estimate.timestamp_s;
  const Rotation world_from_cam = estimate.cam_from_world.Inverse();
  const Eigen::Vector3d angle_deg =
      RollPitchYawDeg(world_from_cam, last_angle_deg_ ? &*last_angle_deg_ : nullptr);
  last_angle_deg_ = angle_deg;
  Sample sample;
  sample.frame = estimate.frame.value;
  sample.time_s = static_cast<float>(estimate.timestamp_s - first_time_s_);
  sample.quaternion = world_from_cam.Quaternion().coeffs().cast<float>();
  sample.has_position = estimate.center_in_world.has_value();
  sample.position = estimate.center_in_world.value_or(Eigen::Vector3d::Zero()).cast<float>();
  sample.state = estimate.state;
  sample.angle_deg = angle_deg.cast<float>();
  sample.sigma_deg.setConstant(-1.0F);
  if (estimate.covariance) {
    const Eigen::Vector3d sigma_deg =
        kDegFromRad * estimate.covariance->diagonal().cwiseMax(0.0).cwiseSqrt();
    // Roll is about the camera's z axis, pitch about x, yaw about y.
    if (sigma_deg.allFinite()) {
      sample.sigma_deg = Eigen::Vector3d(sigma_deg.z(), sigma_deg.x(), sigma_deg.y()).cast<float>();
    }
  }
  samples_.push_back(sample);
  // Not at every frame: it goes through all of them.
  if (samples_.size() > kMaxOlder + 2 * kNumNewest) Thin();
}

void ShownSamples::Thin() {
  const int newest = NewestFrame();
  const auto thin = [&] {
    std::erase_if(samples_, [&](const Sample& sample) {
      return sample.frame <= newest - kNumNewest && sample.frame % stride_ != 0;
    });
  };
  thin();
  while (samples_.size() > kMaxOlder + kNumNewest) {
    stride_ *= 2;
    thin();
  }
}

nlohmann::ordered_json ShownSamples::After(int frame) const {
  std::vector<std::int32_t> frames;
  std::vector<float> time_s;
  std::vector<float> quaternion;
  std::vector<float> position;
  std::vector<float> angle_deg;
  std::vector<float> sigma_deg;
  std::vector<std::uint8_t> has_position;
  std::vector<std::uint8_t> state;
  const auto first =
      std::partition_point(samples_.begin(), samples_.end(), [&](const Sample& sample) {
        return sample.frame <= frame;
      });
  const auto count = static_cast<std::size_t>(std::distance(first, samples_.end()));
  frames.reserve(count);
  time_s.reserve(count);
  has_position.reserve(count);
  state.reserve(count);
  for (auto sample = first; sample != samples_.end(); ++sample) {
    frames.push_back(sample->frame);
    time_s.push_back(sample->time_s);
    AppendTo(quaternion, sample->quaternion);
    AppendTo(position, sample->position);
    AppendTo(angle_deg, sample->angle_deg);
    AppendTo(sigma_deg, sample->sigma_deg);
    has_position.push_back(sample->has_position ? 1 : 0);
    state.push_back(static_cast<std::uint8_t>(sample->state));
  }
  return {{"stride", stride_},
          {"frame", EncodedArray(frames, 1)},
          {"time_s", EncodedArray(time_s, 1)},
          {"quaternion", EncodedArray(quaternion, 4)},
          {"position", EncodedArray(position, 3)},
          {"has_position", EncodedArray(has_position, 1)},
          {"state", EncodedArray(state, 1)},
          {"angle_deg", EncodedArray(angle_deg, 3)},
          {"sigma_deg", EncodedArray(sigma_deg, 3)}};
}

}  // namespace rotslam
