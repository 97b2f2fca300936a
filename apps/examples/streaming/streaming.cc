// Orientations frame by frame, as the images come: streaming SEQUENCE CAMERA
#include <cstdio>
#include <exception>

#include "rotodom/camera/read_camera.h"
#include "rotodom/odometry.h"
#include "rotodom/sequence/sequence.h"

int main(int argc, char** argv) try {
  if (argc != 3) {
    std::fprintf(stderr, "usage: streaming SEQUENCE CAMERA\n");
    return 2;
  }
  // Any source of images will do: a driver's callback, cv::VideoCapture ...
  const auto sequence = rotslam::OpenSequence(argv[1], {});
  const cv::Size size = sequence->image_size();
  const rotslam::Camera camera =
      rotslam::MatchToImages(rotslam::ReadCamera(rotslam::ParseCameraReference(argv[2]),
                                                 sequence->image_folder(),
                                                 {size.width, size.height}),
                             size);
  rotslam::RotationalOdometry odometry(camera, {}, /*seed=*/1, /*num_threads=*/2);

  std::printf("# timestamp_s qx qy qz qw (camera to world) sigma_x sigma_y sigma_z (deg)\n");
  while (const auto frame = sequence->Next()) {
    const rotslam::FrameEstimate estimate =
        odometry.AddFrame(frame->id, frame->timestamp_s, frame->image);
    const Eigen::Quaterniond q = estimate.cam_from_world.Inverse().Quaternion();
    std::printf("%.6f %.9f %.9f %.9f %.9f", estimate.timestamp_s, q.x(), q.y(), q.z(), q.w());
    if (estimate.covariance) {
      const Eigen::Vector3d sigma_deg =
          estimate.covariance->diagonal().cwiseSqrt() * rotslam::kDegFromRad;
      std::printf(" %.5f %.5f %.5f", sigma_deg.x(), sigma_deg.y(), sigma_deg.z());
    }
    std::printf("\n");
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "streaming: %s\n", error.what());
  return 1;
}
