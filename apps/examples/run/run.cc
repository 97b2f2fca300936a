// From a folder of images to a map: run IMAGES CAMERA CLOUD.ply TRAJECTORY.txt
#include <cstdio>
#include <exception>

#include "apps/slam/slam.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"

int main(int argc, char** argv) try {
  if (argc != 5) {
    std::fprintf(stderr, "usage: run IMAGES CAMERA CLOUD.ply TRAJECTORY.txt\n");
    return 2;
  }
  // Images from anywhere else: derive from rotslam::FrameSource.
  rotslam::SequenceSource frames(argv[1], {});
  const cv::Size size = frames.sequence().image_size();
  const rotslam::Camera camera =
      rotslam::MatchToImages(rotslam::ReadCamera(rotslam::ParseCameraReference(argv[2]),
                                                 frames.sequence().image_folder(),
                                                 {size.width, size.height}),
                             size);
  rotslam::SlamOptions options;
  options.num_threads = 2;
  const auto [lens, orientations, map] = rotslam::RunSlam(frames, camera, options);
  if (!map.failure.empty()) std::fprintf(stderr, "no map: %s\n", map.failure.c_str());

  rotslam::Trajectory trajectory;
  for (const auto& [frame, cam_from_world] : map.cam_from_world) {
    trajectory.push_back({orientations.timestamps_s[frame.value],
                          cam_from_world.Inverse(),
                          map.center_in_world.at(frame)});
  }
  rotslam::WriteTumTrajectory(argv[4], trajectory);
  rotslam::WritePly(argv[3], rotslam::MakeCloud(map.cloud, map.camera));
} catch (const std::exception& error) {
  std::fprintf(stderr, "run: %s\n", error.what());
  return 1;
}
