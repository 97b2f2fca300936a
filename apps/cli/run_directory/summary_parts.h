#pragma once

#include <string>
#include <vector>

#include "apps/cli/input/input.h"
#include "apps/slam/map_result.h"
#include "apps/slam/orientations.h"
#include "output/tables/summary.h"

namespace rotslam {

/// The parts of summary.json that `run` and `rotations` share.
RunSummary StartSummary(const std::string& command,
                        const Input& input,
                        const Orientations& orientations,
                        std::vector<OptionEntry> options);

/// The parts that only `run` has.
void AddPositions(const MapResult& positions, const Camera& camera, RunSummary& summary);

/// The parts that `run` and `solve` share.
void AddKnownRotation(const KrotSolution& solution, const Camera& camera, RunSummary& summary);
/// Adds to the known rotation's part the bracket after bundle adjustment. Nothing without a map.
void AddFinalBracket(const MapBracket& bracket, const Camera& camera, RunSummary& summary);
/// Nothing without a map.
void AddBundles(const MapResult& positions, RunSummary& summary);

}  // namespace rotslam
