#include "output/atomic_file.h"

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

TEST(ReplaceFile, LeavesTheContentAndNothingElse) {
  const TemporaryFolder folder;
  ReplaceFile(folder.path() / "a.txt", "first");
  ReplaceFile(folder.path() / "a.txt", "second");
  EXPECT_EQ(ReadWholeFile(folder.path() / "a.txt"), "second");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "a.txt.tmp"));
}

TEST(ReplaceFile, TakesNoContent) {
  const TemporaryFolder folder;
  ReplaceFile(folder.path() / "a.txt", std::string_view());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path() / "a.txt"));
}

TEST(ReplaceFile, KeepsTheOldFileWhenWritingFails) {
  const TemporaryFolder folder;
  const auto path = folder.Write("a.txt", "old");
  EXPECT_THROW(ReplaceFile(path,
                           [&](const std::filesystem::path& temporary) {
                             ReplaceFile(temporary, "half");
                             throw std::runtime_error("disk full");
                           }),
               std::runtime_error);
  EXPECT_EQ(ReadWholeFile(path), "old");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "a.txt.tmp"));
}

TEST(ReplaceFile, NamesTheFileAndTheReason) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "missing" / "a.txt";
  const std::string message = RuntimeErrorOf([&] { ReplaceFile(path, "text"); });
  EXPECT_THAT(message, testing::HasSubstr(path.string()));
  EXPECT_THAT(message, testing::HasSubstr("No such file or directory"));
}

TEST(ReplaceFile, ReportsAFullDisk) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "needs /dev/full";
  const TemporaryFolder folder;
  std::filesystem::create_symlink("/dev/full", folder.path() / "a.txt.tmp");
  const std::string message =
      RuntimeErrorOf([&] { ReplaceFile(folder.path() / "a.txt", std::string(1 << 16, 'x')); });
  EXPECT_THAT(message, testing::HasSubstr("No space left"));
}

TEST(RemoveTemporaryFiles, LeavesNoHalfOfAFile) {
  const TemporaryFolder folder;
  const auto path = folder.Write("a.txt", "old");
  EXPECT_EXIT(ReplaceFile(path,
                          [&](const std::filesystem::path& temporary) {
                            std::ofstream(temporary) << "half";
                            RemoveTemporaryFiles();
                            _exit(7);
                          }),
              testing::ExitedWithCode(7),
              "");
  EXPECT_EQ(ReadWholeFile(path), "old");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "a.txt.tmp"));
}

}  // namespace
}  // namespace rotslam
