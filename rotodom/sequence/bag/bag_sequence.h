#pragma once

#include <memory>

#include "rotodom/sequence/frames.h"
#include "rotodom/sequence/layout.h"

namespace rotslam {

/// The pictures of one topic of the recording `layout.folder`, which may end in a colon and the
/// name of the topic. Without one it is the only topic with pictures; depth does not count, nor
/// does the compressed copy of a topic that is there.
///   times   the stamps in the messages' headers. Frames that lie up to 16 places from where their
///           stamp belongs are sorted. Where the stamps are zero or do not increase, the times at
///           which the messages were recorded; a note says so. A message that is there twice with
///           the same stamp and bytes counts once.
///   camera  the message sensor_msgs/CameraInfo beside the pictures ("/cam0/camera_info" for
///           "/cam0/image_raw"), for rectified pictures ("/cam0/image_rect") its matrix P.
/// Throws std::runtime_error, with path and reason in one line, when there are no pictures, several
/// topics with pictures, or times that do not increase.
std::unique_ptr<Sequence> OpenBagSequence(const Layout& layout, const SequenceOptions& options);

}  // namespace rotslam
