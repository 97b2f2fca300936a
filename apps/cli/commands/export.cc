#include <array>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/export/formats.h"
#include "apps/cli/export/frame_images.h"
#include "apps/cli/export/placed_frames.h"
#include "apps/cli/export/undistort.h"
#include "apps/cli/run_directory/run_masks.h"
#include "apps/cli/terminal/progress.h"
#include "output/export/colmap_model.h"
#include "output/map/frame_cameras.h"
#include "output/map/map_keypoints.h"
#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"
#include "output/tables/focal_lengths_csv.h"
#include "output/tables/rotations_csv.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

struct ExportFlags {
  CommonFlags common;
  std::string run;
  std::string format;
  std::string out;
  std::string images;
  std::string extract;
  bool undistort = false;
  bool all_frames = false;
  bool keyframes = false;
  bool with_unplaced = false;
  bool text = false;
};

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

// Whether the run directory is one of `rotslam rotations`, which builds no map.
bool HasOrientationsOnly(const fs::path& run) {
  return !fs::exists(run / "map.bin") && !fs::exists(run / "map_all_frames.bin") &&
         fs::exists(run / "rotations.csv");
}

// Its frames, at the origin.
RunMap ReadOrientations(const fs::path& run) {
  RunMap map;
  for (const RotationRow& row : ReadRotationsCsv(run / "rotations.csv")) {
    MapFrame& frame = map.frames.emplace_back();
    frame.id = FrameId{row.frame};
    frame.timestamp_s = row.timestamp_s;
    frame.cam_from_world = row.world_from_cam.Inverse();
  }
  return map;
}

RunMap ReadMap(const fs::path& run, FrameChoice frames) {
  const fs::path file = run / (frames == FrameChoice::kAll ? "map_all_frames.bin" : "map.bin");
  if (!fs::exists(file)) {
    throw std::runtime_error(run.string() + ": holds no " + file.filename().string() +
                             ", as `rotslam run` leaves it");
  }
  return ReadRunMap(file);
}

// The part of a run's map that an output has.
RunMap TakeFrames(const fs::path& run, const RunMap& map, FrameChoice frames) {
  if (frames == FrameChoice::kAll) return map;
  std::set<FrameId> wanted = KeyframesOf(map);
  if (frames == FrameChoice::kKeyframesAndAtRest) wanted.merge(FramesAtRest(run, map));
  return PartOf(map, wanted);
}

// Reads matches.bin. Runs of version 0.1.0 have no such file: the result is then empty.
ViewGraphMatches ReadMatches(const fs::path& run, Progress& progress) {
  const fs::path file = run / "matches.bin";
  if (fs::exists(file)) return ReadViewGraphMatches(file);
  progress.Say("note: " + run.string() +
               " has no matches.bin, an older version has written it: matches that became no "
               "tracks are missing; run the sequence again for all");
  return {};
}

void MakeParent(const fs::path& out) {
  const fs::path parent = fs::absolute(out).parent_path();
  std::error_code error;
  fs::create_directories(parent, error);
  if (error) throw std::runtime_error(parent.string() + ": cannot be made: " + error.message());
}

// Writes the masks of the run into the folder `masks` beside the output, for formats whose readers
// use masks.
// @return  number of masks.
int WriteMasksBeside(const std::string& format, const ExportJob& job) {
  if (format != "colmap" && format != "colmap-db" && !format.starts_with("nerf")) return 0;
  std::vector<std::string> images;
  for (const MapFrame& frame : job.map.frames) images.push_back(frame.image);
  return ExportMasks(
      job.run, images, fs::absolute(job.out).parent_path() / "masks", job.mask_change);
}

// The files of a COLMAP model, whose components lie in folders of their own instead.
void RemoveModel(const fs::path& folder) {
  for (const char* name : {"cameras", "images", "points3D"}) {
    for (const char* ending : {".bin", ".txt"}) {
      std::error_code error;
      fs::remove(folder / (std::string(name) + ending), error);
    }
  }
}

// The path of one component: a numbered folder in --out, or the file --out with a number.
fs::path PathOf(const fs::path& out, const ExportFlags& flags, std::size_t component) {
  if (flags.format == "colmap") return out / std::to_string(component);
  if (component == 0) return out;
  fs::path path = out;
  return path.replace_filename(out.stem().string() + "_" + std::to_string(component) +
                               out.extension().string());
}

