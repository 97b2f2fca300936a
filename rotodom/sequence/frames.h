#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "rotodom/camera/camera.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/layout.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// Selects the frames of a sequence, and gives their rate if the input has no times.
struct SequenceOptions {
  // Number of the first input frame to use; the sequence's own first frame is 0.
  int first = 0;
  // Number of the last input frame to use, inclusive; -1 or beyond the end: up to the end.
  int last = -1;
  // Use every stride-th frame. More than 1 widens the motion between frames.
  int stride = 1;
  // Frames per second, for input without timestamps: time = number in the sequence / fps. 30 is
  // what phones and hand-held data sets record. Only the timestamps move with it.
  double fps = 30.0;

  std::optional<std::string> Problem() const;

  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("first", first);
    visit("last", last);
    visit("stride", stride);
    visit("fps", fps);
  }
};

/// One input frame.
struct Frame {
  FrameId id;                // 0, 1, 2 ... after first, last and stride
  double timestamp_s = 0.0;  // strictly increasing with id
  cv::Mat image;             // 8-bit, 1 channel or 3 (blue, green, red); empty when unreadable
  std::string name;          // file name, or the number of the frame in a video
  std::string problem;       // why the image is empty, in one line; empty when it is not
};

/// The frames of one input, in order, each once. Made by OpenSequence. Images are
/// decoded one ahead, on a thread of their own.
class Sequence {
 public:
  virtual ~Sequence() = default;
  Sequence(const Sequence&) = delete;
  Sequence& operator=(const Sequence&) = delete;

  /// The next frame; nullopt after the last. An image that cannot be decoded, or whose size is not
  /// image_size(), comes as an empty one with `problem` set: it never throws.
  std::optional<Frame> Next();

  /// Passes over the next `count` frames, or those that are left, without decoding images.
  virtual void Skip(int count) = 0;

  /// The images that Next() gives, in its order; of a video the file.
  virtual std::vector<std::filesystem::path> Files() const = 0;

  /// Frames that Next() gives in all. For a video it is what the file claims until the last frame
  /// has been read, and -1 where the file claims nothing.
  int NumFrames() const { return num_frames_; }

  /// Times of the frames, by id. Complete from the start, but for a video: there it grows by one
  /// with each Next().
  const std::vector<double>& timestamps_s() const { return timestamps_s_; }

  /// Size of the first readable image; every other image must have it.
  cv::Size image_size() const { return image_size_; }

  /// Is it a file whose frames are numbered, without names of their own?
  bool is_video() const { return is_video_; }

  /// Name of the form that the input was taken for: "EuRoC ASL", "image folder", "video".
  const std::string& form() const { return form_; }

  /// The source of the times, a short phrase: "times.txt", "file names (ns since 1970)".
  const std::string& times_source() const { return times_source_; }

  /// True when frames are numbered and SequenceOptions::fps, or a rate that the input says, is
  /// believed.
  bool times_are_made_up() const { return times_are_made_up_; }

  /// Assumptions made and files ignored, one line each. A video may add some at its end.
  const std::vector<std::string>& notes() const { return notes_; }

  /// The side of the images that the sensor's first row is on, where the input tells: a video turns
  /// what a sensor has read from its top.
  const std::optional<ReadoutStart>& readout_from() const { return readout_from_; }

  /// Tags of a video file: camera, lens, place, date; in the file's own spelling.
  const std::map<std::string, std::string>& metadata() const { return metadata_; }

  /// Folder that Frame::name is in; for a video, the file.
  const std::filesystem::path& image_folder() const { return image_folder_; }

  /// One line for people: kind, number of frames, size, duration, place.
  std::string Describe() const;

  /// Calibration that lies with the images: `camera.yaml` of our own in any layout, else the data
  /// set's file (KITTI `calib.txt`, EuRoC `sensor.yaml`). For ReadCamera.
  const std::optional<CameraReference>& camera_reference() const { return camera_reference_; }

  /// Calibration that the input itself says, as a bag or a known data set does; a file that lies
  /// with the images goes first.
  const std::optional<Camera>& own_camera() const { return own_camera_; }

  /// Camera trajectory that lies with the images: `groundtruth_tum.txt`,
  /// `groundtruth_cam0_tum.txt`, `groundtruth.txt` or `poses.txt`, else the data set's own, which
  /// is a folder where each frame has a pose file.
  const std::optional<std::filesystem::path>& GroundTruthFile() const { return ground_truth_file_; }

 protected:
  /// Takes over what `layout` says of the input, but neither its place nor its entries.
  explicit Sequence(const Layout& layout);

  // The next frame as decoded, its size unchecked; nullopt after the last.
  virtual std::optional<Frame> Decode() = 0;

  std::string form_;
  bool is_video_ = false;
  std::string times_source_;
  bool times_are_made_up_ = false;
  std::vector<std::string> notes_;
  std::optional<ReadoutStart> readout_from_;
  std::map<std::string, std::string> metadata_;
  std::filesystem::path place_;
  std::filesystem::path image_folder_;
  int num_frames_ = -1;
  std::vector<double> timestamps_s_;
  cv::Size image_size_;
  std::optional<CameraReference> camera_reference_;
  std::optional<Camera> own_camera_;
  std::optional<std::filesystem::path> ground_truth_file_;
};

/// `camera` with the size of the images, where it did not say one itself, and scaled to them where
/// it says another of the same shape, within a pixel. Throws std::runtime_error (`camera says
/// 640x480, images are 752x480: ...`) where it says one of another shape.
Camera MatchToImages(const Camera& camera, const cv::Size& image_size);

}  // namespace rotslam
