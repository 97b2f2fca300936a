#pragma once

#include "rotodom/types/ids.h"

namespace rotslam {

/// Two frames that look alike.
struct Lookalike {
  FrameId frame;
  FrameId match;
};

}  // namespace rotslam
