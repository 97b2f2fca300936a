#include "apps/cli/solve/solved_files.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "output/export/colmap_model.h"
#include "output/files/atomic_file.h"
#include "output/map/run_map.h"
#include "output/map/view_graph_matches.h"
#include "rotodom/types/text_file.h"
#include "rotodom/types/track.h"

namespace rotslam {
namespace {

// The name of a view's image: the COLMAP model's, else one made of its id.
std::string ImageOf(const KnownRotationInput& input,
                    const std::vector<FrameId>& given,
                    FrameId view) {
  return input.colmap == nullptr ? "view_" + NameOf(input, view)
                                 : input.colmap->image_name.at(given[view.value]);
}

std::string Describe(const ColmapFigures& figures) {
  const double length = figures.num_points == 0
                            ? 0.0
                            : static_cast<double>(figures.num_observations) / figures.num_points;
  return std::to_string(figures.num_images) + " images, " + std::to_string(figures.num_points) +
         " points of " + FormatNumber("%.2f", length) + " observations, " +
         (figures.num_seen > 0 ? "mean error " + FormatNumber("%.3f", figures.mean_error_px) + " px"
                               : std::string("seen by none"));
}

}  // namespace

Verdicts VerdictsOf(const KnownRotationInput& input, const Solution& solution, bool is_adjusted) {
  Verdicts verdicts;
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      verdicts[{track.id, observation.frame}] = is_adjusted ? "bundle" : "no_point";
    }
  }
  for (const RemovedObservation& removed : solution.krot.removed) {
    verdicts[{removed.track, removed.frame}] = ToString(removed.reason);
  }
  for (const Reconstruction& map : solution.maps) {
    for (const Track& track : map.tracks) {
      for (const Observation& observation : track.observations) {
        verdicts[{track.id, observation.frame}] = "kept";
      }
    }
  }
  return verdicts;
}

void WriteRemoved(const std::filesystem::path& path,
                  const KnownRotationInput& input,
                  const Verdicts& verdicts) {
  std::string text = "track,view,reason\n";
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      const std::string& verdict = verdicts.at({track.id, observation.frame});
      if (verdict == "kept") continue;
      text +=
          NameOf(input, track.id) + "," + NameOf(input, observation.frame) + "," + verdict + "\n";
    }
  }
  ReplaceFile(path, text);
}

void WriteResiduals(const std::filesystem::path& path,
                    const KnownRotationInput& input,
                    const Solution& solution,
                    const Verdicts& verdicts) {
  const Camera& camera = solution.refined.camera;
  std::string text = "track,view,dx_px,dy_px,state\n";
  const auto residual = [&](const Track& track, const Observation& observation) {
    for (const Reconstruction& map : solution.maps) {
      const auto point = map.point_in_world.find(track.id);
      const auto center = map.center_in_world.find(observation.frame);
      if (point == map.point_in_world.end() || center == map.center_in_world.end()) continue;
      const Eigen::Vector3d seen =
          map.cam_from_world.at(observation.frame) * (point->second - center->second);
      const auto bearing = camera.Unproject(observation.keypoint_px);
      if (!bearing || !(seen.z() > 0.0) || !(bearing->z() > 0.0)) continue;
      const Eigen::Vector2d miss_px =
          camera.MeanFocal() * (seen.hnormalized() - bearing->hnormalized());
      return FormatNumber("%.9g", miss_px.x()) + "," + FormatNumber("%.9g", miss_px.y());
    }
    return std::string(",");
  };
  for (const Track& track : input.tracks) {
    for (const Observation& observation : track.observations) {
      text += NameOf(input, track.id) + "," + NameOf(input, observation.frame) + "," +
              residual(track, observation) + "," + verdicts.at({track.id, observation.frame}) +
              "\n";
    }
  }
  ReplaceFile(path, text);
}

void WriteSolvedMaps(const std::filesystem::path& directory,
                     const KnownRotationInput& input,
                     const std::vector<FrameId>& given,
                     const MapResult& positions) {
  RunMap map;
  map.camera = positions.camera;
  for (const auto& [view, cam_from_world] : positions.cam_from_world) {
    map.frames.push_back({view,
                          input.timestamp_s.at(view),
                          ImageOf(input, given, view),
                          positions.keyframes.contains(view),
                          cam_from_world,
                          positions.center_in_world.at(view)});
  }
  std::vector<Track> tracks = input.tracks;
  for (Track& track : tracks) {
    std::sort(track.observations.begin(),
              track.observations.end(),
              [](const Observation& a, const Observation& b) { return a.frame < b.frame; });
  }
  map.tracks = JoinTracks(tracks, positions.map);
  WriteRunMap(directory / "map.bin", map);
  map.tracks = JoinTracks({}, positions.cloud);
  WriteRunMap(directory / "map_all_frames.bin", map);
  WriteViewGraphMatches(directory / "matches.bin", {});
}

void WriteViews(const std::filesystem::path& path,
                const KnownRotationInput& input,
                const std::vector<FrameId>& given,
                const MapResult& positions) {
  std::map<FrameId, int> count;
  for (const Track& track : positions.map.tracks) {
    for (const Observation& observation : track.observations) ++count[observation.frame];
  }
  std::string text = "frame,id,timestamp,image,camera,observations,component\n";
  for (const auto& [view, rotation] : input.cam_from_world) {
    const std::string camera =
        input.colmap == nullptr ? std::string()
                                : std::to_string(input.colmap->images.at(given[view.value]).camera);
    text += std::to_string(view.value) + "," + NameOf(input, view) + "," +
            FormatNumber("%.9f", input.timestamp_s.at(view)) + "," + ImageOf(input, given, view) +
            "," + camera + "," + std::to_string(count[view]) + "," +
            std::to_string(positions.frame_poses.at(view).component) + "\n";
  }
  ReplaceFile(path, text);
}

void WriteSolvedColmap(const std::filesystem::path& directory,
                       const std::string& from,
                       const KnownRotationInput& input,
                       const std::vector<FrameId>& given,
                       const Solution& solution,
                       Progress& progress) {
  progress.Say("model before: " + Describe(FiguresOf(*input.colmap, input.colmap->reconstruction)));
  ColmapModel model = *input.colmap;
  if (!model.HasSeveralCameras()) {
    for (auto& [id, camera] : model.cameras) camera = solution.refined.camera;
  }
  const bool is_binary = std::filesystem::exists(std::filesystem::path(from) / "images.bin");
  for (std::size_t rank = 0; rank < solution.maps.size(); ++rank) {
    Reconstruction map;
    for (const auto& [view, center] : solution.maps[rank].center_in_world) {
      map.center_in_world[given[view.value]] = center;
      map.cam_from_world[given[view.value]] = solution.maps[rank].cam_from_world.at(view);
    }
    map.point_in_world = solution.maps[rank].point_in_world;
    map.tracks = solution.maps[rank].tracks;
    for (Track& track : map.tracks) {
      for (Observation& observation : track.observations) {
        observation.frame = given[observation.frame.value];
      }
    }
    progress.Say("model after:  " + Describe(FiguresOf(model, map)));
    WriteColmapModel(directory / "sparse" / std::to_string(rank),
                     model,
                     map,
                     is_binary ? ColmapForm::kBinary : ColmapForm::kText);
  }
}

}  // namespace rotslam
