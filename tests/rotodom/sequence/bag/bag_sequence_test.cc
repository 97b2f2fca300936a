#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/sequence/sequence.h"
#include "tests/rotodom/sequence/bag/bag_writer.h"
#include "tests/rotodom/sequence/scratch_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr std::int64_t kStart = 1'700'000'000'000'000'000;
constexpr std::int64_t kStep = 50'000'000;

// A grey picture of 4 x 3 pixels of the value `number`.
std::string Picture(std::int64_t stamp_ns, int number, Serialisation how) {
  TestRosImage image;
  image.stamp_ns = stamp_ns;
  image.width = image.step = 4;
  image.height = 3;
  image.encoding = "mono8";
  image.data.assign(12, static_cast<char>(number));
  return RosImageMessage(how, image);
}

RosCameraInfo Info() {
  RosCameraInfo info;
  info.width = 4;
  info.height = 3;
  info.distortion_model = "plumb_bob";
  info.D = {-0.25, 0.125, 0.001, -0.002, 0.03};
  info.K = {5, 0, 1.5, 0, 6, 1, 0, 0, 1};
  info.P = {4.5, 0, 1.25, 0, 0, 5.5, 1.125, 0, 0, 0, 1, 0};
  return info;
}

// `stamps_ns` of six frames 0.05 s apart, recorded 7 ms late.
TestBag Frames(const std::vector<std::int64_t>& stamps_ns,
               const std::string& topic = "/cam0/image_raw",
               Serialisation how = Serialisation::kCdrLittle) {
  TestBag bag;
  bag.topics = {{topic, "sensor_msgs/Image", ""},
                {"/cam0/camera_info", "sensor_msgs/CameraInfo", ""},
                {"/imu", "sensor_msgs/Imu", ""}};
  for (std::size_t k = 0; k < stamps_ns.size(); ++k) {
    const auto number = static_cast<int>(k);
    const std::int64_t recorded = kStart + number * kStep + 7'000'000;
    bag.messages.push_back({0, recorded, Picture(stamps_ns[k], number, how)});
    bag.messages.push_back({1, recorded, RosCameraInfoMessage(how, Info())});
    bag.messages.push_back({2, recorded, "imu"});
  }
  return bag;
}

std::vector<std::int64_t> Stamps() {
  std::vector<std::int64_t> stamps;
  for (int k = 0; k < 6; ++k) stamps.push_back(kStart + k * kStep);
  return stamps;
}

class BagSequenceTest : public ScratchFolderTest {
 protected:
  std::unique_ptr<Sequence> Open(const TestBag& bag, const SequenceOptions& options = {}) const {
    return OpenSequence(WriteText("a.mcap", McapBytes(bag)), options);
  }

  // The values of the frames that are left.
  static std::vector<int> Rest(Sequence& sequence) {
    std::vector<int> values;
    while (const auto frame = sequence.Next()) {
      values.push_back(frame->image.empty() ? -1 : frame->image.at<std::uint8_t>(2, 3));
    }
    return values;
  }

  static std::string Refusal(const fs::path& path, const SequenceOptions& options = {}) {
    try {
      OpenSequence(path, options);
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), Not(HasSubstr("\n")));
      return error.what();
    }
    return "read";
  }
  std::string Refusal(const TestBag& bag) const {
    return Refusal(WriteText("a.mcap", McapBytes(bag)));
  }
};

