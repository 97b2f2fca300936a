#include "rotodom/odometry.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "rotodom/motion_blur/blurred_patch.h"
#include "rotodom/motion_blur/keypoint_blur.h"
#include "rotodom/tracking/robust_tracking.h"
#include "rotodom/types/options.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

const EdgeWithMatches* BestOf(const std::vector<EdgeWithMatches>& connections) {
  const auto best = std::max_element(connections.begin(),
                                     connections.end(),
                                     [](const EdgeWithMatches& a, const EdgeWithMatches& b) {
                                       return a.edge.num_inliers < b.edge.num_inliers;
                                     });
  return best == connections.end() ? nullptr : &*best;
}

// An edge needs this share of the points that both views show. Points are looked for where they are
// expected, so chance alone makes up to a third of wrong ones agree; of right ones nine in ten do,
// at old keyframes two in three.
constexpr double kMinInlierRatio = 0.5;
// Keyframes remembered; each costs the memory of its features.
constexpr int kMaxKeyframes = 8;

// Whether enough of the points that both views show agree on the edge.
bool IsBelieved(const EdgeWithMatches& connection) {
  const double num_common =
      connection.edge.num_inliers + static_cast<double>(connection.outliers_j.size());
  return connection.edge.num_inliers > kMinInlierRatio * num_common;
}

// A point that more edges refute than confirm is followed no longer.
void MarkLostPoints(const std::vector<EdgeWithMatches>& connections, View& view) {
  std::vector<int> votes(view.features.size(), 0);
  for (const EdgeWithMatches& connection : connections) {
    for (const auto& [i, j] : connection.matches.pairs) ++votes[j];
    for (const int j : connection.outliers_j) --votes[j];
  }
  view.is_lost.assign(view.features.size(), false);
  for (std::size_t n = 0; n < votes.size(); ++n) view.is_lost[n] = votes[n] < 0;
}

// Gives later stages, which know of no shutter, the keypoints that a global one would have seen.
void MoveToBearings(const Camera& camera, Features& features) {
  for (int n = 0; n < features.size(); ++n) {
    const auto keypoint_px = camera.Project(features.bearings[n]);
    if (keypoint_px) features.keypoints_px[n] = *keypoint_px;
  }
}

// Deviations of a radian and more mean that nothing is known.
std::optional<Eigen::Matrix3d> UnlessUnknown(std::optional<Eigen::Matrix3d> covariance) {
  if (!covariance || covariance->trace() > 3.0) return std::nullopt;
  return covariance;
}

}  // namespace

std::optional<std::string> OdometryOptions::Problem() const {
  if (auto problem = ProblemIn("features", features)) return problem;
  if (auto problem = ProblemIn("matching", matching)) return problem;
  if (auto problem = ProblemIn("tracking", tracking)) return problem;
  if (auto problem = ProblemIn("relative_rotation", relative_rotation)) return problem;
  if (auto problem = ProblemIn("view_graph", view_graph)) return problem;
  return ProblemIn("averaging", averaging);
}

RotationalOdometry::RotationalOdometry(const Camera& camera,
                                       const OdometryOptions& options,
                                       std::uint64_t seed,
                                       int num_threads)
    : camera_(camera),
      options_(options),
      seed_(seed),
      num_threads_(num_threads),
      covariance_(options.averaging) {
  if (const auto problem = camera.Problem()) throw std::invalid_argument("camera: " + *problem);
  if (const auto problem = options.Problem()) throw std::invalid_argument("options: " + *problem);
}

void RotationalOdometry::CheckNext(FrameId frame, double timestamp_s, const cv::Mat& image) const {
  if (!cam_from_world_.empty() && frame <= cam_from_world_.rbegin()->first) {
    throw std::invalid_argument("RotationalOdometry: frame ids must ascend");
  }
  if (!timestamps_s_.empty() && !(timestamp_s > timestamps_s_.rbegin()->second)) {
    throw std::invalid_argument("RotationalOdometry: timestamps must ascend");
  }
  const bool sized = camera_.width > 0 && camera_.height > 0;
  if (sized && !image.empty() && (image.cols != camera_.width || image.rows != camera_.height)) {
    throw std::invalid_argument("RotationalOdometry: the image has not the camera's size");
  }
}

