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

// Poses of a map's frames, found anew. Relocalise's own.

// A point, and where a frame shows it or seems to.
struct Sighted {
  TrackId track;
  Eigen::Vector2d keypoint_px;
};

// A frame's pose against known points.
struct FoundFrame {
  FrameId frame;
  std::optional<FrameId> match;  // that sees the points; none: several that the frame's tracks name
  bool by_neighbours = false;    // of the match, which see the points, too
  int num_inliers = 0;
  int num_present = 0;  // that the frame's present pose explains
  // Of points that the map does not show in the frame: where these are is not its own doing.
  int num_agreeing = 0;
  bool is_displaced = false;  // the present pose explains too little
  bool is_right = false;      // it explains as much, also of points that the frame is not tied to
  bool is_near = false;       // it explains more of those than chance does; so it does where right
  Similarity move;            // of the frame's surroundings, into the world of the points
  std::vector<std::pair<TrackId, Observation>> sightings;
};

class FrameFinder {
 public:
  // As Relocalise takes them; they must outlive it.
  FrameFinder(const std::vector<const Reconstruction*>& maps,
              PlaceMatches& places,
              const Camera& camera,
              const RelocalisationOptions& options,
              std::uint64_t seed);

  // Of a frame that one of the maps has a pose of.
  int MapOf(FrameId frame) const { return map_of_.at(frame); }

  // Those that the frame sees, ascending.
  const std::vector<TrackId>& PointsOf(FrameId frame) const;
  // That two frames of one map see.
  int CountCommon(FrameId a, FrameId b) const;

  // Whether both frames have poses and described corners.
  bool IsOpen(const Lookalike& pair) const;

  // Other places of its map, those first that see most of the same points.
  std::vector<FrameId> NeighboursOf(FrameId frame) const;

  // The pair's frame against the points that the match sees; where these are too few, against those
  // that its neighbours see, too.
  std::optional<FoundFrame> Find(const Lookalike& pair) const;

  // By frame: where tracks show points that two other frames see.
  std::map<FrameId, std::vector<Sighted>> PointsOfTracks(const std::vector<Track>& tracks) const;

  // A frame against such points; only where it is displaced.
  std::optional<FoundFrame> FindByTracks(FrameId frame, const std::vector<Sighted>& points) const;

 private:
  ResectionStart PresentPose(FrameId frame) const;
  std::optional<TrackId> PointAt(FrameId frame, const Eigen::Vector2d& px) const;
  // Adds corners of the frame that look like points which the match sees.
  void Recognise(FrameId frame, FrameId match, std::vector<Sighted>& recognised) const;
  std::vector<PointSighting> SightingsOf(int map, const std::vector<Sighted>& points) const;
  bool Explains(const ResectionStart& pose, const PointSighting& sighting) const;
  // @param map  of the points.
  std::optional<FoundFrame> FindPose(FrameId frame,
                                     int map,
                                     const std::vector<Sighted>& points) const;
  // What the present pose explains beside that.
  void Compare(const std::vector<Sighted>& points,
               const std::vector<PointSighting>& sightings,
               const ResectedPose& pose,
               FoundFrame& found) const;
  // What the pose says of the frame's surroundings: they move with it, and their depths say how
  // much larger they become.
  void Describe(const ResectedPose& pose,
                int map_of_points,
                const std::vector<Sighted>& points,
                const std::vector<PointSighting>& sightings,
                FoundFrame& found) const;

  const std::vector<const Reconstruction*>& maps_;
  PlaceMatches& places_;
  const Camera& camera_;
  const RelocalisationOptions& options_;
  std::uint64_t seed_;
  std::map<FrameId, int> map_of_;
  std::map<FrameId, std::vector<Sighted>> seen_;
  std::map<FrameId, std::vector<TrackId>> points_;  // ascending
};

}  // namespace rotslam
