#include "output/files/atomic_file.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
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

TEST(ReplaceFile, ReportsThatTheDiskTakesNoMore) {
  const TemporaryFolder folder;
  const auto path = folder.Write("a.txt", "old");
  // A limit to the length of files shows as an error of write, as a full disk does.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{4096, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string message = RuntimeErrorOf([&] { ReplaceFile(path, std::string(1 << 16, 'x')); });
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(message,
              testing::AllOf(testing::StartsWith(path.string()),
                             testing::HasSubstr("cannot write the file: File too large")));
  EXPECT_EQ(ReadWholeFile(path), "old");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "a.txt.tmp"));
}

TEST(ReplaceFile, WritesThroughNoLink) {
  const TemporaryFolder folder;
  const auto elsewhere = folder.Write("elsewhere", "not ours");
  for (const char* name : {"a.txt", "a.txt.tmp"}) {
    std::filesystem::create_symlink(elsewhere, folder.path() / name);
  }
  ReplaceFile(folder.path() / "a.txt", "ours");
  EXPECT_EQ(ReadWholeFile(elsewhere), "not ours");
  EXPECT_EQ(ReadWholeFile(folder.path() / "a.txt"), "ours");
  EXPECT_FALSE(std::filesystem::is_symlink(folder.path() / "a.txt"));
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