FrameEstimate RotationalOdometry::AddFrame(FrameId frame,
                                           double timestamp_s,
                                           const MaskedImage& masked) {
  const cv::Mat& image = masked.image;
  CheckNext(frame, timestamp_s, image);
  FrameEstimate estimate;
  estimate.frame = frame;
  estimate.timestamp_s = timestamp_s;
  estimate.cam_from_world = PredictOrientation(timestamp_s);
  if (image.empty()) {
    estimate.report.predicted_only = true;
    cam_from_world_[frame] = estimate.cam_from_world;
    timestamps_s_[frame] = timestamp_s;
    AverageWindow(estimate);
    UpdateCovariance(estimate);
    DropOldViews();
    return estimate;
  }

  const auto view = std::make_shared<View>();
  view->timestamp_s = timestamp_s;
  view->features.frame = frame;
  view->pyramid = BuildPyramidOf(masked);

  const std::vector<OrientedView> recent = RecentViews();
  const TrackingTarget target{&view->pyramid,
                              timestamp_s,
                              estimate.cam_from_world,
                              NewestMotion(timestamp_s, estimate.cam_from_world),
                              nullptr,
                              ExposureToMatch(),
                              options_.features.max_features};
  const TrackingResult tracked = Track(recent, target, estimate);
  AppendTracked(tracked, recent, *view);
  estimate.report.num_tracked = view->features.size();
  DetectNewFeatures(image, *view);

  cam_from_world_[frame] = tracked.cam_from_world;
  timestamps_s_[frame] = timestamp_s;
  if (camera_.readout_s > 0.0) {
    view->seen_bearings = view->features.bearings;
    CorrectRollingShutters(*view, estimate);
  }
  Connect(*view, estimate);
  MarkLostPoints(estimate.connections, *view);
  KeepGoodEdges(estimate);
  AverageWindow(estimate);
  UpdateCovariance(estimate);
  MeasureExposure();
  DropOldViews();
  UpdateFlow(tracked, recent, *view);

  estimate.features = view->features;
  if (camera_.readout_s > 0.0) MoveToBearings(camera_, estimate.features);
  UpdateKeyframes(view);
  return estimate;
}

ImagePyramid RotationalOdometry::BuildPyramidOf(const MaskedImage& image) {
  const Stopwatch stopwatch(seconds_.pyramid);
  return BuildPyramid(ToGrey(image.image), options_.features, image.mask);
}

Rotation RotationalOdometry::PredictOrientation(double timestamp_s) const {
  if (cam_from_world_.empty()) return Rotation();
  // Frames without an edge have been predicted themselves.
  auto last = std::prev(cam_from_world_.end());
  while (last != cam_from_world_.begin() && graph_.EdgesOf(last->first).empty()) --last;
  if (last == cam_from_world_.begin()) return cam_from_world_.rbegin()->second;
  const auto before = std::prev(last);
  const double step_s = timestamps_s_.at(last->first) - timestamps_s_.at(before->first);
  const double ahead_s = timestamp_s - timestamps_s_.at(last->first);
  // After a gap in time the last turn says little; it is not drawn out beyond twice its length.
  const double steps = step_s > 0.0 ? std::clamp(ahead_s / step_s, 0.0, 2.0) : 1.0;
  const Rotation turn = last->second * before->second.Inverse();
  return Rotation::Exp(steps * turn.Log()) * last->second;
}

AngularMotion RotationalOdometry::NewestMotion(double timestamp_s,
                                               const Rotation& cam_from_world) const {
  if (cam_from_world_.empty()) return {};
  const auto& [frame, rotation] = *cam_from_world_.rbegin();
  const TimedOrientation before{timestamps_s_.at(frame), rotation};
  return MotionThrough({timestamp_s, cam_from_world}, {&before, 1});
}

std::vector<OrientedView> RotationalOdometry::RecentViews() const {
  std::vector<OrientedView> views;
  for (const std::shared_ptr<View>& view : recent_) {
    views.push_back({view.get(), cam_from_world_.at(view->features.frame)});
  }
  return views;
}

