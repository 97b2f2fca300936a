#include "apps/simulation/write.h"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <fstream>
#include <set>
#include <stdexcept>
#include <system_error>

#include <opencv2/imgcodecs.hpp>

#include "rotodom/camera/read_camera.h"
#include "rotodom/types/parallel.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

[[gnu::format(printf, 1, 2)]] std::string Format(const char* format, ...) {
  char buffer[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer, sizeof(buffer), format, arguments);
  va_end(arguments);
  return buffer;
}

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw std::runtime_error("cannot make the folder " + folder.string() + ": " + error.message() +
                             "; choose another --out");
  }
}

// Writes beside, then renames: a reader never sees half a file.
void WriteFile(const fs::path& file, const char* data, std::size_t size) {
  const fs::path beside = file.string() + ".tmp";
  {
    std::ofstream stream(beside, std::ios::binary);
    stream.write(data, static_cast<std::streamsize>(size));
    stream.close();
    if (!stream) {
      std::error_code ignored;
      fs::remove(beside, ignored);
      throw std::runtime_error("cannot write " + file.string() +
                               ": no permission or no space; choose another --out");
    }
  }
  std::error_code error;
  fs::rename(beside, file, error);
  if (error) throw std::runtime_error("cannot write " + file.string() + ": " + error.message());
}

void WriteFile(const fs::path& file, const std::string& text) {
  WriteFile(file, text.data(), text.size());
}

void WriteImage(const fs::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  // Noise does not compress; the quickest level costs a few percent of size.
  if (!cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1})) {
    throw std::runtime_error("cannot encode " + file.string());
  }
  WriteFile(file, reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

std::string TumLine(const StampedPose& pose) {
  const Eigen::Vector3d& c = pose.center_in_world;
  const Eigen::Vector4d& q = pose.world_from_cam.Quaternion().coeffs();
  return Format("%.6f %.12f %.12f %.12f %.15f %.15f %.15f %.15f\n",
                pose.timestamp_s,
                c.x(),
                c.y(),
                c.z(),
                q[0],
                q[1],
                q[2],
                q[3]);
}

std::string TumTrajectory(const Trajectory& truth) {
  std::string text =
      "# exact ground truth, camera->world, x right, y down, z forward\n"
      "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : truth) text += TumLine(pose);
  return text;
}

long long Nanoseconds(double timestamp_s) { return 1000 * std::llround(1e6 * timestamp_s); }

std::string EurocSensor(const Camera& camera, double fps) {
  const bool fisheye = camera.model == CameraModel::kEquidistant;
  const auto& k = camera.distortion;
  std::string text =
      "sensor_type: camera\n"
      "comment: simulated; camera and body are one\n"
      "T_BS:\n"
      "  cols: 4\n"
      "  rows: 4\n"
      "  data: [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";
  text += Format("rate_hz: %.9g\n", fps);
  text += Format("resolution: [%d, %d]\n", camera.width, camera.height);
  text += "camera_model: pinhole\n";
  text += Format(
      "intrinsics: [%.17g, %.17g, %.17g, %.17g]\n", camera.fx, camera.fy, camera.cx, camera.cy);
  text += Format("distortion_model: %s\n", fisheye ? "equidistant" : "radial-tangential");
  text += Format("distortion_coefficients: [%.17g, %.17g, %.17g, %.17g", k[0], k[1], k[2], k[3]);
  if (!fisheye && k[4] != 0.0) text += Format(", %.17g", k[4]);
  return text + "]\n";
}

std::string EurocTruth(const Simulation& simulation) {
  std::string text =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
      "q_RS_z [], v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], "
      "b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], "
      "b_a_RS_S_z [m s^-2]\n";
  for (const StampedPose& pose : simulation.Truth()) {
    constexpr double kStep = 1e-3;
    const double t = pose.timestamp_s;
    const Eigen::Vector3d v = (simulation.PoseAt(t + kStep).center_in_world -
                               simulation.PoseAt(t - kStep).center_in_world) /
                              (2.0 * kStep);
    const Eigen::Vector3d& c = pose.center_in_world;
    const Eigen::Quaterniond& q = pose.world_from_cam.Quaternion();
    text += Format("%lld,%.12f,%.12f,%.12f,", Nanoseconds(t), c.x(), c.y(), c.z());
    text += Format("%.15f,%.15f,%.15f,%.15f,", q.w(), q.x(), q.y(), q.z());
    text += Format("%.6f,%.6f,%.6f,0,0,0,0,0,0\n", v.x(), v.y(), v.z());
  }
  return text;
}

// Throws std::invalid_argument where EuRoC's files cannot hold the camera.
void CheckForEuroc(const Camera& camera) {
  if (camera.readout_s > 0.0) {
    throw std::invalid_argument(
        "EuRoC's sensor.yaml has no place for a rolling shutter; use the layout tum");
  }
  if (camera.model == CameraModel::kRational || camera.model == CameraModel::kFov) {
    throw std::invalid_argument(std::string("EuRoC's sensor.yaml has no place for a ") +
                                Name(camera.model) + " lens; use the layout tum");
  }
}

// Makes the folder of the images. Throws std::runtime_error where it holds others.
void MakeImageFolder(const fs::path& folder, const std::vector<std::string>& names) {
  MakeFolder(folder);
  const std::set<std::string> ours(names.begin(), names.end());
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".png" && !ours.contains(entry.path().filename().string())) {
      throw std::runtime_error(folder.string() +
                               " already holds another sequence; choose an empty --out");
    }
  }
}

