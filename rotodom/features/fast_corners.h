#pragma once

#include <vector>

#include <opencv2/core.hpp>

namespace rotslam {

/// A corner at a whole pixel; `score` is the largest threshold at which it still is one.
struct FastCorner {
  int x;
  int y;
  int score;
};

/// FAST-9 corners on the circle of 16 pixels, none with an equal or better one among its eight
/// neighbours in `area`; row by row.
/// @param image      8-bit grey.
/// @param area       inside the image, 3 pixels or more from its border.
/// @param threshold  grey levels by which nine pixels in a row differ from the centre.
/// @return  what cv::FAST with non-maximum suppression gives, with the same scores.
/// Source:  Rosten & Drummond, Machine learning for high-speed corner detection, ECCV 2006. Ours
/// has no decision tree: the smallest of each nine pixels by minima of minima, many pixels at a
/// time.
std::vector<FastCorner> FindFastCorners(const cv::Mat& image, const cv::Rect& area, int threshold);

}  // namespace rotslam