// One line on what was written.
std::string DescribeOutput(const ExportJob& job, const Format& format) {
  const std::size_t num_keyframes = KeyframesOf(job.map).size();
  const bool has_others =
      num_keyframes < job.map.frames.size() || format.frames == FrameChoice::kAll;
  return "wrote " + job.out.string() + ": " + std::to_string(job.map.frames.size()) +
         (has_others ? " frames" : " keyframes") +
         (format.has_points ? ", " + DescribePoints(job.map) : std::string());
}

// One line on frames that an output does not have; empty where it has all.
std::string DescribeLeftOut(const PlacedFrames& placed, std::size_t component) {
  std::string text;
  if (!placed.unplaced.empty()) {
    text = "frames " + DescribeFrames(placed.unplaced) + ", which nothing places";
  }
  std::set<FrameId> others;
  for (std::size_t k = 0; k < placed.components.size(); ++k) {
    if (k != component) others.insert(placed.components[k].begin(), placed.components[k].end());
  }
  if (!others.empty()) {
    text += std::string(text.empty() ? "" : "; ") + "frames " + DescribeFrames(others) +
            ", whose scale nothing ties to the others: they are written apart";
  }
  return text.empty() ? text : "left out: " + text + "; --with-unplaced writes all in one";
}

// Writes the frames that have a place, each component by itself.
void ExportPlaced(const ExportFlags& flags,
                  const Format& format,
                  const ExportJob& whole,
                  Progress& progress) {
  const PlacedFrames placed = FindPlacedFrames(whole.run, whole.map);
  if (placed.components.empty()) {
    throw std::runtime_error(whole.run.string() +
                             ": no frame of this run has a place; --with-unplaced exports them "
                             "all the same");
  }
  const bool is_one = placed.components.size() == 1;
  if (!is_one && flags.format == "colmap") RemoveModel(whole.out);
  for (std::size_t k = 0; k < placed.components.size(); ++k) {
    ExportJob job = whole;
    job.map = PartOf(whole.map, placed.components[k]);
    if (!is_one) job.out = PathOf(whole.out, flags, k);
    WriteFormat(format, job);
    const std::string left_out = DescribeLeftOut(placed, k);
    progress.Say(DescribeOutput(job, format) + (left_out.empty() ? "" : "; " + left_out));
  }
}

void RefuseContradictions(const ExportFlags& flags) {
  if (flags.all_frames && flags.keyframes) {
    throw std::runtime_error("--all-frames and --keyframes exclude each other");
  }
  if (!flags.images.empty() && !flags.extract.empty() && !flags.undistort) {
    throw std::runtime_error("--images and --extract exclude each other");
  }
}

ImageObserver ObserverOf(Progress& progress) {
  return {[&progress](const std::string& line) { progress.Say(line); },
          [&progress](int num_done, int) { progress.Step(num_done); }};
}

// Extracts or checks the images, as the flags say.
// @return  the folder that the export names for them.
// @param whole  with all frames of the run.
// @param map    what is exported.
fs::path FindImages(const ExportFlags& flags,
                    const RunMap& whole,
                    Progress& progress,
                    RunMap& map) {
  const ImageObserver observer = ObserverOf(progress);
  if (!flags.extract.empty()) {
    progress.StartStage("extracting images", static_cast<int>(std::ssize(whole.frames)));
    ExtractImages(flags.run, flags.extract, nullptr, observer, whole);
    progress.EndStage();
    return flags.extract;
  }
  if (!flags.images.empty()) {
    progress.StartStage("checking images", static_cast<int>(std::ssize(map.frames)));
    CheckImages(flags.run, flags.images, flags.common.NumThreads(), observer, map);
    progress.EndStage();
    return flags.images;
  }
  return map.image_folder;
}

// The folder for undistorted images: that of --extract, or one beside the output.
fs::path FolderOfUndistorted(const ExportFlags& flags) {
  if (!flags.extract.empty()) return flags.extract;
  const fs::path out = flags.out;
  return fs::path(out).replace_filename(out.stem().string() + "_undistorted");
}

// The cameras of a run's frames where its lens zooms.
using FrameCameras = std::map<FrameId, Camera>;

