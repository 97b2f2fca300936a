#include "rotodom/sequence/bag/bag_reader.h"

#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "rotodom/sequence/image_list.h"
#include "tests/rotodom/sequence/bag/bag_writer.h"
#include "tests/rotodom/sequence/scratch_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

bool EveryTopic(const BagTopic&) { return true; }

// Two topics whose messages are recorded out of order and across chunks.
TestBag TwoTopics() {
  TestBag bag;
  bag.topics = {{"/cam0/image_raw", "sensor_msgs/Image", ""}, {"/imu", "sensor_msgs/Imu", ""}};
  bag.messages = {{0, 2'000'000'001, "second"},
                  {1, 1'000'000'000, "first"},
                  {0, 4'000'000'000, std::string(5000, 'x')},
                  {1, 3'999'999'999, "third"},
                  {0, 5'000'000'000, ""}};
  return bag;
}

class BagReaderTest : public ScratchFolderTest {
 protected:
  static std::vector<std::string> Messages(BagReader& reader) {
    std::vector<std::string> messages;
    for (const BagEntry& entry : reader.entries()) messages.push_back(reader.Read(entry));
    return messages;
  }

  static std::string Refusal(const fs::path& path) {
    try {
      OpenBag(path, EveryTopic);
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), Not(HasSubstr("\n")));
      return error.what();
    }
    return "read";
  }

  static void ExpectTwoTopics(BagReader& reader, const std::string& encoding) {
    ASSERT_EQ(reader.topics().size(), 2U);
    std::size_t camera = reader.topics()[0].name == "/imu" ? 1 : 0;
    EXPECT_EQ(reader.topics()[camera].name, "/cam0/image_raw");
    EXPECT_EQ(reader.topics()[camera].type, "sensor_msgs/Image");
    EXPECT_EQ(reader.topics()[camera].encoding, encoding);
    EXPECT_EQ(reader.topics()[camera].count, 3);
    EXPECT_EQ(reader.topics()[1 - camera].count, 2);
    EXPECT_THAT(Messages(reader),
                ElementsAre("first", "second", "third", std::string(5000, 'x'), ""));
    EXPECT_EQ(reader.entries()[1].time_ns, 2'000'000'001);
    EXPECT_EQ(reader.entries()[2].time_ns, 3'999'999'999);
    EXPECT_EQ(std::string(reader.entries()[1].head.data()), "second");
    EXPECT_THAT(reader.notes(), IsEmpty());
  }
};

TEST_F(BagReaderTest, ReadsRos1BagsOfEveryCompression) {
  for (const char* compression : {"none", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    if (!CanCompress(compression)) continue;
    for (const std::size_t count : {1, 2, 5}) {
      const auto file =
          WriteText("a.bag", Ros1BagBytes(TwoTopics(), {compression, count, count != 2}));
      ExpectTwoTopics(*OpenBag(file, EveryTopic), "ros1");
    }
  }
}

TEST_F(BagReaderTest, ReadsMcapFilesOfEveryCompression) {
  for (const char* compression : {"none", "lz4", "zstd"}) {
    SCOPED_TRACE(compression);
    if (!CanCompress(compression)) continue;
    for (const std::size_t count : {0, 1, 2, 5}) {
      const auto file = WriteText("a.mcap", McapBytes(TwoTopics(), {compression, count, true}));
      ExpectTwoTopics(*OpenBag(file, EveryTopic), "cdr");
    }
  }
}

TEST_F(BagReaderTest, ReadsSqliteBagsAndLeavesNothingBesideThem) {
  WriteSqliteBag(folder_ / "a #1?.db3", TwoTopics());
  ExpectTwoTopics(*OpenBag(folder_ / "a #1?.db3", EveryTopic), "cdr");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(BagReaderTest, ReadsMessagesThatWereCompressedOneByOne) {
  if (!CanCompress("zstd")) GTEST_SKIP() << "built without zstd";
  TestBag bag = TwoTopics();
  for (TestMessage& message : bag.messages) message.bytes = Compressed("zstd", message.bytes);
  WriteSqliteBag(folder_ / "a.db3", bag);
  ExpectTwoTopics(*OpenBag(folder_ / "a.db3", EveryTopic), "cdr");
}

TEST_F(BagReaderTest, KeepsEntriesOfWantedTopicsOnly) {
  const auto file = WriteText("a.mcap", McapBytes(TwoTopics()));
  const auto reader = OpenBag(file, [](const BagTopic& topic) { return topic.name == "/imu"; });
  EXPECT_THAT(Messages(*reader), ElementsAre("first", "third"));
  EXPECT_EQ(reader->topics()[0].count, 3);
}

TEST_F(BagReaderTest, JoinsTheFilesOfAFolder) {
  TestBag first = TwoTopics();
  TestBag second = first;
  std::swap(second.topics[0], second.topics[1]);
  second.messages = {{1, 6'000'000'000, "late"}, {0, 500, "early"}};
  const auto expect = [&](const fs::path& folder) {
    const auto reader = OpenBag(folder, EveryTopic);
    ASSERT_EQ(reader->topics().size(), 2U);
    EXPECT_EQ(reader->topics()[0].count + reader->topics()[1].count, 7);
    EXPECT_THAT(
        Messages(*reader),
        ElementsAre("early", "first", "second", "third", std::string(5000, 'x'), "", "late"));
  };
  WriteText("ros2/metadata.yaml", "rosbag2_bagfile_information:\n");
  WriteSqliteBag(folder_ / "ros2/walk_0.db3", first);
  WriteSqliteBag(folder_ / "ros2/walk_1.db3", second);
  expect(folder_ / "ros2");
  WriteText("ros1/walk_2026-01-01-10-00-00_0.bag", Ros1BagBytes(first));
  WriteText("ros1/walk_2026-01-01-10-05-00_1.bag", Ros1BagBytes(second));
  expect(folder_ / "ros1");
  WriteText("other/walk.bag", Ros1BagBytes(first));
  WriteText("other/kitchen.bag", Ros1BagBytes(second));
  EXPECT_THAT(Refusal(folder_ / "other"),
              AllOf(HasSubstr("kitchen.bag and walk.bag"), HasSubstr("give the path of one")));
}

TEST_F(BagReaderTest, ReadsWhatIsBeforeTheEndOfACutFile) {
  for (const bool is_ros1 : {true, false}) {
    SCOPED_TRACE(is_ros1);
    const std::string whole = is_ros1 ? Ros1BagBytes(TwoTopics(), {"none", 1, false})
                                      : McapBytes(TwoTopics(), {"none", 1, false});
    // In the middle of the long message.
    const auto file = WriteText("a", whole.substr(0, whole.find("xxxx") + 2000));
    const auto reader = OpenBag(file, EveryTopic);
    EXPECT_THAT(Messages(*reader), ElementsAre("first", "second"));
    ASSERT_EQ(reader->notes().size(), 1U);
    EXPECT_THAT(reader->notes()[0], HasSubstr("cut off"));
  }
}

TEST_F(BagReaderTest, LeavesDamagedChunksOutAndSaysSo) {
  if (!CanCompress("lz4")) GTEST_SKIP() << "built without lz4";
  const BagWriterOptions options = {"lz4", 2, true};
  TestBag bag = TwoTopics();
  for (const bool is_ros1 : {true, false}) {
    SCOPED_TRACE(is_ros1);
    std::string bytes = is_ros1 ? Ros1BagBytes(bag, options) : McapBytes(bag, options);
    const std::string magic = "\x04\x22\x4d\x18";
    const std::size_t second = bytes.find(magic, bytes.find(magic) + 1);
    bytes[second] = 'x';
    const auto reader = OpenBag(WriteText("a", bytes), EveryTopic);
    EXPECT_THAT(Messages(*reader), ElementsAre("first", "second", ""));
    ASSERT_EQ(reader->notes().size(), 1U);
    EXPECT_THAT(reader->notes()[0], HasSubstr("chunks that are left out: 1"));
  }
}

TEST_F(BagReaderTest, SaysWhatToDo) {
  EXPECT_THAT(Refusal(folder_ / "no.bag"), StartsWith((folder_ / "no.bag").string() + ": "));
  EXPECT_THAT(Refusal(WriteText("a.bag", "")), HasSubstr("is empty"));
  EXPECT_THAT(Refusal(WriteText("a.bag", "#ROSBAG V1.2\n")), HasSubstr("rosbag migrate"));
  EXPECT_THAT(Refusal(WriteText("a.bag", "hello")), HasSubstr("does not begin as a recording"));
  EXPECT_THAT(Refusal(WriteText("a.db3.zstd", "hello")), HasSubstr("unzstd"));
  EXPECT_THAT(Refusal(WriteText("a.mcap", "\x89MCAP1\r\n")), HasSubstr("version 0"));
  EXPECT_THAT(Refusal(WriteText("a.bag", "#ROSBAG V2.0\n")), HasSubstr("nothing can be read"));
  std::string encrypted = Ros1BagBytes(TwoTopics());
  encrypted.replace(encrypted.find("conn_count="), 10, "encryptor=");
  EXPECT_THAT(Refusal(WriteText("a.bag", encrypted)), HasSubstr("rosbag decrypt"));
  sqlite3* database = nullptr;
  sqlite3_open((folder_ / "colmap.db3").c_str(), &database);
  sqlite3_exec(database, "CREATE TABLE images(id INTEGER)", nullptr, nullptr, nullptr);
  sqlite3_close(database);
  EXPECT_THAT(Refusal(folder_ / "colmap.db3"), HasSubstr("no ROS 2 bag"));
}

TEST_F(BagReaderTest, TakesNoMemoryForLengthsThatCannotBe) {
  TestBag bag = TwoTopics();
  // A chunk that claims 4 GiB when it is decompressed.
  if (CanCompress("lz4")) {
    std::string bytes = Ros1BagBytes(bag, {"lz4", 5, false});
    bytes.replace(bytes.find("size=") + 5, 4, "\xff\xff\xff\xff");
    EXPECT_THAT(Refusal(WriteText("a.bag", bytes)), HasSubstr("nothing can be read"));
  }
}

TEST(InputReference, CutsTheTopicOffPathsThatDoNotExist) {
  const fs::path folder = fs::path(testing::TempDir()) / "rotslam_bag_reference";
  fs::create_directories(folder / "colon:name");
  std::ofstream(folder / "walk.bag") << "x";
  std::ofstream(folder / "odd:/cam0.bag") << "x";
  const auto parse = [&](const std::string& text) { return ParseInputReference(folder / text); };
  EXPECT_EQ(parse("walk.bag:/cam0/image_raw").file, folder / "walk.bag");
  EXPECT_EQ(parse("walk.bag:/cam0/image_raw").part, "/cam0/image_raw");
  EXPECT_EQ(parse("walk.bag:cam0").part, "cam0");
  EXPECT_EQ(parse("walk.bag").part, "");
  EXPECT_EQ(parse("colon:name").file, folder / "colon:name");
  EXPECT_EQ(parse("gone.bag:/cam0").file, folder / "gone.bag:/cam0");
  fs::remove_all(folder);
}

}  // namespace
}  // namespace rotslam
