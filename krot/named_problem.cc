#include "krot/named_problem.h"

#include <map>

namespace rotslam {

NamedProblem MakeProblem(const RotationMap& cam_from_world, const std::vector<Track>& tracks) {
  NamedProblem named;
  std::map<FrameId, int> view_of;
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) view_of[observation.frame] = 0;
  }
  for (auto& [frame, view] : view_of) {
    view = named.problem.num_views();
    named.views.push_back(frame);
    named.problem.R_c_w.push_back(cam_from_world.at(frame).Matrix());
  }
  named.tracks.reserve(tracks.size());
  for (const Track& track : tracks) {
    for (const Observation& observation : track.observations) {
      named.problem.observations.push_back(
          {view_of.at(observation.frame),
           named.problem.num_points,
           observation.bearing.head<2>() / observation.bearing.z()});
    }
    ++named.problem.num_points;
    named.tracks.push_back(track.id);
  }
  return named;
}

}  // namespace rotslam
