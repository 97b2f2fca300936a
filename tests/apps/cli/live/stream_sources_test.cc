#include "apps/cli/live/stream_sources.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "apps/cli/live/pose_output.h"
#include "rotodom/sequence/sequence.h"
#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

const auto kNever = [] { return false; };

// A pipe with these bytes in it, in pieces, whose other end closes.
class FilledPipe {
 public:
  explicit FilledPipe(std::vector<unsigned char> bytes) {
    EXPECT_EQ(pipe(ends_.data()), 0);
    writer_ = std::thread([this, content = std::move(bytes)] {
      constexpr std::size_t kPiece = 777;
      for (std::size_t k = 0; k < content.size(); k += kPiece) {
        const std::size_t count = std::min(kPiece, content.size() - k);
        if (write(ends_[1], content.data() + k, count) < 0) break;
      }
      close(ends_[1]);
    });
  }
  ~FilledPipe() {
    writer_.join();
    close(ends_[0]);
  }
  FilledPipe(const FilledPipe&) = delete;
  FilledPipe& operator=(const FilledPipe&) = delete;

  int descriptor() const { return ends_[0]; }

 private:
  std::array<int, 2> ends_ = {};
  std::thread writer_;
};

cv::Mat Picture(int k) {
  cv::Mat picture(48, 64, CV_8UC1);
  for (int row = 0; row < picture.rows; ++row) {
    for (int col = 0; col < picture.cols; ++col) {
      picture.at<unsigned char>(row, col) = static_cast<unsigned char>(row * 4 + col * (k + 1));
    }
  }
  return picture;
}

void Append(const char* extension, int k, std::vector<unsigned char>& bytes) {
  std::vector<unsigned char> image;
  cv::imencode(extension, Picture(k), image);
  bytes.insert(bytes.end(), image.begin(), image.end());
}

TEST(ImageStream, CutsJpegAndPngImages) {
  std::vector<unsigned char> bytes = {'r', 'u', 'b', 'b', 'i', 's', 'h'};
  Append(".png", 0, bytes);
  Append(".jpg", 1, bytes);
  bytes.insert(bytes.end(), {0, 1, 2});
  Append(".jpg", 2, bytes);
  Append(".png", 3, bytes);
  const FilledPipe pipe(bytes);
  const TemporaryFolder folder;
  const FramePump::Source source = ImageStream(pipe.descriptor(), {10.0}, folder.path() / "frames");
  for (int k = 0; k < 4; ++k) {
    const std::optional<Frame> frame = source(kNever);
    ASSERT_TRUE(frame) << k;
    EXPECT_EQ(frame->id, FrameId{k});
    EXPECT_DOUBLE_EQ(frame->timestamp_s, 0.1 * k);
    EXPECT_EQ(frame->problem, "");
    ASSERT_EQ(frame->image.size(), cv::Size(64, 48));
    EXPECT_LT(cv::norm(frame->image, Picture(k), cv::NORM_INF), 40.0);
  }
  EXPECT_FALSE(source(kNever));
  // What was seen can be read again.
  const auto sequence = OpenSequence((folder.path() / "frames").string(), {});
  EXPECT_EQ(sequence->NumFrames(), 4);
  EXPECT_FALSE(sequence->times_are_made_up());
  EXPECT_DOUBLE_EQ(sequence->timestamps_s()[3], 0.3);
}

TEST(ImageStream, TellsOfABrokenImageAndGoesOn) {
  std::vector<unsigned char> jpeg;
  Append(".jpg", 1, jpeg);
  std::fill(jpeg.begin() + 30, jpeg.begin() + 60, static_cast<unsigned char>(9));
  std::vector<unsigned char> good;
  Append(".jpg", 2, good);
  jpeg.insert(jpeg.end(), good.begin(), good.end());
  const FilledPipe pipe(jpeg);
  const FramePump::Source source = ImageStream(pipe.descriptor(), {10.0}, std::nullopt);
  std::optional<Frame> newest;
  while (std::optional<Frame> frame = source(kNever)) newest = std::move(frame);
  ASSERT_TRUE(newest);
  ASSERT_EQ(newest->problem, "");
  EXPECT_LT(cv::norm(newest->image, Picture(2), cv::NORM_INF), 40.0);
}

TEST(ImageStream, EndsWhenItIsStopped) {
  std::array<int, 2> ends = {};
  ASSERT_EQ(pipe(ends.data()), 0);
  const FramePump::Source source = ImageStream(ends[0], {}, std::nullopt);
  EXPECT_FALSE(source([] { return true; }));
  close(ends[0]);
  close(ends[1]);
}

FramePump::Source Counting(int num_frames) {
  const auto next = std::make_shared<int>(0);
  return [next, num_frames](const std::function<bool()>&) -> std::optional<Frame> {
    if (*next == num_frames) return std::nullopt;
    Frame frame;
    frame.id = FrameId{(*next)++};
    frame.timestamp_s = 0.02 * frame.id.value;
    return frame;
  };
}

TEST(FramePump, WaitsForWhoeverTakesTheFrames) {
  FramePump pump(Counting(20), Backlog::kWait);
  for (int k = 0; k < 20; ++k) EXPECT_EQ(pump.Next(kNever)->id, FrameId{k});
  EXPECT_FALSE(pump.Next(kNever));
  EXPECT_EQ(pump.num_dropped(), 0);
}

TEST(FramePump, DropsWhatComesTooFast) {
  FramePump pump(Paced(Counting(20)), Backlog::kDrop);
  int num_taken = 0;
  FrameId newest;
  while (const std::optional<Frame> frame = pump.Next(kNever)) {
    EXPECT_GT(frame->id, newest);
    newest = frame->id;
    ++num_taken;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(newest, FrameId{19});
  EXPECT_GT(pump.num_dropped(), 0);
  EXPECT_EQ(num_taken + pump.num_dropped(), 20);
}

TEST(FramePump, GivesTheSourcesProblemAway) {
  FramePump pump([](const auto&) -> std::optional<Frame> { throw std::runtime_error("broken"); },
                 Backlog::kWait);
  EXPECT_THROW(pump.Next(kNever), std::runtime_error);
}

TEST(PoseLine, SaysStateAndRevision) {
  LiveEstimate estimate;
  estimate.timestamp_s = 1.5;
  EXPECT_EQ(PoseLine(estimate), "1.500000000 nan nan nan 0 0 0 1 starting 0");
  estimate.center_in_world = Eigen::Vector3d(1, 2, 3);
  estimate.state = LiveState::kTracking;
  estimate.map_revision = 4;
  EXPECT_EQ(PoseLine(estimate), "1.500000000 1 2 3 0 0 0 1 tracking 4");
}

TEST(OpenPoseOutput, RefusesWhatItCannotWrite) {
  EXPECT_THROW(OpenPoseOutput("/no/such/folder/poses.txt"), std::runtime_error);
  EXPECT_THROW(OpenPoseOutput("udp://127.0.0.1"), std::runtime_error);
}

}  // namespace
}  // namespace rotslam
