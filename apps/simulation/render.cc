#include "apps/simulation/render.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include <Eigen/Geometry>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxAnisotropy = 4;
constexpr double kSkyRadius = 3.0;  // texture metres per radian of the sky

// The still world and, before it, what moves at this instant.
class Scene {
 public:
  Scene(const World& world, const std::vector<MovingBox>& moving, double time_s) : world_(world) {
    if (moving.empty()) return;
    std::vector<Surface> surfaces;
    for (const MovingBox& box : moving) AddBox(surfaces, box.At(time_s));
    moving_ = std::make_unique<World>(std::move(surfaces), world.Lighting(), world.Sky());
  }

  struct Hit {
    const World* world = nullptr;  // nullptr: the sky
    int surface = -1;
    double distance = 0.0;
    bool SameSheet(const Hit& other) const {
      return world == other.world &&
             (world == nullptr || world->Sheet(surface) == other.world->Sheet(other.surface));
    }
  };

  Hit Cast(const Vector3d& origin, const Vector3d& direction, const Hit& guess) const {
    World::Hit hit = world_.Cast(origin, direction, guess.world == &world_ ? guess.surface : -1);
    const World* owner = &world_;
    if (moving_) {
      const World::Hit front = moving_->Cast(origin, direction);
      if (front.distance < hit.distance) {
        hit = front;
        owner = moving_.get();
      }
    }
    if (hit.surface < 0) return {};
    return {owner, hit.surface, hit.distance};
  }

  const World& Still() const { return world_; }

 private:
  const World& world_;
  std::unique_ptr<World> moving_;
};

Vector2d SkyCoordinates(const Vector3d& direction) {
  const double level = std::hypot(direction.x(), direction.z());
  return kSkyRadius *
         Vector2d(std::atan2(direction.x(), direction.z()), std::atan2(-direction.y(), level));
}

double Illumination(const World& world, int surface, const Vector3d& point) {
  const Light& light = world.Lighting();
  const Vector3d& normal = world.Normal(surface);
  if (!light.lamp) {
    // Parallel light: both sides of a direction differ a little, so that no two walls look the
    // same.
    const double cosine = normal.dot(light.place) / light.place.norm();
    return light.ambient + light.diffuse * (0.8 * std::abs(cosine) + 0.2 * normal.x() * normal.x());
  }
  const Vector3d to_lamp = light.place - point;
  const double squared = to_lamp.squaredNorm();
  const double cosine = std::abs(normal.dot(to_lamp)) / std::sqrt(squared + 1e-6);
  return light.ambient + light.diffuse * cosine / (1.0 + 0.25 * squared);
}

using Colour = Eigen::Array3f;  // b g r; grey pictures use the first number

// Light from a place of a surface, averaged over `width` metres.
Colour Radiance(
    const Material& material, const Vector2d& st, double width, double light, bool color) {
  const float value =
      Albedo(material, st.x(), st.y(), static_cast<float>(width)) * static_cast<float>(light);
  if (!color) return Colour::Constant(value);
  return value * Tint(material, st.x(), st.y()).array();
}

class ViewRenderer {
 public:
  // @param poses  one per step of rays.ExposureTimes().
  ViewRenderer(const Scene& scene,
               const PixelRays& rays,
               const std::vector<StampedPose>& poses,
               const RenderOptions& options)
      : scene_(scene), rays_(rays), options_(options) {
    standpoints_.reserve(poses.size());
    for (const StampedPose& pose : poses) {
      standpoints_.push_back({pose.world_from_cam.Matrix(), pose.center_in_world});
    }
  }

  // Adds weight * light to `sum`, row by row.
  void AddTo(std::vector<Colour>& sum, float weight) const {
    const int width = rays_.Width();
    std::vector<Corner> above(static_cast<std::size_t>(width) + 1);
    std::vector<Corner> below(above.size());
    CastRow(0, below);
    for (int y = 0; y < rays_.Height(); ++y) {
      std::swap(above, below);
      CastRow(y + 1, below);
      for (int x = 0; x < width; ++x) {
        if (rays_.Center(x, y).isZero(0.0)) continue;  // stays black
        const Standpoint& from = standpoints_[rays_.ExposureOfCenter(x, y)];
        const Ray ray{from.center, from.R_w_c * rays_.Center(x, y)};
        const Corner* corners[4] = {&above[x], &above[x + 1], &below[x], &below[x + 1]};
        sum[static_cast<std::size_t>(y) * width + x] += weight * PixelLight(ray, corners);
      }
    }
  }

 private:
  struct Standpoint {
    Eigen::Matrix3d R_w_c;
    Vector3d center;
  };

  // In the world.
  struct Ray {
    Vector3d origin;
    Vector3d direction;

    Vector3d At(double distance) const { return origin + distance * direction; }
  };

  struct Corner {
    Vector3d direction = Vector3d::Zero();
    Scene::Hit hit;
    Vector2d st = Vector2d::Zero();
  };

