// Trajectories, orientations, pose graphs and models, our own and other people's.

#include "output/export/colmap_model.h"
#include "output/export/known_rotation_file.h"
#include "output/files/journal.h"
#include "output/graph/g2o.h"
#include "output/graph/rotation_list_file.h"
#include "output/trajectory/metrics.h"
#include "output/trajectory/orientation_file.h"
#include "output/trajectory/trajectory.h"
#include "output/trajectory/trajectory_match.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

const RegisterFuzzTarget trajectory(
    "trajectory", [](std::string_view bytes, const TemporaryFolder& folder) {
      const std::vector<std::string> files = CutIntoFiles(bytes, 2);
      const fs::path poses = folder.Write("poses.txt", files[0]);
      const Trajectory read = files[1].empty()
                                  ? ReadTrajectory(poses)
                                  : ReadTrajectory(poses, folder.Write("times.txt", files[1]));
      WriteTumTrajectory(folder.path() / "copy.txt", read);
      const std::vector<PosePair> pairs = AssociatePoses(read, read, {});
      if (pairs.size() >= 3) ComputeMetrics(pairs, {});
    });

// Two files, brought together.
const RegisterFuzzTarget trajectory_match(
    "trajectory_match", [](std::string_view bytes, const TemporaryFolder& folder) {
      const std::vector<std::string> files = CutIntoFiles(bytes, 2);
      const fs::path truth = folder.Write("truth.txt", files[0]);
      const fs::path estimate = folder.Write("estimate.txt", files[1]);
      MatchOptions options;
      options.metrics.max_gap_s = 1.0;
      const MatchedTrajectories matched =
          MatchTrajectories({ReadTrajectoryFile(truth), truth.string()},
                            {ReadTrajectoryFile(estimate), estimate.string()},
                            options);
      ComputeMetrics(matched.pairs, {});
    });

const RegisterFuzzTarget orientations("orientations",
                                      [](std::string_view bytes, const TemporaryFolder& folder) {
                                        ReadOrientations(
                                            folder.Write("rotations", std::string(bytes)));
                                      });

const RegisterFuzzTarget g2o("g2o", [](std::string_view bytes, const TemporaryFolder& folder) {
  ReadG2o(folder.Write("graph.g2o", std::string(bytes)));
});

const RegisterFuzzTarget rotation_list(
    "rotation_list", [](std::string_view bytes, const TemporaryFolder& folder) {
      const RotationList list = ReadRotationList(folder.Write("graph", std::string(bytes)), 0.01);
      RotationMap all = list.cam_from_world;
      for (std::size_t k = 0; k < list.ids.size(); ++k) all[FrameId{static_cast<int>(k)}];
      WriteRotationList(folder.path() / "copy.g2o", list, {all, list.center_in_world, {}});
    });

const RegisterFuzzTarget known_rotation("known_rotation",
                                        [](std::string_view bytes, const TemporaryFolder& folder) {
                                          const KnownRotationInput read = ReadKnownRotation(
                                              folder.Write("problem.txt", std::string(bytes)));
                                          WriteKnownRotation(folder.path() / "copy.txt", read);
                                        });

void ReadColmap(std::string_view bytes, const TemporaryFolder& folder, const char* ending) {
  const std::vector<std::string> files = CutIntoFiles(bytes, 3);
  const std::string name = std::string("colmap_") + ending + "/";
  fs::create_directory(folder.path() / name);
  folder.Write(name + "cameras." + ending, files[0]);
  folder.Write(name + "images." + ending, files[1]);
  folder.Write(name + "points3D." + ending, files[2]);
  const ColmapModel model = ReadColmapModel(folder.path() / name);
  for (const ColmapForm form : {ColmapForm::kText, ColmapForm::kBinary}) {
    WriteColmapModel(folder.path() / "copy", model, model.reconstruction, form);
  }
  FiguresOf(model, model.reconstruction);
}

const RegisterFuzzTarget colmap_text("colmap_text",
                                     [](std::string_view bytes, const TemporaryFolder& folder) {
                                       ReadColmap(bytes, folder, "txt");
                                     });

const RegisterFuzzTarget colmap_binary("colmap_binary",
                                       [](std::string_view bytes, const TemporaryFolder& folder) {
                                         ReadColmap(bytes, folder, "bin");
                                       });

// Three records, the last of them empty.
const RegisterFuzzTarget journal("journal",
                                 [](std::string_view bytes, const TemporaryFolder& folder) {
                                   const fs::path file = folder.path() / "frames.bin";
                                   fs::remove(file);
                                   JournalExtent extent;
                                   {
                                     JournalWriter writer(file, {});
                                     for (const char* record : {"first", "second", ""})
                                       writer.Append(record);
                                     extent = writer.extent();
                                   }
                                   folder.Write("frames.bin", Damaged(ReadWholeFile(file), bytes));
                                   JournalReader reader(file, extent);
                                   while (reader.Next()) continue;
                                 });

}  // namespace
}  // namespace rotslam