TrackingResult RotationalOdometry::Track(const std::vector<OrientedView>& views,
                                         const TrackingTarget& target,
                                         FrameEstimate& estimate) {
  const Stopwatch stopwatch(seconds_.tracking);
  RobustTracking robust = TrackOrRecover(views,
                                         target,
                                         camera_,
                                         {options_.features,
                                          options_.matching,
                                          options_.relative_rotation,
                                          options_.tracking,
                                          kMinInlierRatio,
                                          seed_,
                                          num_threads_});
  estimate.report.searched_wide = robust.searched_wide;
  return std::move(robust.tracked);
}

void RotationalOdometry::AppendTracked(const TrackingResult& tracked,
                                       const std::vector<OrientedView>& views,
                                       View& view) const {
  Features& features = view.features;
  for (const TrackedPoint& point : tracked.points) {
    const auto bearing = camera_.Unproject(point.keypoint_px);
    if (!bearing) continue;
    const View& from = *views[point.view].view;
    features.keypoints_px.push_back(point.keypoint_px);
    features.bearings.push_back(*bearing);
    features.levels.push_back(from.features.levels[point.index]);
    features.rgb.push_back(from.features.rgb[point.index]);
    features.tracks.push_back(point.track);
    features.covariances_px.emplace_back(point.covariance_px.cast<float>());
  }
}

void RotationalOdometry::DetectNewFeatures(const cv::Mat& image, View& view) {
  const Stopwatch stopwatch(seconds_.detection);
  Features& features = view.features;
  const int num_tracked = features.size();
  DetectFeatures(view.pyramid, camera_, options_.features, num_threads_, features);
  ColourFeatures(image, features, num_tracked);
  for (int n = num_tracked; n < features.size(); ++n) {
    features.tracks.push_back(TrackId{next_track_++});
    // Its place is its patch's: it errs only where the patch is found again.
    features.covariances_px.emplace_back(Eigen::Matrix2f::Zero());
  }
}

void RotationalOdometry::CorrectRollingShutterOf(View& view,
                                                 const std::vector<const View*>& others) const {
  const auto time_s = [&](FrameId frame) { return timestamps_s_.at(frame); };
  const MotionEstimate believed =
      EstimateMotionAt(view.features.frame, cam_from_world_, time_s, camera_.readout_s);
  view.features.shared_error_px = believed.TypicalErrorRad() * camera_.MeanFocal();
  CorrectRollingShutter(camera_, believed.motion, others, num_threads_, view);
}

void RotationalOdometry::CorrectRollingShutters(View& view, FrameEstimate& estimate) {
  const int num_recent = static_cast<int>(recent_.size());
  if (num_recent == 0) return;
  const Stopwatch stopwatch(seconds_.edges);
  // Of position k in recent_; before the first there is the present view.
  const auto at = [&](int k) { return k < 0 ? &view : recent_[k].get(); };
  std::vector<const View*> older = {at(0)};
  if (num_recent > 1) older.push_back(at(1));
  CorrectRollingShutterOf(view, older);
  // The view before can now be seen from both sides, and the very first ones from further on.
  const int num_revised = num_recent < options_.view_graph.window_frames ? num_recent : 1;
  for (int k = 0; k < num_revised; ++k) {
    std::vector<const View*> others = {at(k - 1)};
    if (k + 1 < num_recent) {
      others.push_back(at(k + 1));
    } else if (k > 0) {
      others.push_back(at(k - 2));
    }
    CorrectRollingShutterOf(*at(k), others);
    MoveToBearings(camera_, estimate.revised_features.emplace_back(at(k)->features));
  }
  for (int k = num_revised - 1; k >= 0; --k) {
    const Features& revised = at(k)->features;
    for (const EdgeWithMatches& connection : MeasureEdgesAgain(revised)) {
      if (!IsBelieved(connection)) continue;
      graph_.AddEdge(connection.edge);
      estimate.revised_edges.push_back(connection.edge);
    }
  }
}