TEST_F(BagSequenceTest, ReadsFramesTimesAndCameraOfEveryContainer) {
  const auto ros1 =
      WriteText("a.bag", Ros1BagBytes(Frames(Stamps(), "/cam0/image_raw", Serialisation::kRos1)));
  const auto mcap =
      WriteText("a.mcap", McapBytes(Frames(Stamps(), "/cam0/image_raw", Serialisation::kCdrBig)));
  WriteSqliteBag(folder_ / "a.db3", Frames(Stamps()));
  for (const fs::path& file : {ros1, mcap, folder_ / "a.db3"}) {
    SCOPED_TRACE(file);
    const auto sequence = OpenSequence(file, {});
    EXPECT_EQ(sequence->NumFrames(), 6);
    EXPECT_EQ(sequence->image_size(), cv::Size(4, 3));
    EXPECT_EQ(sequence->form(), "ROS bag, topic /cam0/image_raw");
    EXPECT_EQ(sequence->times_source(), "stamps in the message headers");
    EXPECT_FALSE(sequence->times_are_made_up());
    EXPECT_THAT(sequence->Files(), ElementsAre(file));
    ASSERT_TRUE(sequence->own_camera());
    const Camera& camera = *sequence->own_camera();
    EXPECT_EQ(camera.model, CameraModel::kRadtan);
    EXPECT_EQ(camera.width, 4);
    EXPECT_EQ(camera.fx, 5);
    EXPECT_EQ(camera.fy, 6);
    EXPECT_EQ(camera.cx, 1.5);
    EXPECT_EQ(camera.cy, 1);
    EXPECT_THAT(camera.distortion, ElementsAre(-0.25, 0.125, 0.001, -0.002, 0.03, 0, 0, 0));
    EXPECT_DOUBLE_EQ(sequence->timestamps_s()[3], 1'700'000'000.15);
    const auto first = sequence->Next();
    ASSERT_TRUE(first);
    EXPECT_EQ(first->name, "1700000000000000000");
    EXPECT_EQ(first->problem, "");
    sequence->Skip(2);
    EXPECT_THAT(Rest(*sequence), ElementsAre(3, 4, 5));
  }
}

TEST_F(BagSequenceTest, TakesFirstLastAndStride) {
  SequenceOptions options;
  options.first = 1;
  options.last = 4;
  options.stride = 2;
  const auto sequence = Open(Frames(Stamps()), options);
  EXPECT_EQ(sequence->NumFrames(), 2);
  EXPECT_THAT(Rest(*sequence), ElementsAre(1, 3));
  options.first = 6;
  options.last = -1;
  EXPECT_THAT(Refusal(folder_ / "a.mcap", options), HasSubstr("first frame 6 asked for"));
}

TEST_F(BagSequenceTest, TakesTheMatrixOfRectifiedImages) {
  const auto sequence = Open(Frames(Stamps(), "/cam0/image_rect_color"));
  ASSERT_TRUE(sequence->own_camera());
  EXPECT_EQ(sequence->own_camera()->model, CameraModel::kPinhole);
  EXPECT_EQ(sequence->own_camera()->fx, 4.5);
  EXPECT_EQ(sequence->own_camera()->cy, 1.125);
  EXPECT_EQ(Open(Frames(Stamps(), "/cam0/direct"))->own_camera()->fx, 5);
}

TEST_F(BagSequenceTest, SaysWhenItTakesTimesOfRecording) {
  const auto sequence = Open(Frames(std::vector<std::int64_t>(6, 0)));
  EXPECT_EQ(sequence->times_source(), "times of recording");
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("all zero: times of recording are used")));
  EXPECT_DOUBLE_EQ(sequence->timestamps_s()[1], 1'700'000'000.057);
  auto stamps = Stamps();
  stamps[3] = stamps[2];
  EXPECT_THAT(Open(Frames(stamps))->notes(), Contains(HasSubstr("have the same stamp")));
  // Far back: 20 frames, the last of which says that it is the first.
  stamps.clear();
  for (int k = 0; k < 20; ++k) stamps.push_back(kStart + k * kStep);
  stamps[19] = 5;
  EXPECT_THAT(Open(Frames(stamps))->notes(), Contains(HasSubstr("do not increase")));
}

TEST_F(BagSequenceTest, SortsFramesThatCameLate) {
  auto stamps = Stamps();
  std::swap(stamps[2], stamps[3]);
  const auto sequence = Open(Frames(stamps));
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("order of their stamps: 2")));
  EXPECT_THAT(Rest(*sequence), ElementsAre(0, 1, 3, 2, 4, 5));
}

TEST_F(BagSequenceTest, CountsCopiesOnceAndRefusesTimesThatStand) {
  TestBag bag = Frames(Stamps());
  bag.messages.push_back(bag.messages[3]);
  const auto sequence = Open(bag);
  EXPECT_EQ(sequence->NumFrames(), 6);
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("counted once: 1")));
  bag = Frames(std::vector<std::int64_t>(6, 0));
  for (TestMessage& message : bag.messages) message.time_ns = kStart;
  EXPECT_THAT(Refusal(bag), AllOf(HasSubstr("times of recording do not increase")));
}

