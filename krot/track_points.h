#pragma once

#include <optional>
#include <vector>

#include "krot/krot_options.h"
#include "krot/krot_problem.h"
#include "krot/krot_solution.h"
#include "rotodom/camera/camera.h"
#include "rotodom/types/maps.h"
#include "rotodom/types/track.h"

namespace rotslam {

/// Throws std::invalid_argument where SolveKnownRotation's contract is broken.
void RequireContract(const RotationMap& cam_from_world,
                     const std::vector<Track>& tracks,
                     const Camera& camera,
                     const KrotOptions& options);

/// Tracks without unusable observations, frames ascending; same order as the input, short ones
/// kept.
std::vector<Track> CleanTracks(const std::vector<Track>& tracks,
                               std::vector<RemovedObservation>& removed);

/// A track's point and the views that disagree.
struct TriangulatedTrack {
  Eigen::Vector3d point_in_world;
  std::vector<FrameId> outliers;
};
using TriangulatedTracks = std::vector<std::optional<TriangulatedTrack>>;  // by track position

/// Points of all tracks from the centres of some views.
/// @param thresholds  of each track, largest bearing error of a right observation, rad; counted
///                    options.loose_factor times.
TriangulatedTracks TriangulateAll(const KrotProblem& problem,
                                  const CenterMap& centers,
                                  const std::vector<double>& thresholds);

}  // namespace rotslam
