#pragma once

#include <optional>

#include "krot/krot_problem.h"
#include "krot/structure/components.h"
#include "rotodom/types/maps.h"

namespace rotslam {

/// First positions of one rigid component.
struct ComponentStart {
  CenterMap centers;
  int num_programs = 0;
  int num_grown_views = 0;  // placed by resection
};

/// Solves the robust start's programs over a spread of tracks, in blocks of views where there are
/// more than options.max_lp_views, or global positioning over all with options.start kPositioning,
/// and places the views that they leave out, by resection.
/// @param component_options  what the component was found with, to find its blocks.
/// @return  nullopt when that gives no structure.
std::optional<ComponentStart> StartComponent(const KrotProblem& problem,
                                             const ViewComponent& component,
                                             const ComponentOptions& component_options);

}  // namespace rotslam