FrameCameras ReadFrameCameras(const fs::path& run, const Camera& camera) {
  FrameCameras cameras;
  const fs::path file = run / "focal_lengths.csv";
  if (!fs::exists(file)) return cameras;
  for (const FocalLengthRow& row : ReadFocalLengthsCsv(file)) {
    Camera& own = cameras[FrameId{row.frame}] = camera;
    own.fx = row.fx;
    own.fy = row.fy;
    own.cx = row.cx;
    own.cy = row.cy;
  }
  return cameras;
}

// Writes images without distortion, and takes the distortion out of what is exported. Six
// parameters: the input, and what is changed.
// @param cameras  become those without distortion.
// @return  the folder of the images.
fs::path Undistort(const ExportFlags& flags,
                   const RunMap& whole,
                   Progress& progress,
                   RunMap& map,
                   ViewGraphMatches& matches,
                   FrameCameras& cameras) {
  const Camera from = map.camera;
  const Camera to = UndistortedCamera(from);
  const FrameCameras undistorted = UndistortedCameras(cameras, from, to);
  const ImageUndistorter of_all(from, to);
  const ImageChange change = [&](FrameId frame, const cv::Mat& image) {
    const auto own = cameras.find(frame);
    return own == cameras.end() ? of_all(image)
                                : ImageUndistorter(own->second, undistorted.at(frame))(image);
  };
  fs::path folder = FolderOfUndistorted(flags);
  const ImageObserver observer = ObserverOf(progress);
  if (flags.images.empty()) {
    progress.StartStage("writing images", static_cast<int>(std::ssize(whole.frames)));
    ExtractImages(flags.run, folder, change, observer, whole);
  } else {
    const int num_frames = static_cast<int>(std::ssize(map.frames));
    progress.StartStage("checking images", num_frames);
    CheckImages(flags.run, flags.images, flags.common.NumThreads(), observer, map);
    progress.EndStage();
    progress.StartStage("writing images", num_frames);
    ChangeImages(flags.images, folder, change, observer, map);
  }
  progress.EndStage();
  UndistortMap(to, map);
  UndistortMatches(from, to, matches);
  cameras = undistorted;
  progress.Say("wrote " + folder.string() + ": images without distortion, " + Describe(to));
  return folder;
}

// Says where an export refers to images that nobody will find there.
void WarnOfMissingImages(const RunMap& map, Progress& progress) {
  if (map.is_video) {
    progress.Warn("the images are frames of " + map.image_folder +
                  ": --extract DIR writes them, and what is exported refers to them there");
  } else if (!map.image_folder.empty() && !fs::is_directory(map.image_folder)) {
    progress.Warn("the images are not at " + map.image_folder +
                  " any more: --images names their folder");
  }
}

// `solve` gives the map of a COLMAP model of several cameras one common camera. It is the camera of
// none of the images.
void RefuseSeveralCameras(const ExportFlags& flags) {
  const fs::path sparse = fs::path(flags.run) / "sparse";
  const fs::path model = sparse / "0";
  if (!fs::exists(model / "images.bin") && !fs::exists(model / "images.txt")) return;
  if (!ReadColmapModel(model).HasSeveralCameras()) return;
  throw std::runtime_error(flags.run + ": its images have several cameras, of which --to " +
                           flags.format + " has one only; " + sparse.string() +
                           " is its COLMAP model with every camera's own lens");
}

// Formats that need no more than orientations, of a run that has no more.
int ExportOrientations(const ExportFlags& flags, const Format& format, Progress& progress) {
  if (format.frames != FrameChoice::kAll || format.has_points || flags.keyframes) {
    std::string names;
    for (const auto& [name, other] : Formats()) {
      if (other.frames != FrameChoice::kAll || other.has_points) continue;
      names += (names.empty() ? "" : ", ") + name;
    }
    throw std::runtime_error(flags.run + ": holds orientations alone, and --to " + flags.format +
                             (flags.keyframes ? " --keyframes" : "") +
                             " needs positions, which `rotslam run` finds; these do not: " + names);
  }
  ExportJob job;
  job.map = ReadOrientations(flags.run);
  job.run = flags.run;
  job.out = flags.out;
  job.has_places = false;
  job.common = flags.common;
  MakeParent(job.out);
  WriteFormat(format, job);
  progress.Say(DescribeOutput(job, format) + ": orientations alone, all positions are zero");
  return 0;
}