std::vector<EdgeWithMatches> RotationalOdometry::MeasureEdgesAgain(const Features& view) const {
  std::vector<const Features*> partners;
  std::vector<RelativeRotation> known;
  for (const int index : graph_.EdgesOf(view.frame)) {
    const RelativeRotation& edge = graph_.edges()[index];
    if (edge.i == view.frame) continue;
    for (const auto* views : {&recent_, &keyframes_}) {
      const auto partner = std::find_if(views->begin(), views->end(), [&](const auto& candidate) {
        return candidate->features.frame == edge.i;
      });
      if (partner == views->end()) continue;
      partners.push_back(&(*partner)->features);
      known.push_back(edge);
      break;
    }
  }
  return UpdateEdges(view,
                     partners,
                     known,
                     cam_from_world_,
                     camera_.MeanFocal(),
                     {options_.relative_rotation, seed_, num_threads_});
}

void RotationalOdometry::Connect(const View& view, FrameEstimate& estimate) {
  const Stopwatch stopwatch(seconds_.edges);
  estimate.connections = EstimateEdges(view.features,
                                       Partners(view),
                                       cam_from_world_,
                                       camera_.MeanFocal(),
                                       {options_.relative_rotation, seed_, num_threads_});
}

std::vector<const Features*> RotationalOdometry::Partners(const View& view) const {
  std::vector<const Features*> partners;
  for (const std::shared_ptr<View>& recent : recent_) partners.push_back(&recent->features);
  const auto num_recent = partners.size();
  // The oldest keyframes reach furthest.
  for (auto keyframe = keyframes_.rbegin(); keyframe != keyframes_.rend(); ++keyframe) {
    const auto num_keyframes = partners.size() - num_recent;
    if (num_keyframes >= static_cast<std::size_t>(options_.view_graph.max_keyframe_edges)) break;
    const bool is_recent = std::find(recent_.begin(), recent_.end(), *keyframe) != recent_.end();
    if (is_recent || CountCommonTracks((*keyframe)->features, view.features) <=
                         options_.view_graph.min_edge_inliers) {
      continue;
    }
    partners.push_back(&(*keyframe)->features);
  }
  return partners;
}

void RotationalOdometry::KeepGoodEdges(FrameEstimate& estimate) const {
  std::vector<EdgeWithMatches>& connections = estimate.connections;
  std::erase_if(connections,
                [&](const EdgeWithMatches& connection) { return !IsBelieved(connection); });
  const int min_inliers = options_.view_graph.min_edge_inliers;
  const EdgeWithMatches* best = BestOf(connections);
  estimate.report.predicted_only = best == nullptr && cam_from_world_.size() > 1;
  if (best == nullptr) return;
  estimate.report.num_inliers = best->edge.num_inliers;
  estimate.report.weak = best->edge.num_inliers <= min_inliers;
  if (estimate.report.weak) {
    connections = {EdgeWithMatches(*best)};
  } else {
    std::erase_if(connections, [&](const EdgeWithMatches& connection) {
      return connection.edge.num_inliers <= min_inliers;
    });
  }
}

void RotationalOdometry::AverageWindow(FrameEstimate& estimate) {
  const Stopwatch stopwatch(seconds_.averaging);
  const EdgeWithMatches* best = BestOf(estimate.connections);
  if (best != nullptr) {
    cam_from_world_[estimate.frame] = best->edge.j_from_i * cam_from_world_.at(best->edge.i);
  }
  for (const EdgeWithMatches& connection : estimate.connections) graph_.AddEdge(connection.edge);
  const std::set<FrameId> free_views = ViewsToAverage(cam_from_world_, options_.averaging);
  estimate.window = AverageRotations(graph_, cam_from_world_, free_views, options_.averaging);
  estimate.window.try_emplace(estimate.frame, cam_from_world_.at(estimate.frame));
  for (const auto& [frame, rotation] : estimate.window) cam_from_world_[frame] = rotation;
  estimate.cam_from_world = cam_from_world_.at(estimate.frame);
}

