#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/cli/input/input.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/terminal/progress.h"
#include "apps/slam/input/frame_log.h"
#include "output/files/journal.h"

namespace rotslam {

struct CheckpointFlags {
  int every = 500;  // frames between two checkpoints; 0: none
  bool resume = false;
};

void AddCheckpointFlags(CLI::App& command, CheckpointFlags& flags);
/// Without --resume.
void AddCheckpointEveryFlag(CLI::App& command, CheckpointFlags& flags);

/// Everything that orientations depend on, by name. A run goes on from a checkpoint only if all of
/// it is the same.
using RunIdentity = std::vector<std::pair<std::string, std::string>>;
RunIdentity IdentityOf(const std::string& command,
                       const Input& input,
                       const InputFlags& flags,
                       const RunOptions& options,
                       std::uint64_t seed);

/// Two files from which a killed run goes on. They are in UnfinishedFolder() from the first
/// checkpoint until Remove().
///   frames.bin  a journal with a record per frame, which grows as they come
///   state.bin   the run's identity, which part of the journal counts, and the odometry's state
///               after it; replaced as a whole, so that one that can be used is always there
/// When writing fails, the run goes on without checkpoints; the last one stays.
class Checkpoint : public FrameLog {
 public:
  /// With flags.resume, opens what an interrupted run has left, or says that there is nothing;
  /// throws std::runtime_error when that is damaged or of another run.
  Checkpoint(const std::filesystem::path& run,
             const CheckpointFlags& flags,
             RunIdentity identity,
             Progress& progress);
  /// Leaves no folder without a checkpoint in it.
  ~Checkpoint() override;
  Checkpoint(const Checkpoint&) = delete;
  Checkpoint& operator=(const Checkpoint&) = delete;

  std::optional<RecordedFrame> NextRecorded() override;
  void Restore(const std::function<void(const TrackingState&)>& restore) const override;
  const FoundInImages& found() const override { return found_; }
  void StartOver(const FoundInImages& found) override;
  bool IsOn() const override { return writer_ != nullptr; }
  void Append(RecordedFrame& frame) override;
  bool IsDue() const override;
  void Commit(TrackingState state) override;

  /// The run is complete.
  void Remove();

 private:
  void Open(const RunIdentity& identity);
  void StartWriting();
  void GiveUp(const std::string& reason);
  [[noreturn]] static void Refuse(const std::string& reason);

  std::filesystem::path folder_;
  int every_;
  RunIdentity identity_;
  Progress& progress_;
  JournalExtent committed_;
  TrackingState state_;
  FoundInImages found_;
  std::unique_ptr<JournalReader> reader_;  // null: nothing to read
  std::unique_ptr<JournalWriter> writer_;  // null: no checkpoints
};

}  // namespace rotslam
