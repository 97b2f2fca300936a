#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "apps/cli/solve/solution.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/map_result.h"
#include "output/export/known_rotation_file.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// Why an observation is not in the map, by track and view; "kept" where it is.
using Verdicts = std::map<std::pair<TrackId, FrameId>, std::string>;

Verdicts VerdictsOf(const KnownRotationInput& input, const Solution& solution, bool is_adjusted);

/// Writes every observation that the map does not hold, and why: krot's reason, or that bundle
/// adjustment found it too far from its point.
void WriteRemoved(const std::filesystem::path& path,
                  const KnownRotationInput& input,
                  const Verdicts& verdicts);

/// Writes how far each observation is from its point, pixels per axis of a pinhole of the camera's
/// mean focal length, which is what the bracket bounds; empty where the point is not there or
/// behind.
void WriteResiduals(const std::filesystem::path& path,
                    const KnownRotationInput& input,
                    const Solution& solution,
                    const Verdicts& verdicts);

/// Writes the maps that `export`, `report` and `plot` read.
/// @param given  the input's id of each view.
void WriteSolvedMaps(const std::filesystem::path& directory,
                     const KnownRotationInput& input,
                     const std::vector<FrameId>& given,
                     const MapResult& positions);

/// Writes the table of views: frame of the run, id in the input, image, camera, observations.
void WriteViews(const std::filesystem::path& path,
                const KnownRotationInput& input,
                const std::vector<FrameId>& given,
                const MapResult& positions);

/// Writes the COLMAP model that came in, with what came out, and says how the two compare.
/// @param from  the folder of the model.
/// Six parameters: input and result of the command, and where they are written.
void WriteSolvedColmap(const std::filesystem::path& directory,
                       const std::string& from,
                       const KnownRotationInput& input,
                       const std::vector<FrameId>& given,
                       const Solution& solution,
                       Progress& progress);

}  // namespace rotslam