void RotationalOdometry::UpdateCovariance(FrameEstimate& estimate) {
  const Stopwatch stopwatch(seconds_.covariance);
  // A frame that nothing ties to others says nothing, and must not age what is remembered of them.
  // Of a handful of matches found anywhere in the image, nobody knows how wrong they are: 2 deg
  // after a gap of two seconds, at a standard deviation of 0.15.
  const FrameReport& report = estimate.report;
  const bool is_tied = !estimate.connections.empty() && !(report.weak && report.searched_wide);
  if (!is_tied && cam_from_world_.size() > 1) return;
  std::set<FrameId> free_views = ViewsToAverage(cam_from_world_, options_.averaging);
  const EdgeWithMatches* best = BestOf(estimate.connections);
  std::vector<SupportedEdge> edges;
  const bool is_chained = options_.averaging.mode == AveragingMode::kOff;
  for (const EdgeWithMatches& connection : estimate.connections) {
    if (is_chained && &connection != best) continue;
    edges.push_back({connection.edge, connection.matches.pairs});
  }
  if (is_chained && best != nullptr) free_views = {estimate.frame};
  while (static_cast<int>(free_views.size()) > options_.averaging.window) {
    free_views.erase(free_views.begin());
  }
  covariance_.AddView(estimate.frame, edges, cam_from_world_, free_views);
  estimate.covariance = CovarianceOf(estimate.frame);
  // The view that the next frame will push out of the window has its last change behind it.
  if (!free_views.empty()) {
    estimate.settled = *free_views.begin();
    estimate.settled_covariance = CovarianceOf(estimate.settled);
  }
}

std::optional<Eigen::Matrix3d> RotationalOdometry::CovarianceOf(FrameId frame) const {
  return UnlessUnknown(covariance_.Of(frame));
}

std::optional<Eigen::Matrix3d> RotationalOdometry::CovarianceBetween(FrameId i, FrameId j) const {
  return UnlessUnknown(covariance_.Between(i, j));
}

double RotationalOdometry::ExposureToMatch() const {
  return camera_.readout_s > 0.0 ? 0.0 : exposure_.Seconds();
}

void RotationalOdometry::MeasureExposure() {
  if (!options_.tracking.match_blur || recent_.empty()) return;
  const Stopwatch stopwatch(seconds_.tracking);
  const auto time_s = [&](FrameId frame) { return timestamps_s_.at(frame); };
  const auto rotating = [&](const View& view) -> std::optional<RotatingView> {
    const FrameId frame = view.features.frame;
    const auto rate = RateOf(frame, cam_from_world_, time_s, kFarthestFrameForBlur_s);
    if (!rate) return std::nullopt;
    return RotatingView{{&view, cam_from_world_.at(frame)}, *rate};
  };
  const auto newest = rotating(*recent_.front());
  if (!newest) return;
  std::optional<RotatingView> most_different;
  double largest = 0.0;
  for (const std::shared_ptr<View>& view : recent_) {
    const auto other = rotating(*view);
    if (!other || !ExposureMeter::IsInformative(other->rate, newest->rate, camera_.MeanFocal()))
      continue;
    const double difference = std::abs(other->rate.norm() - newest->rate.norm());
    if (difference <= largest) continue;
    largest = difference;
    most_different = other;
  }
  if (most_different) exposure_.Add(camera_, *most_different, *newest, num_threads_);
}

void RotationalOdometry::DropOldViews() {
  if (options_.averaging.mode == AveragingMode::kGlobal) return;
  // Now and then is enough: a multiple of what is needed is still bounded.
  const std::size_t needed = static_cast<std::size_t>(options_.averaging.window) + 2;
  if (cam_from_world_.size() < 4 * (needed + keyframes_.size())) return;
  std::set<FrameId> kept;
  for (const auto* views : {&recent_, &keyframes_}) {
    for (const std::shared_ptr<View>& view : *views) kept.insert(view->features.frame);
  }
  const FrameId oldest_free =
      std::prev(cam_from_world_.end(), static_cast<std::ptrdiff_t>(needed))->first;
  ViewGraph graph;
  for (const RelativeRotation& edge : graph_.edges()) {
    if (edge.j < oldest_free) continue;
    graph.AddEdge(edge);
    kept.insert({edge.i, edge.j});
  }
  graph_ = std::move(graph);
  std::erase_if(cam_from_world_, [&](const auto& entry) {
    return entry.first < oldest_free && !kept.contains(entry.first) &&
           !covariance_.Holds(entry.first);
  });
  std::erase_if(timestamps_s_,
                [&](const auto& entry) { return !cam_from_world_.contains(entry.first); });
}

