#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "rotodom/features/fast_corners.h"
#include "rotodom/features/features.h"

namespace rotslam {

/// Chooses `count` corners, or a few more, that are spread evenly over an area: the area is divided
/// into quarters again and again, those with the most corners first, until there are as many parts
/// as corners are asked for or each part has one; the strongest corner of each part stays.
/// @param corners  inside the area, no two at one pixel.
/// @return  ascending by row and column; at most three more than asked for.
/// Source:  Mur-Artal & Tardos, ORB-SLAM2, T-RO 2017 (and its program, of which we have taken no
///          line).
std::vector<FastCorner> SpreadCorners(const std::vector<FastCorner>& corners,
                                      const cv::Rect& area,
                                      int count);

/// ORB features of an image as ORB-SLAM2 extracts them: on every level of the pyramid FAST corners
/// cell by cell, 30 pixels wide, with options.fast_threshold and, in cells without a corner, with
/// min_fast_threshold; spread by SpreadCorners, each level with a share in proportion to its side;
/// described by ORB. Positions are whole pixels of their level. Masked parts have no features.
/// @return  described features, ordered by level, row and column.
/// Cost:    20 ms for 4,000 features of an image of 1241 x 376.
/// Source:  as above; Rublee et al., ORB, ICCV 2011. ORB-SLAM2 multiplies positions by the scale of
///          their level, ours maps pixel centres to pixel centres.
Features ExtractSpreadOrb(const MaskedImage& image,
                          FrameId frame,
                          const Camera& camera,
                          const FeatureOptions& options,
                          int num_threads);

}  // namespace rotslam
