#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/input/input.h"
#include "apps/cli/input/pipeline.h"
#include "apps/cli/terminal/progress.h"
#include "output/files/journal.h"
#include "rotodom/loop/frame_record.h"
#include "rotodom/loop/looped_odometry.h"

namespace rotslam {

struct CheckpointFlags {
  int every = 500;  // frames between two checkpoints; 0: none
  bool resume = false;
};

void AddCheckpointFlags(CLI::App& command, CheckpointFlags& flags);
/// Without --resume.
void AddCheckpointEveryFlag(CLI::App& command, CheckpointFlags& flags);

/// What orientations depend on, by name: a run goes on from a checkpoint where all of it is the
/// same.
using RunIdentity = std::vector<std::pair<std::string, std::string>>;
RunIdentity IdentityOf(const std::string& command,
                       const Input& input,
                       const InputFlags& flags,
                       const PipelineOptions& options,
                       std::uint64_t seed);

/// One frame as it was found, without its image.
struct RecordedFrame {
  Frame frame;
  FrameRecord record;
  SeenPoints points;  // empty where nobody needs them any more

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(frame.id, frame.timestamp_s, frame.name, frame.problem, record, points);
  }
};

/// What a run needs to go on after it was killed: two files in UnfinishedFolder(), which is there
/// from the first checkpoint until Remove().
///   frames.bin  a journal with a record per frame, which grows as they come
///   state.bin   the run's identity, which part of the journal counts, and the odometry's state
///               after it; replaced as a whole, so that one that can be used is always there
/// When the disk refuses, the run goes on without checkpoints; the last one stays.
class Checkpoint {
 public:
  /// With flags.resume, opens what an interrupted run has left, or says that there is nothing;
  /// throws std::runtime_error when that is damaged or of another run.
  Checkpoint(const std::filesystem::path& run,
             const CheckpointFlags& flags,
             RunIdentity identity,
             Progress& progress);
  /// Leaves no folder without a checkpoint in it.
  ~Checkpoint();
  Checkpoint(const Checkpoint&) = delete;
  Checkpoint& operator=(const Checkpoint&) = delete;

  /// The frames of the interrupted run, one by one; nullopt after the last. Throws
  /// std::runtime_error when the journal is damaged.
  std::optional<RecordedFrame> NextRecorded();
  /// Gives the odometry the state that it had after them.
  void Restore(LoopedOdometry& odometry) const;

  /// What the frames have told of the camera's readout before they were read once more with it.
  const std::optional<ReadoutEstimate>& readout() const { return readout_; }
  /// Forgets all frames: they are read once more.
  void StartOver(const ReadoutEstimate& readout);

  bool IsOn() const { return writer_ != nullptr; }
  void Append(RecordedFrame& frame);
  bool IsDue() const;
  /// @param state  the odometry's, after the frame appended last.
  void Commit(std::string state);

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
  std::string state_;
  std::optional<ReadoutEstimate> readout_;
  std::unique_ptr<JournalReader> reader_;  // null: nothing to read
  std::unique_ptr<JournalWriter> writer_;  // null: no checkpoints
};

}  // namespace rotslam