void RotationalOdometry::UpdateFlow(const TrackingResult& tracked,
                                    const std::vector<OrientedView>& views,
                                    View& view) const {
  const cv::Mat& image = view.pyramid.levels.front();
  FlowField field(image.cols, image.rows);
  const Rotation& view_from_world = cam_from_world_.at(view.features.frame);
  view.flow_px_per_s.assign(view.features.size(), Eigen::Vector2d::Zero());
  std::size_t point = 0;
  int n = 0;
  for (; n < view.features.size(); ++n) {
    while (point < tracked.points.size() && tracked.points[point].track < view.features.tracks[n]) {
      ++point;
    }
    if (point == tracked.points.size()) break;
    const TrackedPoint& from = tracked.points[point];
    if (from.track != view.features.tracks[n] || view.is_lost[n]) continue;
    const View& from_view = *views[from.view].view;
    const Rotation& from_from_world = cam_from_world_.at(from_view.features.frame);
    const auto turned_px = camera_.Project(
        view_from_world * (from_from_world.Inverse() * from_view.features.bearings[from.index]));
    const auto here_px = camera_.Project(view.features.bearings[n]);
    if (!turned_px || !here_px) continue;
    view.flow_px_per_s[n] = (*here_px - *turned_px) / (view.timestamp_s - from_view.timestamp_s);
    field.Add(view.features.keypoints_px[n], view.flow_px_per_s[n]);
  }
  for (; n < view.features.size(); ++n) {
    view.flow_px_per_s[n] = field.At(view.features.keypoints_px[n]);
  }
}

void RotationalOdometry::UpdateKeyframes(std::shared_ptr<View> view) {
  // A black or blurred frame is no partner for the next ones; those before it may still be.
  if (view->features.size() < options_.relative_rotation.min_inliers) return;
  const auto is_connected = [&](const View& v) {
    return !graph_.EdgesOf(v.features.frame).empty();
  };
  const bool is_keyframe =
      keyframes_.empty() ||
      (is_connected(*view) && CountCommonTracks(keyframes_.front()->features, view->features) <
                                  options_.view_graph.keyframe_overlap * view->features.size());
  if (is_keyframe) {
    keyframes_.push_front(view);
    if (static_cast<int>(keyframes_.size()) > kMaxKeyframes) {
      keyframes_.pop_back();
    }
  }
  if (static_cast<int>(recent_.size()) == options_.view_graph.window_frames) {
    // A frame that matches nothing, as with a hand before the lens, must not replace frames whose
    // points may be seen again.
    if (is_connected(*recent_.front())) {
      // Of a keyframe only the features are asked for.
      recent_.back()->pyramid = {};
      recent_.back()->seen_bearings = {};
      recent_.pop_back();
    } else {
      recent_.pop_front();
    }
  }
  recent_.push_front(std::move(view));
}

void OdometryResult::Add(FrameEstimate estimate, bool keep_features) {
  for (const auto& [frame, rotation] : estimate.window) cam_from_world[frame] = rotation;
  for (const RelativeRotation& edge : estimate.revised_edges) graph.AddEdge(edge);
  for (EdgeWithMatches& connection : estimate.connections) {
    graph.AddEdge(connection.edge);
    if (keep_features) edge_matches.push_back(std::move(connection.matches));
  }
  if (keep_features) {
    for (Features& revised : estimate.revised_features) {
      const FrameId frame = revised.frame;
      features[frame] = std::move(revised);
    }
    features[estimate.frame] = std::move(estimate.features);
  }
  if (estimate.covariance) covariance[estimate.frame] = *estimate.covariance;
  if (estimate.settled_covariance) covariance[estimate.settled] = *estimate.settled_covariance;
}

}  // namespace rotslam