void WriteImages(const Simulation& simulation,
                 const fs::path& folder,
                 const std::vector<std::string>& names,
                 const WriteOptions& options) {
  const int count = simulation.NumFrames();
  // In batches, so that progress is told from one thread.
  const int batch = std::max(1, 4 * options.num_threads);
  for (int begin = 0; begin < count; begin += batch) {
    const int size = std::min(batch, count - begin);
    ParallelFor(size, options.num_threads, [&](int k) {
      WriteImage(folder / names[begin + k], simulation.Render(begin + k));
    });
    if (options.progress) options.progress(begin + size, count);
  }
}

}  // namespace

std::vector<std::string> WriteSequence(const Simulation& simulation,
                                       const fs::path& out,
                                       const WriteOptions& options) {
  const bool euroc = options.layout == SequenceLayout::kEuroc;
  if (euroc) CheckForEuroc(simulation.GetCamera());
  const fs::path folder = euroc ? "mav0/cam0/data" : "rgb";
  const int count = simulation.NumFrames();
  std::vector<std::string> names;
  for (const StampedPose& pose : simulation.Truth()) {
    names.push_back(euroc ? Format("%lld.png", Nanoseconds(pose.timestamp_s))
                          : Format("%.6f.png", pose.timestamp_s));
  }
  MakeImageFolder(out / folder, names);
  WriteImages(simulation, out / folder, names, options);

  std::vector<std::string> written = {folder.string() + "/"};
  const auto write = [&](const std::string& name, const std::string& text) {
    WriteFile(out / name, text);
    written.push_back(name);
  };
  if (euroc) {
    std::string list = "#timestamp [ns],filename\n";
    for (int k = 0; k < count; ++k) {
      list += Format("%lld,", Nanoseconds(simulation.Truth()[k].timestamp_s)) + names[k] + "\n";
    }
    write("mav0/cam0/data.csv", list);
    write("mav0/cam0/sensor.yaml", EurocSensor(simulation.GetCamera(), simulation.Fps()));
    MakeFolder(out / "mav0/state_groundtruth_estimate0");
    write("mav0/state_groundtruth_estimate0/data.csv", EurocTruth(simulation));
  } else {
    std::string list = "# color images\n# simulated\n# timestamp filename\n";
    for (int k = 0; k < count; ++k) {
      list += Format("%.6f rgb/", simulation.Truth()[k].timestamp_s) + names[k] + "\n";
    }
    write("rgb.txt", list);
    write("groundtruth.txt", TumTrajectory(simulation.Truth()));
  }
  write("camera.yaml", CameraYaml(simulation.GetCamera()));
  write("groundtruth_tum.txt", TumTrajectory(simulation.Truth()));
  if (!simulation.Segments().empty()) {
    std::string list = "first_frame,last_frame,kind\n";
    for (const PathSegment& segment : simulation.Segments()) {
      list += Format("%d,%d,%s\n", segment.first_frame, segment.last_frame, Name(segment.kind));
    }
    write("segments_truth.csv", list);
  }
  return written;
}

}  // namespace rotslam
