#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/cli/input/input.h"
#include "apps/cli/run_directory/checkpoint.h"
#include "apps/slam/build_map.h"
#include "apps/slam/orientations.h"
#include "output/map/ply.h"
#include "output/tables/summary.h"

namespace rotslam {

/// Makes the folder for a run's results and proves that it can be written, before hours of work.
/// What a killed run was about to publish there is published. Throws std::runtime_error with path
/// and reason.
std::filesystem::path PrepareRunDirectory(const std::string& out);

/// rotations_tum.txt, rotations.csv and view_graph.g2o.
void WriteOrientations(const std::filesystem::path& directory, const Orientations& orientations);

/// trajectory_tum.txt, trajectory_kitti.txt, keyframes_tum.txt, cloud.ply, cameras.ply and
/// segments.csv.
void WritePositions(const std::filesystem::path& directory,
                    const Orientations& orientations,
                    const MapResult& positions,
                    const Camera& camera,
                    PlyForm form);

/// known_rotation.txt: the keyframes' orientations and tracks, which `rotslam solve` reads.
void WriteKnownRotationInput(const std::filesystem::path& directory,
                             const Orientations& orientations,
                             const MapResult& positions,
                             const Camera& camera);

/// map.bin, the keyframes' map with all their tracks, and map_all_frames.bin, the cloud as all
/// frames see it: what `rotslam export` reads.
/// @param features  with which the orientations were found.
void WriteMaps(const std::filesystem::path& directory,
               const Sequence& sequence,
               const Orientations& orientations,
               const MapResult& positions,
               const FeatureOptions& features);

/// What the terminal says of a run that Ctrl-C has ended: what WriteOrientations has left.
std::string DescribeInterrupted(const std::filesystem::path& directory,
                                const Orientations& orientations,
                                const Checkpoint& checkpoint);

/// The parts of summary.json that `run` and `rotations` share.
RunSummary StartSummary(const std::string& command,
                        const Input& input,
                        const Orientations& orientations,
                        std::vector<OptionEntry> options);

/// The parts that only `run` has.
void AddPositions(const MapResult& positions, const Camera& camera, RunSummary& summary);

/// The parts that `run` and `solve` share.
void AddKnownRotation(const KrotSolution& solution, const Camera& camera, RunSummary& summary);
void AddBundles(const std::vector<BundleSummary>& bundles,
                const Camera& camera,
                RunSummary& summary);

}  // namespace rotslam
