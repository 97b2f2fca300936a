#include "apps/cli/run_directory/unfinished.h"

#include <fstream>
#include <map>
#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// What is in a folder, by path.
using Tree = std::map<std::string, std::string>;

Tree ReadTree(const fs::path& folder) {
  Tree tree;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_directory()) continue;
    tree[fs::relative(entry.path(), folder).string()] = ReadWholeFile(entry.path());
  }
  return tree;
}

class Outputs : public testing::Test {
 protected:
  void SetUp() override {
    for (const auto& [name, content] : kOld) folder_.Write(name, content);
  }

  static void Write(const UnfinishedOutputs& outputs) {
    for (const auto& [name, content] : kNew) {
      std::ofstream(outputs.folder() / name) << content;
    }
  }

  fs::path run() const { return folder_.path(); }

  // Of a longer run; the user has a file of his own.
  static inline const Tree kOld = {{"rotations.csv", "old rotations"},
                                   {"trajectory_tum.txt", "old trajectory"},
                                   {"report.html", "old report"},
                                   {"summary.json", "old summary"},
                                   {"notes.txt", "notes"}};
  static inline const Tree kNew = {{"loops.csv", "new loops"},
                                   {"rotations.csv", "new rotations"},
                                   {"summary.json", "new summary"}};
  static inline const Tree kPublished = {{"loops.csv", "new loops"},
                                         {"rotations.csv", "new rotations"},
                                         {"summary.json", "new summary"},
                                         {"notes.txt", "notes"}};

  const TemporaryFolder folder_;
};

TEST_F(Outputs, TakeThePlaceOfTheOldOnesAllTogether) {
  const UnfinishedOutputs outputs(run());
  Write(outputs);
  for (const auto& [name, content] : kOld) EXPECT_EQ(ReadWholeFile(run() / name), content);
  outputs.Publish();
  EXPECT_EQ(ReadTree(run()), kPublished);
  EXPECT_FALSE(fs::exists(UnfinishedFolder(run())));
}

TEST_F(Outputs, LeaveACheckpoint) {
  const UnfinishedOutputs outputs(run());
  Write(outputs);
  std::ofstream(UnfinishedFolder(run()) / "state.bin") << "state";
  outputs.Publish();
  Tree expected = kPublished;
  expected["unfinished/state.bin"] = "state";
  EXPECT_EQ(ReadTree(run()), expected);
  ClearUnfinishedOutputs(run());
  EXPECT_EQ(ReadTree(run()), expected);
}

TEST_F(Outputs, WhatIsNotCompleteIsRemoved) {
  {
    const UnfinishedOutputs outputs(run());
    Write(outputs);
    fs::remove(outputs.folder() / "summary.json");
    std::ofstream(outputs.folder() / "map.bin.tmp") << "half";
  }
  ClearUnfinishedOutputs(run());
  EXPECT_EQ(ReadTree(run()), kOld);
  EXPECT_FALSE(fs::exists(UnfinishedFolder(run())));
}

// Each step of the publication, done by hand, is one that the program may not have survived.
TEST_F(Outputs, WhatIsCompleteIsPublishedByTheNextRun) {
  for (int num_steps = 0; num_steps <= 6; ++num_steps) {
    SCOPED_TRACE(num_steps);
    fs::remove_all(run() / "loops.csv");
    SetUp();
    const fs::path moving = UnfinishedFolder(run()) / "moving";
    {
      const UnfinishedOutputs outputs(run());
      Write(outputs);
      if (num_steps > 0) fs::remove(run() / "summary.json");
      if (num_steps > 1) fs::remove(run() / "report.html");
      if (num_steps > 2) {
        fs::remove(run() / "trajectory_tum.txt");
        fs::rename(outputs.folder(), moving);
      }
    }
    if (num_steps > 3) fs::rename(moving / "loops.csv", run() / "loops.csv");
    if (num_steps > 4) fs::rename(moving / "rotations.csv", run() / "rotations.csv");
    if (num_steps > 5) fs::rename(moving / "summary.json", run() / "summary.json");
    ClearUnfinishedOutputs(run());
    EXPECT_EQ(ReadTree(run()), kPublished);
    EXPECT_FALSE(fs::exists(UnfinishedFolder(run())));
  }
}

TEST_F(Outputs, NothingThereNothingToDo) {
  ClearUnfinishedOutputs(run());
  EXPECT_EQ(ReadTree(run()), kOld);
}

TEST_F(Outputs, NamesTheFolderThatCannotBeMade) {
  folder_.Write("unfinished", "a file");
  const std::string message = RuntimeErrorOf([&] { UnfinishedOutputs{run()}; });
  EXPECT_THAT(message, testing::HasSubstr((UnfinishedFolder(run()) / "outputs").string()));
}

}  // namespace
}  // namespace rotslam
