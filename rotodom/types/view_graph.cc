#include "rotodom/types/view_graph.h"

#include <stdexcept>

namespace rotslam {

RelativeRotation Flipped(const RelativeRotation& edge) {
  RelativeRotation flipped = edge;
  std::swap(flipped.i, flipped.j);
  flipped.j_from_i = edge.j_from_i.Inverse();
  // (Exp(delta) R)^-1 = Exp(-R^-1 delta) R^-1.
  const Eigen::Matrix3d R_i_j = flipped.j_from_i.Matrix();
  flipped.covariance = R_i_j * edge.covariance * R_i_j.transpose();
  flipped.translation_direction = -(R_i_j * edge.translation_direction);
  return flipped;
}

void ViewGraph::AddEdge(RelativeRotation edge) {
  if (edge.i == edge.j || edge.i.value < 0 || edge.j.value < 0) {
    throw std::invalid_argument("ViewGraph: an edge needs two different views");
  }
  if (edge.i > edge.j) edge = Flipped(edge);
  const auto [entry, is_new] =
      index_.try_emplace({edge.i, edge.j}, static_cast<int>(edges_.size()));
  if (!is_new) {
    edges_[entry->second] = edge;
    return;
  }
  edges_of_[edge.i].push_back(entry->second);
  edges_of_[edge.j].push_back(entry->second);
  edges_.push_back(edge);
}

const RelativeRotation* ViewGraph::FindEdge(FrameId a, FrameId b) const {
  const auto entry = index_.find(std::minmax(a, b));
  return entry == index_.end() ? nullptr : &edges_[entry->second];
}

const std::vector<int>& ViewGraph::EdgesOf(FrameId view) const {
  static const std::vector<int> none;
  const auto entry = edges_of_.find(view);
  return entry == edges_of_.end() ? none : entry->second;
}

}  // namespace rotslam
