#include "rotodom/view_graph/consistency.h"

#include <limits>

namespace rotslam {
namespace {

struct Choice {
  int hypothesis = 0;
  double cost = std::numeric_limits<double>::infinity();
};

// The hypothesis that agrees best with the orientation.
Choice BestFor(const Rotation& cam_from_world, const PairHypotheses& pair) {
  Choice best;
  for (int h = 0; h < std::ssize(pair.hypotheses); ++h) {
    const auto& [hypothesis, excess] = pair.hypotheses[h];
    const double angle_deg = (hypothesis * cam_from_world.Inverse()).AngleDeg();
    const double squared = angle_deg * angle_deg;
    const double cost = squared / (1.0 + squared) + excess;
    if (cost < best.cost) best = {h, cost};
  }
  return best;
}

}  // namespace

std::vector<int> ChooseConsistent(std::span<const PairHypotheses> pairs) {
  std::vector<int> chosen(pairs.size(), 0);
  double least_cost = std::numeric_limits<double>::infinity();
  for (const PairHypotheses& naming : pairs) {
    for (const OrientationHypothesis& named : naming.hypotheses) {
      std::vector<int> suitable;
      double cost = 0.0;
      for (const PairHypotheses& pair : pairs) {
        const Choice choice = BestFor(named.cam_from_world, pair);
        suitable.push_back(choice.hypothesis);
        cost += pair.weight * choice.cost;
      }
      if (!(cost < least_cost)) continue;
      least_cost = cost;
      chosen = std::move(suitable);
    }
  }
  return chosen;
}

}  // namespace rotslam
