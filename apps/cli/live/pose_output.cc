#include "apps/cli/live/pose_output.h"

#include <array>
#include <csignal>
#include <cstdio>
#include <stdexcept>

#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

namespace rotslam {
namespace {

constexpr const char* kUdp = "udp://";

class FileOutput : public PoseOutput {
 public:
  explicit FileOutput(const std::string& place)
      : place_(place), file_(place == "-" ? stdout : std::fopen(place.c_str(), "w")) {
    if (file_ == nullptr) throw std::runtime_error(place + ": cannot be written");
  }
  ~FileOutput() override {
    if (file_ != stdout) std::fclose(file_);
  }
  FileOutput(const FileOutput&) = delete;
  FileOutput& operator=(const FileOutput&) = delete;

  void Write(const std::string& line) override {
    if (std::fputs((line + "\n").c_str(), file_) < 0 || std::fflush(file_) != 0) {
      throw std::runtime_error((place_ == "-" ? "standard output" : place_) +
                               ": poses cannot be written any more");
    }
  }

 private:
  std::string place_;
  std::FILE* file_;
};

class UdpOutput : public PoseOutput {
 public:
  explicit UdpOutput(const std::string& place) {
    const std::string rest = place.substr(std::string(kUdp).size());
    const auto colon = rest.rfind(':');
    if (colon == std::string::npos) {
      throw std::runtime_error(place + ": the port is missing; udp://127.0.0.1:5000 has one");
    }
    addrinfo hints = {};
    hints.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    if (getaddrinfo(
            rest.substr(0, colon).c_str(), rest.substr(colon + 1).c_str(), &hints, &found) != 0) {
      throw std::runtime_error(place + ": there is no such host or port");
    }
    socket_ = socket(found->ai_family, found->ai_socktype, found->ai_protocol);
    const bool is_connected =
        socket_ >= 0 && connect(socket_, found->ai_addr, found->ai_addrlen) == 0;
    freeaddrinfo(found);
    if (!is_connected) throw std::runtime_error(place + ": cannot be reached");
  }
  ~UdpOutput() override {
    if (socket_ >= 0) close(socket_);
  }
  UdpOutput(const UdpOutput&) = delete;
  UdpOutput& operator=(const UdpOutput&) = delete;

  // A receiver that is not there yet, or no more, is no error.
  void Write(const std::string& line) override {
    [[maybe_unused]] const ssize_t sent =
        send(socket_, line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

 private:
  int socket_ = -1;
};

}  // namespace

std::string PoseLine(const LiveEstimate& estimate) {
  const Rotation world_from_cam = estimate.cam_from_world.Inverse();
  const Eigen::Quaterniond& q = world_from_cam.Quaternion();
  std::array<char, 96> place = {};
  if (estimate.center_in_world) {
    const Eigen::Vector3d& c = *estimate.center_in_world;
    std::snprintf(place.data(), place.size(), "%.9g %.9g %.9g", c.x(), c.y(), c.z());
  } else {
    std::snprintf(place.data(), place.size(), "nan nan nan");
  }
  std::array<char, 256> line = {};
  std::snprintf(line.data(),
                line.size(),
                "%.9f %s %.9g %.9g %.9g %.9g %s %d",
                estimate.timestamp_s,
                place.data(),
                q.x() + 0.0,  // no minus before a zero
                q.y() + 0.0,
                q.z() + 0.0,
                q.w(),
                ToString(estimate.state),
                estimate.map_revision);
  return line.data();
}

std::unique_ptr<PoseOutput> OpenPoseOutput(const std::string& place) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that has gone is told by Write()
  if (place.rfind(kUdp, 0) == 0) return std::make_unique<UdpOutput>(place);
  return std::make_unique<FileOutput>(place);
}

}  // namespace rotslam
