#include "apps/cli/export/formats.h"

#include <vector>

#include "apps/cli/export/map_descriptors.h"
#include "apps/cli/input/config.h"
#include "apps/cli/run_directory/run_masks.h"
#include "output/export/colmap_database.h"
#include "output/export/colmap_model.h"
#include "output/export/nerf.h"
#include "output/export/openmvg.h"
#include "output/export/stella_map.h"
#include "output/graph/g2o.h"
#include "output/map/ply.h"
#include "output/tables/poses_csv.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

void ExportColmap(const ExportJob& job) {
  WriteColmapModel(job.out, job.map, job.text ? ColmapForm::kText : ColmapForm::kBinary);
}

void ExportColmapDatabase(const ExportJob& job) {
  ColmapDatabaseOptions options;
  if (!job.common.config.empty()) LoadOptionsYaml(job.common.config, options);
  WriteColmapDatabase(job.out, job.map, *job.matches, options);
}

void ExportNerf(const ExportJob& job, NerfReader reader) {
  for (const std::string& note : WriteNerfTransforms(job.out, job.map, job.image_folder, reader)) {
    job.say("note: " + job.out.string() + ": " + note);
  }
}

// The edges that were measured, between the poses that came out; those at other frames are left
// out.
void ExportG2o(const ExportJob& job) {
  PoseGraph pose_graph = ReadG2o(job.run / "view_graph.g2o");
  pose_graph.cam_from_world.clear();
  pose_graph.center_in_world.clear();
  for (const MapFrame& frame : job.map.frames) {
    pose_graph.cam_from_world[frame.id] = frame.cam_from_world;
    pose_graph.center_in_world[frame.id] = frame.center_in_world;
  }
  WriteG2o(job.out, pose_graph);
}

// One row per frame; what `rotslam rotations` leaves has no places.
void ExportCsv(const ExportJob& job) {
  std::vector<PoseRow> rows;
  for (const MapFrame& frame : job.map.frames) {
    PoseRow& row = rows.emplace_back();
    row.frame = frame.id.value;
    row.pose = {frame.timestamp_s, frame.cam_from_world.Inverse(), frame.center_in_world};
    row.state = job.has_places ? PoseState::kMeasured : PoseState::kUnplaced;
  }
  if (job.has_places && fs::exists(job.run / "poses.csv")) {
    std::map<int, PoseRow> known;
    for (PoseRow& row : ReadPosesCsv(job.run / "poses.csv")) known[row.frame] = row;
    for (PoseRow& row : rows) {
      const auto found = known.find(row.frame);
      if (found != known.end()) row = found->second;
    }
  }
  WritePosesCsv(job.out, rows);
}

}  // namespace

// A table: one entry for each format.
const std::map<std::string, Format>& Formats() {
  static const std::map<std::string, Format> formats = {
      {"colmap",
       {FrameChoice::kKeyframes,
        true,
        Places::kApart,
        "COLMAP model, a folder (--text)",
        ExportColmap}},
      {"colmap-db",
       {FrameChoice::kKeyframesAndAtRest,
        true,
        Places::kOne,
        "COLMAP database.db: keypoints, matches; frames of pure rotations, too",
        ExportColmapDatabase}},
      {"csv",
       {FrameChoice::kAll,
        false,
        Places::kOne,
        "a row per frame, as poses.csv has them",
        ExportCsv}},
      {"euroc",
       {FrameChoice::kAll,
        false,
        Places::kApart,
        "EuRoC's csv of poses",
        [](const ExportJob& job) { WriteEurocTrajectory(job.out, ToTrajectory(job.map)); }}},
      {"g2o", {FrameChoice::kAll, false, Places::kApart, "pose graph with information", ExportG2o}},
      {"kitti",
       {FrameChoice::kAll,
        false,
        Places::kOne,
        "KITTI's 3x4 matrices",
        [](const ExportJob& job) { WriteKittiTrajectory(job.out, ToTrajectory(job.map)); }}},
      {"nerf",
       {FrameChoice::kKeyframes,
        true,
        Places::kApart,
        "transforms.json, as nerfstudio and instant-ngp read it alike, and a PLY file",
        [](const ExportJob& job) { ExportNerf(job, NerfReader::kBoth); },
        true}},
      {"nerfstudio",
       {FrameChoice::kKeyframes,
        true,
        Places::kApart,
        "the same for nerfstudio alone: lenses keep k3",
        [](const ExportJob& job) { ExportNerf(job, NerfReader::kNerfstudio); },
        true}},
      {"openmvg",
       {FrameChoice::kKeyframes,
        true,
        Places::kApart,
        "openMVG's sfm_data.json",
        [](const ExportJob& job) { WriteOpenMvg(job.out, job.map, job.image_folder); }}},
      {"ply",
       {FrameChoice::kAll,
        true,
        Places::kApart,
        "point cloud (--text)",
        [](const ExportJob& job) {
          WritePly(job.out,
                   MakeCloud(ToReconstruction(job.map), job.map.camera),
                   job.text ? PlyForm::kAscii : PlyForm::kBinary);
        }}},
      {"stella",
       {FrameChoice::kKeyframes,
        true,
        Places::kApart,
        "stella_vslam's map.msg; reads the images again",
        [](const ExportJob& job) {
          WriteStellaMap(
              job.out, job.map, DescribeMap(job.map, job.image_folder, job.common.NumThreads()));
        },
        false,
        true}},
      {"tum",
       {FrameChoice::kAll, false, Places::kApart, "TUM trajectory", [](const ExportJob& job) {
          WriteTumTrajectory(job.out, ToTrajectory(job.map));
        }}}};
  return formats;
}

void WriteFormat(const Format& format, const ExportJob& job) {
  format.write(job);
  if (format.names_masks && job.num_masks > 0) AddMaskPaths(job.out);
}

}  // namespace rotslam
