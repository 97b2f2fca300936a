#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "rotodom/sequence/image_file.h"
#include "rotodom/sequence/video/ffmpeg_pointer.h"
#include "rotodom/sequence/video/video_orientation.h"

struct AVStream;  // FFmpeg's

namespace rotslam {

/// The frames of a video file in the order of presentation, decoded by FFmpeg's libraries.
///
/// Of several video streams the one with the most pixels is read; cover pictures do not count.
/// Frames are shown as the display matrix asks. Times are the stream's own, exact, and start with
/// the stream. A frame that is lost to damage keeps its place and its time, where the stream has
/// timestamps; frames before the first key frame, and a last one that is cut off, are left out.
class VideoFile {
 public:
  /// Decodes the first frame.
  /// @param fps          for streams that have no timestamps and do not say their rate.
  /// @param num_threads  of the decoder. More than 1 is faster, gives the same frames of files that
  ///                     are sound, and others where damage is concealed.
  /// Throws std::runtime_error, with path and reason in one line.
  VideoFile(const std::filesystem::path& path, double fps, int num_threads = 1);

  /// Steps to the next frame, the first one at first; false after the last.
  bool Grab();

  /// Of the frame grabbed last, s. Strictly increasing.
  double time_s() const { return time_s_; }

  /// Pixels of the frame grabbed last, 8 bits of blue, green and red, upright; once per frame.
  DecodedImage Retrieve();

  /// Size of the first frame, upright.
  cv::Size image_size() const { return image_size_; }

  /// Frames that the container announces, or that its packets seem to hold; -1: not known.
  std::int64_t num_announced() const { return num_announced_; }

  /// `video (H.264 in MP4)`.
  const std::string& form() const { return form_; }
  const std::string& times_source() const { return times_source_; }
  bool times_are_made_up() const { return !has_timestamps_; }

  /// One line each; some come when the last frame has been grabbed.
  const std::vector<std::string>& notes() const { return notes_; }

  /// The side of the upright picture where the first stored row is.
  ReadoutStart readout_from() const { return SideOfFirstRow(orientation_); }

  /// Tags of the file and its video stream: `com.apple.quicktime.model`, `creation_time` ...
  const std::map<std::string, std::string>& metadata() const { return metadata_; }

 private:
  void OpenContainer();
  void ChooseStream();
  void OpenDecoder(int num_threads);
  void ProbeTimestamps();
  void DecodeFirstFrame();
  void FindRate(double fps);
  void NoteWhatIsOdd();
  void CollectMetadata();
  void CountFrames();

  FfmpegPointer<AVPacket> ReadPacket();
  FfmpegPointer<AVPacket> NextPacket();
  void FeedDecoder();
  bool ReceivePicture();
  void CollectLost(std::int64_t shown);
  bool Step();
  void SetTime(std::int64_t ticks);
  void Finish();
  [[noreturn]] void Fail(const std::string& reason) const;

  std::filesystem::path path_;
  FfmpegPointer<AVFormatContext> container_;
  AVStream* stream_ = nullptr;
  FfmpegPointer<AVCodecContext> codec_;
  FfmpegPointer<AVFrame> picture_;
  FfmpegPointer<SwsContext> scaler_;

  std::string form_;
  std::string times_source_;
  std::vector<std::string> notes_;
  std::map<std::string, std::string> metadata_;
  PictureOrientation orientation_;
  cv::Size image_size_;
  std::int64_t num_announced_ = -1;
  std::int64_t num_left_out_ = 0;  // before the first key frame

  // Packets read ahead to look at their timestamps.
  std::deque<FfmpegPointer<AVPacket>> packets_;
  bool is_drained_ = false;  // the decoder has been told that no packet follows
  bool is_cut_off_ = false;  // the last packet was, and is left out
  bool has_ended_ = false;

  // Timestamps of packets whose frames have not come yet, and how many errors they may account for.
  std::multiset<std::int64_t> pending_;
  std::int64_t num_errors_ = 0;
  std::deque<std::int64_t> lost_;  // frames to be reported before the picture
  bool picture_waits_ = false;     // decoded, to be given by the next Step()
  bool has_picture_ = false;       // the frame grabbed last is `picture_`

  bool has_timestamps_ = true;
  double rate_ = 0.0;  // frames per second, where times are made up
  std::int64_t start_ticks_ = 0;
  double offset_s_ = 0.0;            // behind jumps back of the clock
  std::optional<double> suspect_s_;  // the last frame's own time, which was too early
  std::int64_t number_ = 0;          // frames grabbed
  double time_s_ = 0.0;
  std::int64_t num_without_time_ = 0;
};

}  // namespace rotslam
