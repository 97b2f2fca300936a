// The files of a run's folder, one of them from elsewhere, as `report`, `plot` and `export` read
// them.

#include "apps/report/page.h"
#include "apps/report/page_data.h"
#include "apps/report/run_data.h"
#include "output/export/colmap_database.h"
#include "output/export/colmap_model.h"
#include "output/export/nerf.h"
#include "output/export/openmvg.h"
#include "output/export/stella_map.h"
#include "output/graph/g2o.h"
#include "output/map/map_keypoints.h"
#include "output/map/ply.h"
#include "output/tables/poses_csv.h"
#include "output/tables/summary.h"
#include "output/trajectory/trajectory.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr int kNumFrames = 4;

StampedPose PoseAt(int frame) {
  return {0.1 * frame, Rotation::Exp({0.0, 0.03 * frame, 0.0}), {0.5 * frame, 0.0, 0.1}};
}

RunMap SmallMap() {
  RunMap map;
  map.camera.width = 320;
  map.camera.height = 240;
  map.camera.fx = map.camera.fy = 300.0;
  map.camera.cx = 160.0;
  map.camera.cy = 120.0;
  for (int n = 0; n < kNumFrames; ++n) {
    const StampedPose pose = PoseAt(n);
    map.frames.push_back({FrameId{n},
                          pose.timestamp_s,
                          std::to_string(n) + ".png",
                          n != 2,
                          pose.world_from_cam.Inverse(),
                          pose.center_in_world});
  }
  MapTrack& track = map.tracks.emplace_back();
  track.track.id = TrackId{0};
  for (int n = 0; n < 3; ++n) {
    track.track.observations.push_back({FrameId{n}, {150.0, 120.0}, Eigen::Vector3d::UnitZ(), 1.0});
  }
  track.point_in_world = Eigen::Vector3d(0.1, 1.0, 5.0);
  track.fits.assign(3, true);
  track.levels.assign(3, 0);
  map.edges.push_back({FrameId{0}, FrameId{1}, 50, false});
  return map;
}

void WriteRun(const fs::path& run) {
  RunSummary summary;
  summary.command = "run";
  summary.camera = SmallMap().camera;
  summary.sequence = {{"path", std::string("/nowhere")}};
  WriteSummary(run / "summary.json", summary);
  std::vector<RotationRow> rows;
  Trajectory poses;
  ViewGraph graph;
  RotationMap cam_from_world;
  for (int n = 0; n < kNumFrames; ++n) {
    poses.push_back(PoseAt(n));
    rows.push_back({n, poses[n].timestamp_s, poses[n].world_from_cam, std::nullopt, 3, {"loop"}});
    cam_from_world[FrameId{n}] = poses[n].world_from_cam.Inverse();
  }
  graph.AddEdge({FrameId{0}, FrameId{1}, Rotation()});
  WriteRotationsCsv(run / "rotations.csv", rows);
  WriteTumTrajectory(run / "trajectory_tum.txt", poses);
  std::vector<PoseRow> states;
  for (int n = 0; n < kNumFrames; ++n) {
    states.push_back({n, poses[n], Eigen::Vector3d(0.1, 0.1, 0.1), PoseState::kHeld, 0, "held"});
  }
  WritePosesCsv(run / "poses.csv", states);
  WriteSegments(run / "segments.csv", {{0, kNumFrames - 1, "rotating", 0, "tracks", 0.9}});
  WriteLoopsCsv(run / "loops.csv", {{3, 0, 0.5, 123, 1.25, true, 1.002, 0.75}});
  WriteG2o(run / "view_graph.g2o", {graph, cam_from_world, {}});
  WriteRunMap(run / "map.bin", SmallMap());
  WriteRunMap(run / "map_all_frames.bin", SmallMap());
}

// Reads a run of which one file holds `bytes`.
RunData ReadWith(const std::string& file, std::string_view bytes, const TemporaryFolder& folder) {
  const std::string name = "run_of_" + file;
  if (!fs::exists(folder.path() / name)) {
    fs::create_directory(folder.path() / name);
    WriteRun(folder.path() / name);
  }
  folder.Write(name + "/" + file, std::string(bytes));
  return ReadRunData(folder.path() / name);
}

// The report's data, without the images.
auto ReportWith(const std::string& file) {
  return [file](std::string_view bytes, const TemporaryFolder& folder) {
    const RunData run = ReadWith(file, bytes, folder);
    EmbeddedJson(PageData(run, {}, {}));
  };
}

const RegisterFuzzTarget summary("run_summary", ReportWith("summary.json"));
const RegisterFuzzTarget rotations("run_rotations", ReportWith("rotations.csv"));
const RegisterFuzzTarget segments("run_segments", ReportWith("segments.csv"));
const RegisterFuzzTarget states("run_states", ReportWith("poses.csv"));
const RegisterFuzzTarget loops("run_loops", ReportWith("loops.csv"));
const RegisterFuzzTarget graph("run_graph", ReportWith("view_graph.g2o"));
const RegisterFuzzTarget cloud("run_cloud", ReportWith("map_all_frames.bin"));

const RegisterFuzzTarget poses("run_poses", ReportWith("trajectory_tum.txt"));

const RegisterFuzzTarget truth("run_truth",
                               [](std::string_view bytes, const TemporaryFolder& folder) {
                                 const fs::path file =
                                     folder.Write("truth.txt", std::string(bytes));
                                 RunData run = ReadWith("notes.txt", "", folder);
                                 AddTruth({file.string(), ""}, {}, run);
                                 EmbeddedJson(PageData(run, {}, {}));
                               });

const RegisterFuzzTarget map("run_map", [](std::string_view bytes, const TemporaryFolder& folder) {
  const RunData run = ReadWith("map.bin", bytes, folder);
  EmbeddedJson(PageData(run, {}, {}));
  const RunMap keyframes = PartOf(*run.keyframe_map, KeyframesOf(*run.keyframe_map));
  const fs::path out = folder.path() / "exported";
  WriteColmapModel(out, keyframes, ColmapForm::kText);
  WriteColmapModel(out, keyframes, ColmapForm::kBinary);
  WriteNerfTransforms(out / "transforms.json", keyframes, keyframes.image_folder);
  WriteOpenMvg(out / "sfm_data.json", keyframes, keyframes.image_folder);
  WriteTumTrajectory(out / "tum.txt", ToTrajectory(keyframes));
  MakeCloud(ToReconstruction(keyframes), keyframes.camera);
  std::map<FrameId, KeypointDescriptors> descriptors;
  for (const auto& [frame, keypoints] : ListKeypoints(keyframes)) {
    descriptors[frame].angles_deg.resize(keypoints.size());
    descriptors[frame].descriptors.resize(keypoints.size());
  }
  WriteStellaMap(out / "map.msg", keyframes, descriptors);
});

}  // namespace
}  // namespace rotslam
