#pragma once

#include <map>
#include <string>
#include <vector>

#include "apps/slam/map/frame_pose.h"
#include "rotodom/odometry.h"
#include "rotodom/sensor_orientations/sensor_orientations.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/trajectory.h"

namespace rotslam {

/// Orientations of a gimbal, an IMU or another system.
struct OrientationsFromElsewhere {
  std::string name;                        // of their file, for messages
  std::vector<StampedRotation> rotations;  // timestamps ascending, two or more
  bool use_alignment = false;              // take out their offset in time and their mounting
};

/// Given orientations together with those of the images.
struct GivenRotations {
  std::string file;
  bool is_aligned = false;                 // their offset in time and their mounting were taken out
  std::vector<StampedRotation> rotations;  // as given
  SensorFusion fusion;                     // by frame id

  bool CountsFor(FrameId frame) const {
    const OrientationSource source = fusion.source[frame.value];
    return source == OrientationSource::kBoth || source == OrientationSource::kSensor;
  }
};

/// The orientations that the images give, in the form that FuseOrientations() takes.
/// @param timestamps_s  by frame id.
/// @param images        an orientation for every frame. The variance of a step is the growth of
///                      the covariances where these are known, else that of the edges, both times
///                      ClosureVariance(). A step without an edge is not connected by the images.
ImageOrientations OrientationsOfImages(const std::vector<double>& timestamps_s,
                                       const OdometryResult& images);

/// Puts given orientations and those of the images together.
/// Throws std::runtime_error with one line where they are given for fewer than three frames, and
/// where they fit the images far better in another convention (inverse, other axes), which is
/// named.
GivenRotations MatchGivenRotations(const OrientationsFromElsewhere& given,
                                   const std::vector<double>& timestamps_s,
                                   const OdometryResult& images);

/// Offset and mounting of given orientations against those of a map, of which all that change from
/// frame to frame counts as drift of the sensor.
/// @param poses  of the frames; what is not measured or held connects nothing.
/// @return  the first estimate where that is the more certain one.
SensorAlignment AlignmentWithMap(const GivenRotations& given,
                                 const std::vector<double>& timestamps_s,
                                 const RotationMap& cam_from_world,
                                 const std::map<FrameId, FramePose>& poses);

}  // namespace rotslam
