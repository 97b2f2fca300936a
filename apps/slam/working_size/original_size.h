#pragma once

#include <vector>

#include "apps/slam/working_size/working_size.h"
#include "ba/bundle_adjustment.h"
#include "rotodom/features/features.h"
#include "rotodom/rolling_shutter/readout.h"
#include "rotodom/types/track.h"
#include "rotodom/types/view_graph.h"

namespace rotslam {

/// Converts results in pixels of reduced images to pixels of the original ones. Without reduction
/// nothing changes. Bearings, angles and covariances of rotations are the same for both.

/// Keypoints, their covariances, and their levels in the pyramid of the original images.
/// @param level_scale  as WorkingSize::NumLevelsBelow.
void ToOriginalSize(const WorkingSize& working, double level_scale, Features& features);

/// Keypoints and their standard deviations.
void ToOriginalSize(const WorkingSize& working, std::vector<Track>& tracks);

/// The inverse of ToOriginalSize(working, tracks), but for rounding.
void ToWorkingSize(const WorkingSize& working, std::vector<Track>& tracks);

/// Noise and parallax of every edge.
void ToOriginalSize(const WorkingSize& working, ViewGraph& graph);

void ToOriginalSize(const WorkingSize& working, ReadoutEstimate& readout);

/// Reprojection errors, and standard deviations of the lens.
void ToOriginalSize(const WorkingSize& working, BundleSummary& bundle);

void ToOriginalSize(const WorkingSize& working, LensSigmas& sigmas);

}  // namespace rotslam
