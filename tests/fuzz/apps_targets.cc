// What the commands read besides: options, lists of sequences, records of a batch, EXIF data, what
// an interrupted run has left.

#include <cstring>

#include "apps/batch/list.h"
#include "apps/batch/record.h"
#include "apps/cli/input/config.h"
#include "apps/cli/input/lens_guess.h"
#include "apps/cli/input/run_options.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/cli/run_directory/unfinished.h"
#include "apps/simulation/paths.h"
#include "rotodom/loop/looped_odometry.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

const RegisterFuzzTarget config("config",
                                [](std::string_view bytes, const TemporaryFolder& folder) {
                                  RunOptions options;
                                  LoadOptionsYaml(folder.Write("options.yaml", std::string(bytes)),
                                                  options);
                                });

const RegisterFuzzTarget batch_list("batch_list",
                                    [](std::string_view bytes, const TemporaryFolder& folder) {
                                      for (const BatchEntry& entry : ReadBatchList(
                                               folder.Write("batch.yaml", std::string(bytes)),
                                               "")) {
                                        RequestOf(entry, 1);
                                      }
                                    });

const RegisterFuzzTarget batch_record("batch_record",
                                      [](std::string_view bytes, const TemporaryFolder& folder) {
                                        const std::vector<std::string> files =
                                            CutIntoFiles(bytes, 3);
                                        folder.Write("batch.json", files[0]);
                                        folder.Write("summary.json", files[1]);
                                        LastErrorLine(folder.Write("log.txt", files[2]));
                                        const std::optional<BatchRecord> record =
                                            ReadRecord(folder.path());
                                        if (!record) return;
                                        ResultOf({}, folder.path(), record->request, 1);
                                      });

const RegisterFuzzTarget exif("exif", [](std::string_view bytes, const TemporaryFolder& folder) {
  FilmFocalLength(folder.Write("image.jpg", std::string(bytes)));
  FilmFocalLength(
      std::map<std::string, std::string>{{"focal_length.35mm_equivalent", std::string(bytes)}});
});

const RegisterFuzzTarget kitti_poses("kitti_poses",
                                     [](std::string_view bytes, const TemporaryFolder& folder) {
                                       ReadKittiPoses(
                                           folder.Write("poses.txt", std::string(bytes)));
                                     });

// What an interrupted run of a few small frames has left.
class InterruptedRun {
 public:
  explicit InterruptedRun(const fs::path& run) : run_(run) {
    fs::remove_all(UnfinishedFolder(run));
    LoopedOdometry odometry = Odometry();
    Checkpoint checkpoint(run, {1, false}, kIdentity, progress_);
    for (int k = 0; k < 4; ++k) {
      cv::Mat noise(48, 64, CV_8UC1);
      cv::RNG(1).fill(noise, cv::RNG::UNIFORM, 0, 256);
      RecordedFrame recorded;
      recorded.frame.id = FrameId{k};
      recorded.frame.name = std::to_string(k) + ".png";
      odometry.AddFrame(FrameId{k}, 0.1 * k, noise, &recorded.record);
      ArchiveWriter archive;
      archive(recorded);
      record_ = archive.TakeBytes();
      checkpoint.Append(recorded);
    }
    checkpoint.Commit({odometry.SaveState(), ""});
    state_ = ReadWholeFile(UnfinishedFolder(run) / "state.bin");
  }

  const std::string& state() const { return state_; }
  /// The last frame's.
  const std::string& record() const { return record_; }

  void Resume() {
    Checkpoint checkpoint(run_, {0, true}, kIdentity, progress_);
    while (checkpoint.NextRecorded()) continue;
    LoopedOdometry odometry = Odometry();
    checkpoint.Restore([&](const TrackingState& state) { odometry.RestoreState(state.odometry); });
  }

 private:
  static inline const RunIdentity kIdentity = {{"rotslam", "1"}, {"the seed", "1"}};

  static CommonFlags Quiet() {
    CommonFlags flags;
    flags.quiet = true;
    return flags;
  }

  static LoopedOdometry Odometry() {
    Camera small;
    small.width = 64;
    small.height = 48;
    small.fx = small.fy = 60.0;
    small.cx = 31.5;
    small.cy = 23.5;
    OdometryOptions options;
    options.features.max_features = 50;
    LoopOptions no_loops;
    no_loops.use_loops = false;
    return LoopedOdometry(small, {options, no_loops});
  }

  fs::path run_;
  Progress progress_{Quiet()};
  std::string state_;
  std::string record_;
};

InterruptedRun& RunIn(const TemporaryFolder& folder) {
  static std::map<fs::path, InterruptedRun> runs;
  return runs.try_emplace(folder.path(), folder.path() / "interrupted").first->second;
}

// The checksum is right: without, nothing behind it is ever reached.
const RegisterFuzzTarget checkpoint("checkpoint",
                                    [](std::string_view bytes, const TemporaryFolder& folder) {
                                      InterruptedRun& run = RunIn(folder);
                                      std::string state = Damaged(run.state(), bytes);
                                      const std::size_t at = state.find('\n') + 1;
                                      if (at > 0 && state.size() >= at + sizeof(std::uint64_t)) {
                                        const std::uint64_t sum = Checksum(
                                            std::string_view(state).substr(at + sizeof(sum)));
                                        std::memcpy(state.data() + at, &sum, sizeof(sum));
                                      }
                                      folder.Write("interrupted/unfinished/state.bin", state);
                                      run.Resume();
                                    });

const RegisterFuzzTarget recorded_frame(
    "recorded_frame", [](std::string_view bytes, const TemporaryFolder& folder) {
      const std::string record = Damaged(RunIn(folder).record(), bytes);
      ArchiveReader archive(record);
      RecordedFrame frame;
      try {
        archive(frame);
        archive.ExpectEnd();
      } catch (const std::runtime_error& error) {
        // The checkpoint says which file it is of.
        throw std::runtime_error(folder.path().string() + ": " + error.what());
      }
    });

}  // namespace
}  // namespace rotslam
