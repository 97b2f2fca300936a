#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "output/map/thumbnails_file.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// A picture that is offered for a frame, small (MakeFrameThumbnail).
struct OfferedPicture {
  FrameId frame;
  std::string name;  // for messages
  std::vector<std::uint8_t> grey;
};

/// Whether pictures are those that a run has read, up to compression, brightness and contrast.
///
/// The residual of two thumbnails is what the best gain and offset leave, as a root of mean squares
/// in grey levels. A picture is another frame's when that one leaves less than half of it: noise of
/// the picture is in both, so that it cannot halve the residual. A picture is unlike any other when
/// its correlation is low.
/// @param thumbnails  of all frames of the run. Frames without one have no picture to compare with.
/// @return  the first picture that does not fit, in one line; nullopt: all fit.
std::optional<std::string> FindWrongPicture(const ThumbnailTable& thumbnails,
                                            const std::vector<OfferedPicture>& pictures);

}  // namespace rotslam
