#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "apps/slam/map_correction/lookalike.h"
#include "apps/slam/map_correction/place_matches.h"
#include "apps/slam/map_correction/relocalisation_options.h"
#include "ba/resection.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/reconstruction.h"
#include "rotodom/types/similarity.h"

namespace rotslam {

// Finds poses of a map's frames from points of the same or another map. Used by Relocalise only.

// A pose of a frame found from known points.
struct FoundFrame {
  FrameId frame;
  std::optional<FrameId>
      match;                   // the frame that sees the points; none: found by the frame's tracks
  bool by_neighbours = false;  // points of the match's neighbours were used, too
  int num_inliers = 0;
  int num_present = 0;  // observations that the frame's present pose explains
  // Explained observations of points that the map does not observe in this frame, so that the frame
  // has not contributed to their positions.
  int num_agreeing = 0;
  bool is_displaced = false;  // the present pose explains too little
  bool is_right = false;      // it explains as many, also among points not observed in the frame
  bool is_near = false;       // it explains more of those than chance would; implied by is_right
  Similarity move;            // of the frame's surroundings, into the world of the points
  std::vector<std::pair<TrackId, Observation>> observations;
};

class FrameFinder {
 public:
  // The arguments of Relocalise; they must outlive this object.
  FrameFinder(const std::vector<const Reconstruction*>& maps,
              PlaceMatches& places,
              const Camera& camera,
              const RelocalisationOptions& options,
              std::uint64_t seed);

  // Index of the map that holds the frame.
  int MapOf(FrameId frame) const { return map_of_.at(frame); }

  // Points that the frame sees, ascending.
  const std::vector<TrackId>& PointsOf(FrameId frame) const;
  // Number of points that two frames of one map both see.
  int CountCommon(FrameId a, FrameId b) const;

  // Whether both frames have poses and described corners.
  bool IsOpen(const Lookalike& pair) const;

  // Other places of the frame's map, ordered by the number of common points, largest first.
  std::vector<FrameId> NeighboursOf(FrameId frame) const;

  // Finds the pose of the pair's frame from the points that the match sees; where these are too
  // few, from those of the match's neighbours as well.
  std::optional<FoundFrame> Find(const Lookalike& pair) const;

  // By frame: keypoints of its tracks whose points two other frames see.
  std::map<FrameId, std::vector<PointObservation2D3D>> PointsOfTracks(
      const std::vector<Track>& tracks) const;

  // Finds the pose of a frame from such points; nullopt unless the frame is displaced.
  std::optional<FoundFrame> FindByTracks(FrameId frame,
                                         const std::vector<PointObservation2D3D>& points) const;

 private:
  ResectionStart PresentPose(FrameId frame) const;
  std::optional<TrackId> PointAt(FrameId frame, const Eigen::Vector2d& px) const;
  // Adds corners of the frame whose descriptors match those of points that the match sees.
  void Recognise(FrameId frame, FrameId match, std::vector<PointObservation2D3D>& recognised) const;
  bool Explains(const ResectionStart& pose, const PointObservation2D3D& observation) const;
  // @param map  of the points.
  std::optional<FoundFrame> FindPose(FrameId frame,
                                     int map,
                                     const std::vector<PointObservation2D3D>& points) const;
  // Counts what the present pose explains, and sets the flags of `found`.
  void Compare(const std::vector<PointObservation2D3D>& points,
               const ResectedPose& pose,
               FoundFrame& found) const;
  // Sets the similarity that moves the frame and its surroundings into the world of the points. The
  // scale follows from the depths of the points in both maps.
  void Describe(const ResectedPose& pose,
                int map_of_points,
                const std::vector<PointObservation2D3D>& points,
                FoundFrame& found) const;

  const std::vector<const Reconstruction*>& maps_;
  PlaceMatches& places_;
  const Camera& camera_;
  const RelocalisationOptions& options_;
  std::uint64_t seed_;
  std::map<FrameId, int> map_of_;
  std::map<FrameId, std::vector<PointObservation2D3D>> seen_;
  std::map<FrameId, std::vector<TrackId>> points_;  // ascending
};

}  // namespace rotslam