  static Vector2d TextureAt(const Scene::Hit& hit, const Ray& ray, double distance) {
    if (hit.world == nullptr) return SkyCoordinates(ray.direction);
    return hit.world->TextureCoordinates(hit.surface, ray.At(distance));
  }

  void CastRow(int y, std::vector<Corner>& row) const {
    Scene::Hit guess;
    for (int x = 0; x <= rays_.Width(); ++x) {
      Corner& corner = row[x];
      const Vector3d& in_cam = rays_.Corner(x, y);
      if (in_cam.isZero(0.0)) {
        corner = {};
        continue;
      }
      const Standpoint& from = standpoints_[rays_.ExposureOfCorner(x, y)];
      const Ray ray{from.center, from.R_w_c * in_cam};
      corner.direction = ray.direction;
      corner.hit = scene_.Cast(ray.origin, ray.direction, guess);
      corner.st = TextureAt(corner.hit, ray, corner.hit.distance);
      guess = corner.hit;
    }
  }

  Colour PixelLight(const Ray& ray, const Corner* const corners[4]) const {
    bool one_sheet = true;
    for (int k = 0; k < 4; ++k) {
      one_sheet = one_sheet && !corners[k]->direction.isZero(0.0) &&
                  corners[k]->hit.SameSheet(corners[0]->hit);
    }
    return one_sheet ? SheetLight(ray, corners) : EdgeLight(ray, corners);
  }

  // All of the pixel shows one sheet: average its texture over the pixel's footprint.
  Colour SheetLight(const Ray& ray, const Corner* const corners[4]) const {
    const Scene::Hit& hit = corners[0]->hit;
    const bool sky = hit.world == nullptr;
    const double distance =
        sky ? 0.0 : hit.world->DistanceToPlane(hit.surface, ray.origin, ray.direction);
    const Vector2d st = TextureAt(hit, ray, distance);
    const Vector2d dx =
        0.5 * ((corners[1]->st - corners[0]->st) + (corners[3]->st - corners[2]->st));
    const Vector2d dy =
        0.5 * ((corners[2]->st - corners[0]->st) + (corners[3]->st - corners[1]->st));
    const Material& material =
        sky ? scene_.Still().Sky() : hit.world->Surfaces()[hit.surface].material;
    const double light = sky ? 1.0 : Illumination(*hit.world, hit.surface, ray.At(distance));
    // Axes of the footprint: eigenvectors of dx dx' + dy dy'.
    const double a = dx.x() * dx.x() + dy.x() * dy.x();
    const double b = dx.x() * dx.y() + dy.x() * dy.y();
    const double c = dx.y() * dx.y() + dy.y() * dy.y();
    const double mean = 0.5 * (a + c);
    const double spread = std::sqrt(0.25 * (a - c) * (a - c) + b * b);
    const double major = std::sqrt(mean + spread);
    const double minor = std::sqrt(std::max(mean - spread, 0.0));
    const double width = std::max(minor, major / kMaxAnisotropy);
    const int count = width > 0.0 ? static_cast<int>(std::ceil(major / width - 0.4)) : 1;
    if (count <= 1) return Radiance(material, st, 0.5 * (major + width), light, options_.color);
    Vector2d axis = std::abs(b) > 1e-12 * mean ? Vector2d(mean + spread - c, b)
                                               : (a > c ? Vector2d(1.0, 0.0) : Vector2d(0.0, 1.0));
    axis *= major / axis.norm();
    Colour sum = Colour::Zero();
    for (int k = 0; k < count; ++k) {
      const Vector2d place = st + axis * ((k + 0.5) / count - 0.5);
      sum += Radiance(material, place, width, light, options_.color);
    }
    return sum / static_cast<float>(count);
  }

  // Surfaces meet within the pixel: cast rays of its own through a grid of places.
  Colour EdgeLight(const Ray& middle, const Corner* const corners[4]) const {
    Vector3d directions[4];
    for (int k = 0; k < 4; ++k) {
      directions[k] = corners[k]->direction.isZero(0.0) ? middle.direction : corners[k]->direction;
    }
    const int n = options_.edge_samples;
    const double pixel_angle = (directions[3] - directions[0]).norm() / std::numbers::sqrt2;
    Colour sum = Colour::Zero();
    Scene::Hit guess = corners[0]->hit;
    for (int j = 0; j < n; ++j) {
      const double y = (j + 0.5) / n;
      for (int i = 0; i < n; ++i) {
        const double x = (i + 0.5) / n;
        const Ray ray{middle.origin,
                      (1.0 - y) * ((1.0 - x) * directions[0] + x * directions[1]) +
                          y * ((1.0 - x) * directions[2] + x * directions[3])};
        guess = scene_.Cast(ray.origin, ray.direction, guess);
        const Vector2d st = TextureAt(guess, ray, guess.distance);
        if (guess.world == nullptr) {
          sum += Radiance(scene_.Still().Sky(), st, kSkyRadius * pixel_angle, 1.0, options_.color);
          continue;
        }
        const double light = Illumination(*guess.world, guess.surface, ray.At(guess.distance));
        sum += Radiance(guess.world->Surfaces()[guess.surface].material,
                        st,
                        0.7 * pixel_angle * guess.distance,
                        light,
                        options_.color);
      }
    }
    return sum / static_cast<float>(n * n);
  }

