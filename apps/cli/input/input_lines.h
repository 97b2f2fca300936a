#pragma once

#include <string>
#include <vector>

#include "apps/cli/input/input.h"

namespace rotslam {

/// Lines for people about a sequence: what it was taken for, its times with gaps, how its pictures
/// are turned, what is ignored or assumed. `run` and `inspect` print the same ones.
std::vector<std::string> DescribeSequence(const Sequence& sequence);

/// The same for the camera of an input: model, numbers, where they come from.
std::vector<std::string> DescribeCamera(const Input& input);

/// The same for its masks; none where nothing is masked.
std::vector<std::string> DescribeMasks(const FrameMasks& masks);

/// One line about times: from when to when, the rate, duplicates and gaps.
/// @param times_s    ascending; empty: an empty line.
/// @param with_gaps  off where the notes of a sequence tell of them.
std::string DescribeTimes(const std::vector<double>& times_s, bool with_gaps);

}  // namespace rotslam
