#pragma once

#include <vector>

#include <opencv2/core.hpp>

namespace rotslam {

/// A corner at a whole pixel; `score` is the largest threshold at which it is still detected.
struct FastCorner {
  int x;
  int y;
  int score;
};

/// Detects FAST-9 corners on the circle of 16 pixels, with non-maximum suppression among the eight
/// neighbours in `area`. The corners come row by row.
/// @param image      8-bit grey.
/// @param area       inside the image, 3 pixels or more from its border.
/// @param threshold  grey levels by which nine pixels in a row differ from the centre.
/// @return  what cv::FAST with non-maximum suppression gives, with the same scores.
/// Source:  Rosten & Drummond, Machine learning for high-speed corner detection, ECCV 2006. Ours
///          has no decision tree: it computes minima over all runs of nine pixels, for many pixels
///          at a time.
std::vector<FastCorner> FindFastCorners(const cv::Mat& image, const cv::Rect& area, int threshold);

}  // namespace rotslam