  const Scene& scene_;
  const PixelRays& rays_;
  const RenderOptions& options_;
  std::vector<Standpoint> standpoints_;
};

// Gain of the exposure at a time: slow waves whose phases the seed turns, within 1 +- variation.
double Gain(const RenderOptions& options, double time_s) {
  const auto wave = [&](int which, double hertz) {
    const double phase = UnitFrom(HashBits(options.seed, which, 41), 0, 24);
    return std::sin(2.0 * std::numbers::pi * (hertz * time_s + phase));
  };
  return 1.0 + options.exposure_variation * (0.6 * wave(1, 0.17) + 0.4 * wave(2, 0.41));
}

// Standard normal to the eye of any estimator here: the sum of four uniforms, which ends at 3.5
// sigma.
float Normal(std::uint64_t hash) {
  const auto sum = static_cast<float>((hash & 0xFFFFu) + ((hash >> 16) & 0xFFFFu) +
                                      ((hash >> 32) & 0xFFFFu) + (hash >> 48));
  return (sum / 65536.0f - 2.0f) * 1.7320508f;
}

}  // namespace

std::optional<std::string> RenderOptions::Problem() const {
  if (!(noise_grey >= 0.0 && noise_grey <= 100.0)) {
    return OutOfRange("noise_grey", noise_grey, "in [0, 100]");
  }
  if (!(exposure_variation >= 0.0 && exposure_variation < 1.0)) {
    return OutOfRange("exposure_variation", exposure_variation, "in [0, 1)");
  }
  if (blur_subframes < 1) return OutOfRange("blur_subframes", blur_subframes, "at least 1");
  if (!(shutter_s >= 0.0 && shutter_s < 10.0))
    return OutOfRange("shutter_s", shutter_s, "in [0, 10)");
  if (edge_samples < 1 || edge_samples > 16) {
    return OutOfRange("edge_samples", edge_samples, "in [1, 16]");
  }
  return std::nullopt;
}

PixelRays::PixelRays(const Camera& camera) : width_(camera.width), height_(camera.height) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  if (width_ <= 0 || height_ <= 0) throw std::invalid_argument("camera: width or height is 0");
  const auto ray = [&](double x, double y) {
    return camera.Unproject({x, y}).value_or(Vector3d::Zero());
  };
  centers_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) centers_.push_back(ray(x, y));
  }
  corners_.reserve(static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1));
  for (int y = 0; y <= height_; ++y) {
    for (int x = 0; x <= width_; ++x) corners_.push_back(ray(x - 0.5, y - 0.5));
  }
  if (camera.readout_s == 0.0) return;
  is_sideways_ =
      camera.readout_from == ReadoutStart::kLeft || camera.readout_from == ReadoutStart::kRight;
  exposure_s_.clear();
  const int num_steps = 2 * (is_sideways_ ? width_ : height_) + 1;
  for (int step = 0; step < num_steps; ++step) {
    exposure_s_.push_back(camera.ExposureTime(Vector2d::Constant(0.5 * (step - 1))));
  }
}

cv::Mat RenderFrame(const Scenery& scenery,
                    const PixelRays& rays,
                    const std::function<StampedPose(double)>& pose_at,
                    const FrameInstant& instant,
                    const RenderOptions& options) {
  if (const auto problem = options.Problem()) throw std::invalid_argument("render: " + *problem);
  const int width = rays.Width();
  const int height = rays.Height();
  std::vector<Colour> sum(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                          Colour::Zero());
  const int count = options.blur_subframes;
  for (int k = 0; k < count; ++k) {
    const double instant_s = instant.time_s + options.shutter_s * ((k + 0.5) / count - 0.5);
    const Scene scene(scenery.world, scenery.moving, instant_s);
    std::vector<StampedPose> poses;
    for (const double late_s : rays.ExposureTimes()) poses.push_back(pose_at(instant_s + late_s));
    ViewRenderer(scene, rays, poses, options).AddTo(sum, 1.0f / static_cast<float>(count));
  }
  const auto gain = static_cast<float>(255.0 * Gain(options, instant.time_s));
  const auto noise = static_cast<float>(options.noise_grey);
  const int channels = options.color ? 3 : 1;
  const std::uint64_t key = HashBits(options.seed, instant.frame, 43);
  cv::Mat image(height, width, CV_8UC(channels));
  for (int y = 0; y < height; ++y) {
    std::uint8_t* row = image.ptr<std::uint8_t>(y);
    for (int x = 0; x < width; ++x) {
      const Colour& light = sum[static_cast<std::size_t>(y) * width + x];
      for (int c = 0; c < channels; ++c) {
        const int place = channels * x + c;
        const float grey = gain * light[c] + noise * Normal(HashBits(key, place, y));
        row[place] = static_cast<std::uint8_t>(std::clamp(grey + 0.5f, 0.0f, 255.0f));
      }
    }
  }
  return image;
}

}  // namespace rotslam
