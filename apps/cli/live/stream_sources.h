#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "apps/cli/live/frame_pump.h"

namespace rotslam {

/// When frames were taken that do not say so: `fps` frames per second, or, without, as they arrive,
/// in seconds since the first one.
struct ArrivalTimes {
  std::optional<double> fps;
};

/// JPEG and PNG images one after the other on a file descriptor, as `ffmpeg -f image2pipe` writes
/// them. What lies between images is passed over; an image that cannot be decoded comes as an empty
/// one with its problem.
/// @param folder  when set, receives the images as they came, and times.txt with their times, so
///                that OpenSequence reads what was seen. Throws std::runtime_error where it cannot
///                be written.
FramePump::Source ImageStream(int descriptor,
                              const ArrivalTimes& times,
                              const std::optional<std::filesystem::path>& folder);

/// Frames of a video device ("/dev/video0") or an address (rtsp://, http://), through OpenCV.
/// Throws std::runtime_error in one line where it cannot be opened.
FramePump::Source CaptureStream(const std::string& source,
                                const ArrivalTimes& times,
                                const std::optional<std::filesystem::path>& folder);

/// Images as they appear in a folder, by name: one that is there at the start first. It goes on
/// until it is stopped.
FramePump::Source FollowedFolder(const std::filesystem::path& watched,
                                 const ArrivalTimes& times,
                                 const std::optional<std::filesystem::path>& folder);

/// Whether CaptureStream is meant: a device or an address.
bool IsCaptureSource(const std::string& source);

}  // namespace rotslam
