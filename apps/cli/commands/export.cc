#include <array>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/commands/map_descriptors.h"
#include "apps/cli/input/config.h"
#include "apps/cli/terminal/progress.h"
#include "output/export/colmap_database.h"
#include "output/export/colmap_model.h"
#include "output/export/nerf.h"
#include "output/export/openmvg.h"
#include "output/export/stella_map.h"
#include "output/graph/g2o.h"
#include "output/map/map_keypoints.h"
#include "output/map/ply.h"
#include "output/map/run_map.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct ExportFlags {
  CommonFlags common;
  std::string run;
  std::string format;
  std::string out;
  std::string images;
  bool all_frames = false;
  bool keyframes = false;
  bool text = false;
};

// What a format's writer gets.
struct ExportJob {
  RunMap map;  // of the frames asked for
  fs::path run;
  fs::path out;
  fs::path image_folder;
  bool text = false;
  CommonFlags common;
};

void ExportColmap(const ExportJob& job) {
  WriteColmapModel(job.out, job.map, job.text ? ColmapForm::kText : ColmapForm::kBinary);
}

void ExportColmapDatabase(const ExportJob& job) {
  ColmapDatabaseOptions options;
  if (!job.common.config.empty()) LoadOptionsYaml(job.common.config, options);
  WriteColmapDatabase(job.out, job.map, options);
}

// The edges that were measured, between the poses that came out.
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

struct Format {
  bool takes_all_frames;  // unless told otherwise
  bool has_points;
  const char* meaning;
  std::function<void(const ExportJob&)> write;
};

const std::map<std::string, Format>& Formats() {
  static const std::map<std::string, Format> formats = {
      {"colmap", {false, true, "COLMAP model, a folder (--text)", ExportColmap}},
      {"colmap-db", {false, true, "COLMAP database.db: keypoints, matches", ExportColmapDatabase}},
      {"euroc",
       {true,
        false,
        "EuRoC's csv of poses",
        [](const ExportJob& job) { WriteEurocTrajectory(job.out, ToTrajectory(job.map)); }}},
      {"g2o", {true, false, "pose graph with information", ExportG2o}},
      {"kitti",
       {true,
        false,
        "KITTI's 3x4 matrices",
        [](const ExportJob& job) { WriteKittiTrajectory(job.out, ToTrajectory(job.map)); }}},
      {"nerf",
       {false,
        false,
        "transforms.json for nerfstudio and instant-ngp",
        [](const ExportJob& job) { WriteNerfTransforms(job.out, job.map, job.image_folder); }}},
      {"openmvg",
       {false,
        true,
        "openMVG's sfm_data.json",
        [](const ExportJob& job) { WriteOpenMvg(job.out, job.map, job.image_folder); }}},
      {"ply",
       {true,
        true,
        "point cloud (--text)",
        [](const ExportJob& job) {
          WritePly(job.out,
                   MakeCloud(ToReconstruction(job.map), job.map.camera),
                   job.text ? PlyForm::kAscii : PlyForm::kBinary);
        }}},
      {"stella",
       {false,
        true,
        "stella_vslam's map.msg; reads the images again",
        [](const ExportJob& job) {
          WriteStellaMap(
              job.out, job.map, DescribeMap(job.map, job.image_folder, job.common.NumThreads()));
        }}},
      {"tum", {true, false, "TUM trajectory", [](const ExportJob& job) {
                 WriteTumTrajectory(job.out, ToTrajectory(job.map));
               }}}};
  return formats;
}

// COLMAP's model_analyzer says the same: its mean is over the points.
std::string DescribePoints(const RunMap& map) {
  int count = 0;
  double sum_px = 0.0;
  for (const MapTrack& track : map.tracks) {
    if (!HasPoint(track)) continue;
    ++count;
    sum_px += MeanErrorPx(map, track);
  }
  std::array<char, 80> text = {};
  std::snprintf(text.data(),
                text.size(),
                "%d points, mean error %.3g px, averaged over the points",
                count,
                count == 0 ? 0.0 : sum_px / count);
  return text.data();
}

RunMap ReadMap(const fs::path& run, bool all_frames) {
  const fs::path file = run / (all_frames ? "map_all_frames.bin" : "map.bin");
  if (!fs::exists(file)) {
    throw std::runtime_error(run.string() + ": holds no " + file.filename().string() +
                             ", as `rotslam run` leaves it");
  }
  RunMap map = ReadRunMap(file);
  return all_frames ? map : KeyframesOnly(map);
}

void MakeParent(const fs::path& out) {
  const fs::path parent = fs::absolute(out).parent_path();
  std::error_code error;
  fs::create_directories(parent, error);
  if (error) throw std::runtime_error(parent.string() + ": cannot be made: " + error.message());
}

int Export(const ExportFlags& flags) {
  Progress progress(flags.common);
  const Format& format = Formats().at(flags.format);
  if (flags.all_frames && flags.keyframes) {
    throw std::runtime_error("--all-frames and --keyframes exclude each other");
  }
  ExportJob job;
  const bool all_frames = flags.all_frames || (format.takes_all_frames && !flags.keyframes);
  job.run = flags.run;
  job.map = ReadMap(job.run, all_frames);
  job.out = flags.out;
  job.image_folder = flags.images.empty() ? fs::path(job.map.image_folder) : fs::path(flags.images);
  job.text = flags.text;
  job.common = flags.common;
  if (job.map.is_video && flags.images.empty()) {
    progress.Warn("the images are frames of " + job.map.image_folder +
                  ": extract them, ffmpeg -i VIDEO -fps_mode passthrough -start_number 0 %06d.png, "
                  "and name their folder by --images");
  }
  MakeParent(job.out);
  format.write(job);
  progress.Say("wrote " + job.out.string() + ": " + std::to_string(job.map.frames.size()) +
               (all_frames ? " frames" : " keyframes") +
               (format.has_points ? ", " + DescribePoints(job.map) : std::string()));
  return 0;
}

}  // namespace

void AddExportCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ExportFlags>();
  CLI::App* command =
      app.add_subcommand("export", "Write a run's result for another system to start from");
  command->add_option("run", flags->run, "Folder that `rotslam run` has written")->required();
  std::vector<std::string> names;
  std::string meanings = "Format:";
  for (const auto& [name, format] : Formats()) {
    names.push_back(name);
    meanings += "\n" + name + ": " + format.meaning;
  }
  command->add_option("--to", flags->format, meanings)
      ->required()
      ->check(CLI::IsMember(names))
      ->type_name("FORMAT");
  command->add_option("--out", flags->out, "File to write; for colmap, a folder")->required();
  command->add_flag(
      "--all-frames",
      flags->all_frames,
      "Every frame, with the points that all of them see (default: euroc, g2o, kitti, ply, tum)");
  command->add_flag("--keyframes",
                    flags->keyframes,
                    "The keyframes, with the points of bundle adjustment (default: the others)");
  command->add_flag("--text,--ascii", flags->text, "Text instead of binary: colmap, ply");
  command->add_option(
      "--images", flags->images, "Folder of the images, where it is not the run's any more");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam export runs/kitti00 --to colmap --out runs/kitti00/sparse");
  command->callback([flags, &action] { action = [flags] { return Export(*flags); }; });
}

}  // namespace rotslam