int Export(const ExportFlags& flags) {
  Progress progress(flags.common);
  const Format& format = Formats().at(flags.format);
  RefuseContradictions(flags);
  if (HasOrientationsOnly(flags.run)) return ExportOrientations(flags, format, progress);
  const bool refers_to_images = format.frames != FrameChoice::kAll;
  if (refers_to_images || flags.undistort) RefuseSeveralCameras(flags);
  ExportJob job;
  const FrameChoice frames = flags.all_frames  ? FrameChoice::kAll
                             : flags.keyframes ? FrameChoice::kKeyframes
                                               : format.frames;
  job.run = flags.run;
  const RunMap whole = ReadMap(job.run, frames);
  job.map = TakeFrames(job.run, whole, frames);
  ViewGraphMatches matches;
  if (flags.format.starts_with("colmap")) {
    // The model has the database's keypoints, too, since COLMAP compares their numbers.
    matches = ReadMatches(job.run, progress);
    AddKeypoints(matches, job.map);
  }
  job.matches = &matches;
  job.out = flags.out;
  const bool undistorts = flags.undistort && job.map.camera.model != CameraModel::kPinhole;
  if (flags.undistort && !undistorts) {
    progress.Say("note: the lens has no distortion, --undistort changes nothing");
  }
  FrameCameras cameras = ReadFrameCameras(job.run, job.map.camera);
  if (!cameras.empty() && format.has_one_camera) {
    throw std::runtime_error(flags.run + ": the lens zooms, and " + flags.format +
                             " has one camera for all images: it cannot say so");
  }
  if (undistorts) {
    job.mask_change = ImageUndistorter(job.map.camera, UndistortedCamera(job.map.camera));
  }
  job.image_folder = undistorts ? Undistort(flags, whole, progress, job.map, matches, cameras)
                                : FindImages(flags, whole, progress, job.map);
  if (!cameras.empty()) {
    GiveFrameCameras(cameras, job.map);
    MoveToFrameCameras(job.map, matches);
  }
  if (refers_to_images && !undistorts && flags.images.empty() && flags.extract.empty()) {
    WarnOfMissingImages(job.map, progress);
  }
  job.text = flags.text;
  job.common = flags.common;
  job.say = [&](const std::string& line) { progress.Say(line); };
  MakeParent(job.out);
  job.num_masks = WriteMasksBeside(flags.format, job);
  if (job.num_masks > 0) {
    progress.Say("wrote " + (fs::absolute(job.out).parent_path() / "masks").string() + ": " +
                 std::to_string(job.num_masks) + " masks");
  }
  if (format.places == Places::kApart && !flags.with_unplaced) {
    ExportPlaced(flags, format, job, progress);
    return 0;
  }
  WriteFormat(format, job);
  progress.Say(DescribeOutput(job, format));
  return 0;
}

}  // namespace

void AddExportCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ExportFlags>();
  CLI::App* command =
      app.add_subcommand("export", "Write a run's result for another system to start from");
  command
      ->add_option(
          "run", flags->run, "Folder that `rotslam run`, `solve` or `rotations` has written")
      ->required();
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
  command->add_flag("--all-frames",
                    flags->all_frames,
                    "Every frame, with the points that all of them see (default: csv, euroc, g2o, "
                    "kitti, ply, tum)");
  command->add_flag(
      "--keyframes",
      flags->keyframes,
      "The keyframes alone, with the points of bundle adjustment (default: the others)");
  command->add_flag("--with-unplaced",
                    flags->with_unplaced,
                    "All frames in one output, those that nothing places and components that "
                    "nothing ties to one another, too (always so: colmap-db, csv, kitti)");
  command->add_flag("--undistort",
                    flags->undistort,
                    "Write images without distortion, and what belongs to them: into the folder of "
                    "--extract, or one beside --out whose name ends in _undistorted");
  command->add_flag("--text,--ascii", flags->text, "Text instead of binary: colmap, ply");
  command->add_option(
      "--images",
      flags->images,
      "Folder of the images, where it is not the run's any more; they are compared with what the "
      "run saw");
  command->add_option("--extract",
                      flags->extract,
                      "Write the images that the run has read into this folder, and refer to them "
                      "there: frames of a video as PNG, image files as they are");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam export runs/kitti00 --to colmap --out runs/kitti00/sparse");
  command->callback([flags, &action] { action = [flags] { return Export(*flags); }; });
}

}  // namespace rotslam
