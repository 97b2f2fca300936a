#include "rotodom/odometry.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "rotodom/types/options.h"

namespace rotslam {
namespace {

// Positions of the same corner that differ by more than this are not averaged.
constexpr double kSameCornerPx = 1.0;

// Gives every keypoint of `features` that a connection has located the mean of those positions, so
// that a track follows one point of the scene instead of the detector's grid.
void SharpenKeypoints(const std::vector<Connection>& connections,
                      const Camera& camera,
                      Features& features) {
  std::vector<Eigen::Vector2d> first(features.size());
  std::vector<Eigen::Vector2d> sum(features.size(), Eigen::Vector2d::Zero());
  std::vector<int> count(features.size(), 0);
  for (const Connection& connection : connections) {
    for (std::size_t k = 0; k < connection.keypoint_j_px.size(); ++k) {
      const int index = connection.matches.pairs[k][1];
      const Eigen::Vector2d& position = connection.keypoint_j_px[k];
      if (count[index] == 0) first[index] = position;
      if ((position - first[index]).norm() > kSameCornerPx) continue;
      sum[index] += position;
      ++count[index];
    }
  }
  for (int index = 0; index < features.size(); ++index) {
    if (count[index] == 0) continue;
    const Eigen::Vector2d position = sum[index] / count[index];
    const auto bearing = camera.Unproject(position);
    if (!bearing) continue;
    features.keypoints_px[index] = position;
    features.bearings[index] = *bearing;
  }
}

}  // namespace

std::optional<std::string> OdometryOptions::Problem() const {
  if (auto problem = ProblemIn("features", features)) return problem;
  if (auto problem = ProblemIn("matching", matching)) return problem;
  if (auto problem = ProblemIn("relative_rotation", relative_rotation)) return problem;
  if (auto problem = ProblemIn("view_graph", view_graph)) return problem;
  return ProblemIn("averaging", averaging);
}

RotationalOdometry::RotationalOdometry(const Camera& camera,
                                       const OdometryOptions& options,
                                       std::uint64_t seed,
                                       int num_threads)
    : camera_(camera), options_(options), seed_(seed), num_threads_(num_threads) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  if (const auto problem = options.Problem()) throw std::invalid_argument("options: " + *problem);
}

FrameReport RotationalOdometry::AddFrame(FrameId frame, double timestamp_s, const cv::Mat& image) {
  if (!result_.cam_from_world.empty() && frame <= result_.cam_from_world.rbegin()->first) {
    throw std::invalid_argument("RotationalOdometry: frame ids must ascend");
  }
  if (!timestamps_s_.empty() && !(timestamp_s > timestamps_s_.rbegin()->second)) {
    throw std::invalid_argument("RotationalOdometry: timestamps must ascend");
  }
  const bool sized = camera_.width > 0 && camera_.height > 0;
  if (sized && !image.empty() && (image.cols != camera_.width || image.rows != camera_.height)) {
    throw std::invalid_argument("RotationalOdometry: the image has not the camera's size");
  }
  FrameReport report;
  report.frame = frame;
  result_.cam_from_world[frame] = PredictOrientation(timestamp_s);
  timestamps_s_[frame] = timestamp_s;
  if (image.empty()) {
    report.predicted_only = true;
    return report;
  }

  View view;
  view.features = ExtractFeatures(image, frame, camera_, options_.features, num_threads_);
  view.pyramid = BuildPatchPyramid(ToGrey(image), options_.matching);
  report.num_features = view.features.size();

  std::vector<const View*> others;
  for (auto other = recent_.rbegin(); other != recent_.rend(); ++other) others.push_back(&*other);
  ConnectOptions connect_options{
      options_.features, options_.matching, options_.relative_rotation, seed_, num_threads_};
  std::vector<Connection> connections =
      ConnectView(view, others, result_.cam_from_world, camera_, connect_options);
  KeepGoodConnections(connections, report);
  SharpenKeypoints(connections, camera_, view.features);

  report.predicted_only = connections.empty() && result_.cam_from_world.size() > 1;
  StartFromBestEdge(frame, connections);
  for (Connection& connection : connections) {
    result_.graph.AddEdge(connection.edge);
    result_.edge_matches.push_back(std::move(connection.matches));
  }
  AverageWindow();

  Features kept = view.features;
  kept.descriptors.release();
  result_.features[frame] = std::move(kept);
  // A black or blurred frame is no partner for the next ones; those before it may still be.
  if (view.features.size() >= options_.relative_rotation.min_inliers) {
    recent_.push_back(std::move(view));
    if (static_cast<int>(recent_.size()) > options_.view_graph.window_frames) recent_.pop_front();
  }
  return report;
}

Rotation RotationalOdometry::PredictOrientation(double timestamp_s) const {
  if (result_.cam_from_world.empty()) return Rotation();
  const auto last = std::prev(result_.cam_from_world.end());
  if (last == result_.cam_from_world.begin()) return last->second;
  const auto before = std::prev(last);
  const double step_s = timestamps_s_.at(last->first) - timestamps_s_.at(before->first);
  const double ahead_s = timestamp_s - timestamps_s_.at(last->first);
  // After a gap in time the last turn says little; it is not drawn out beyond twice its length.
  const double steps = step_s > 0.0 ? std::clamp(ahead_s / step_s, 0.0, 2.0) : 1.0;
  const Rotation turn = last->second * before->second.Inverse();
  return Rotation::Exp(steps * turn.Log()) * last->second;
}

void RotationalOdometry::KeepGoodConnections(std::vector<Connection>& connections,
                                             FrameReport& report) const {
  const auto fewer_inliers = [](const Connection& a, const Connection& b) {
    return a.edge.num_inliers < b.edge.num_inliers;
  };
  const auto best = std::max_element(connections.begin(), connections.end(), fewer_inliers);
  if (best == connections.end()) return;
  report.num_inliers = best->edge.num_inliers;
  report.searched_wide =
      std::any_of(connections.begin(), connections.end(), [](const Connection& c) {
        return c.range != SearchRange::kGuided;
      });
  report.weak = best->edge.num_inliers <= options_.view_graph.min_edge_inliers;
  if (report.weak) {
    connections = {std::move(*best)};
  } else {
    std::erase_if(connections, [&](const Connection& connection) {
      return connection.edge.num_inliers <= options_.view_graph.min_edge_inliers;
    });
  }
  report.num_edges = static_cast<int>(connections.size());
}

void RotationalOdometry::StartFromBestEdge(FrameId frame,
                                           const std::vector<Connection>& connections) {
  const auto best = std::max_element(
      connections.begin(), connections.end(), [](const Connection& a, const Connection& b) {
        return a.edge.num_inliers < b.edge.num_inliers;
      });
  if (best == connections.end()) return;
  result_.cam_from_world[frame] = best->edge.j_from_i * result_.cam_from_world.at(best->edge.i);
}

void RotationalOdometry::AverageWindow() {
  std::set<FrameId> window;
  for (auto entry = result_.cam_from_world.rbegin(); entry != result_.cam_from_world.rend();
       ++entry) {
    if (static_cast<int>(window.size()) == options_.averaging.window) break;
    // The first frame defines the world.
    if (entry->first != result_.cam_from_world.begin()->first) window.insert(entry->first);
  }
  result_.cam_from_world = AverageRotations(
      result_.graph, std::move(result_.cam_from_world), window, options_.averaging);
}

}  // namespace rotslam
