#include "output/files/journal.h"

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

const std::vector<std::string> kRecords = {"first", "", std::string("a\0b", 3), "last one"};

class Journal : public testing::Test {
 protected:
  void SetUp() override {
    JournalWriter writer(path_, {});
    for (const std::string& record : kRecords) writer.Append(record);
    writer.Sync();
    extent_ = writer.extent();
  }

  std::vector<std::string> ReadAll(const JournalExtent& extent) const {
    JournalReader reader(path_, extent);
    std::vector<std::string> records;
    while (const std::optional<std::string> record = reader.Next()) records.push_back(*record);
    return records;
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_.path() / "journal";
  JournalExtent extent_;
};

TEST_F(Journal, GivesBackItsRecords) {
  EXPECT_THAT(ReadAll(extent_), ElementsAreArray(kRecords));
  EXPECT_EQ(extent_.num_bytes, std::filesystem::file_size(path_));
}

TEST_F(Journal, WhatIsBehindTheExtentDoesNotCount) {
  {
    JournalWriter writer(path_, extent_);
    writer.Append("more");
  }
  EXPECT_THAT(ReadAll(extent_), ElementsAreArray(kRecords));
}

TEST_F(Journal, GoesOnBehindTheExtent) {
  JournalExtent longer;
  {
    JournalWriter writer(path_, extent_);
    writer.Append("never counted");
  }
  {
    JournalWriter writer(path_, extent_);
    writer.Append("more");
    longer = writer.extent();
  }
  std::vector<std::string> records = kRecords;
  records.push_back("more");
  EXPECT_THAT(ReadAll(longer), ElementsAreArray(records));
  EXPECT_EQ(longer.num_bytes, std::filesystem::file_size(path_));
}

TEST_F(Journal, EveryDamagedByteIsNoticed) {
  const std::string whole = ReadWholeFile(path_);
  for (std::size_t k = 0; k < whole.size(); ++k) {
    std::string damaged = whole;
    damaged[k] = static_cast<char>(damaged[k] ^ 0x40);
    folder_.Write("journal", damaged);
    const std::string message = RuntimeErrorOf([&] { ReadAll(extent_); });
    EXPECT_THAT(message, HasSubstr(path_.string())) << k;
    EXPECT_THAT(message, HasSubstr("damaged")) << k;
  }
}

TEST_F(Journal, EveryMissingByteIsNoticed) {
  const std::string whole = ReadWholeFile(path_);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    folder_.Write("journal", whole.substr(0, size));
    EXPECT_THAT(RuntimeErrorOf([&] { ReadAll(extent_); }), HasSubstr("cut short")) << size;
  }
}

TEST_F(Journal, RecordsOfAnotherJournalAreNoticed) {
  JournalWriter writer(path_, {});
  for (const std::string& record : kRecords) writer.Append(record == "first" ? "third" : record);
  EXPECT_EQ(writer.extent().num_bytes, extent_.num_bytes);
  EXPECT_THAT(RuntimeErrorOf([&] { ReadAll(extent_); }), HasSubstr("damaged"));
}

TEST_F(Journal, NamesTheFileAndTheReason) {
  const std::filesystem::path missing = folder_.path() / "missing" / "journal";
  const std::string unwritable = RuntimeErrorOf([&] { JournalWriter(missing, {}); });
  EXPECT_THAT(unwritable, HasSubstr(missing.string()));
  EXPECT_THAT(unwritable, HasSubstr("No such file or directory"));
  EXPECT_THAT(RuntimeErrorOf([&] { JournalReader(missing, {}); }), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace rotslam