TEST_F(BagSequenceTest, ListsTheTopicsWhenThereAreSeveral) {
  TestBag bag = Frames(Stamps());
  bag.topics.push_back({"/cam1/image_raw", "sensor_msgs/Image", ""});
  bag.messages.push_back({3, kStart, Picture(kStart, 77, Serialisation::kCdrLittle)});
  EXPECT_THAT(Refusal(bag),
              AllOf(HasSubstr("/cam0/image_raw (sensor_msgs/Image, 6)"),
                    HasSubstr("/cam1/image_raw (sensor_msgs/Image, 1)"),
                    HasSubstr("a.mcap:/cam0/image_raw")));
  const auto file = (folder_ / "a.mcap").string();
  EXPECT_THAT(Rest(*OpenSequence(file + ":/cam1/image_raw", {})), ElementsAre(77));
  EXPECT_EQ(OpenSequence(file + ":cam0/image_raw", {})->NumFrames(), 6);
  EXPECT_THAT(Refusal(file + ":/cam2"),
              AllOf(HasSubstr("has no topic /cam2"), HasSubstr("/cam1/image_raw")));
  EXPECT_THAT(Refusal(file + ":/imu"), HasSubstr("has sensor_msgs/Imu, not images"));
  // The camera of cam0 is not that of cam1.
  EXPECT_FALSE(OpenSequence(file + ":/cam1/image_raw", {})->own_camera());
}

TEST_F(BagSequenceTest, PassesOverDepthAndCompressedCopies) {
  TestBag bag = Frames(Stamps());
  bag.topics.push_back({"/depth/image", "sensor_msgs/Image", ""});
  bag.topics.push_back({"/cam0/image_raw/compressed", "sensor_msgs/CompressedImage", ""});
  TestRosImage depth;
  depth.encoding = "32FC1";
  bag.messages.push_back({3, kStart, RosImageMessage(Serialisation::kCdrLittle, depth)});
  bag.messages.push_back(
      {4, kStart, RosCompressedImageMessage(Serialisation::kCdrLittle, 1, "jpeg", "x")});
  const auto sequence = Open(bag);
  EXPECT_EQ(sequence->NumFrames(), 6);
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("/depth/image is depth (encoding '32FC1')")));
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("/cam0/image_raw/compressed is a copy")));
  EXPECT_THAT(Refusal((folder_ / "a.mcap").string() + ":/depth/image"), HasSubstr("is depth"));
}

TEST_F(BagSequenceTest, SaysWhichCalibrationItCannotUse) {
  TestBag bag = Frames(Stamps());
  RosCameraInfo other = Info();
  other.K[0] = 5.5;
  bag.messages[4].bytes = RosCameraInfoMessage(Serialisation::kCdrLittle, other);
  auto sequence = Open(bag);
  EXPECT_EQ(sequence->own_camera()->fx, 5);
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("differ from the first, which is used: 1")));
  bag.messages[1].bytes = RosCameraInfoMessage(Serialisation::kCdrLittle, {});
  sequence = Open(bag);
  EXPECT_FALSE(sequence->own_camera());
  EXPECT_THAT(sequence->notes(), Contains(HasSubstr("/cam0/camera_info is not used")));
}

TEST_F(BagSequenceTest, GivesDamagedImagesAsProblems) {
  TestBag bag = Frames(Stamps());
  bag.messages[6].bytes.resize(40);
  EXPECT_THAT(Rest(*Open(bag)), ElementsAre(0, 1, -1, 3, 4, 5));
}

TEST_F(BagSequenceTest, RefusesOtherSerialisationsAndBagsWithoutImages) {
  TestBag bag = Frames(Stamps());
  bag.topics[0].encoding = "json";
  EXPECT_THAT(Refusal(bag), HasSubstr("serialised as 'json'"));
  bag.topics[0].type = "theora_image_transport/Packet";
  EXPECT_THAT(Refusal(bag),
              AllOf(HasSubstr("has no topic of sensor_msgs/Image"),
                    HasSubstr("theora_image_transport/Packet, 6")));
}

TEST_F(BagSequenceTest, NotesAreEmptyForTopicsWithoutCameras) {
  TestBag bag = Frames(Stamps());
  std::erase_if(bag.messages, [](const TestMessage& message) { return message.topic == 1; });
  const auto sequence = Open(bag);
  EXPECT_FALSE(sequence->own_camera());
  EXPECT_THAT(sequence->notes(), IsEmpty());
}

}  // namespace
}  // namespace rotslam
