#include "rotodom/loop/looped_odometry.h"

#include <memory>
#include <utility>

#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/frame_record.h"

namespace rotslam {
namespace {

// Loop closure needs the features of places only.
void DropFeaturesOfTracks(FrameRecord& record) {
  if (!record.corners) record.estimate.features = {};
  record.estimate.revised_features.clear();
  for (auto* connections :
       {&record.estimate.connections, &record.loops.connections, &record.loops.unconfirmed}) {
    for (EdgeWithMatches& connection : *connections) connection.matches.pairs.clear();
  }
  for (EdgeMatches& matches : record.loops.matches) matches.pairs.clear();
}

}  // namespace

LoopedOdometry::LoopedOdometry(const Camera& camera, const LoopedOdometryOptions& options)
    : odometry_(camera, options.odometry, options.seed, options.num_threads),
      window_(options.odometry.averaging.window),
      keep_features_(options.keep_features),
      orientations_(
          options.odometry.averaging, options.loops, options.keep_features, options.num_threads) {
  const OdometryOptions& odometry = options.odometry;
  // Without averaging the orientations are those of the odometry, chained.
  if (!options.loops.use_loops || odometry.averaging.mode == AveragingMode::kOff) return;
  closure_.emplace(
      camera,
      options.loops,
      odometry.features,
      VerificationTools{
          odometry.matching, odometry.relative_rotation, options.seed, options.num_threads},
      options.vocabulary ? options.vocabulary
                         : std::make_shared<const Vocabulary>(DefaultVocabulary()));
}

LoopedEstimate LoopedOdometry::AddFrame(FrameId frame,
                                        double timestamp_s,
                                        const MaskedImage& image,
                                        FrameRecord* record) {
  FrameEstimate estimate = odometry_.AddFrame(frame, timestamp_s, image);
  if (record != nullptr) *record = {estimate, std::nullopt, {}};
  orientations_.BeginFrame(estimate);
  LoopReport loops;
  if (closure_) {
    loops = closure_->AddFrame(estimate, image, result().cam_from_world, orientations_.pieces());
    if (record != nullptr) {
      record->loops = loops;
      if (const Features* corners = closure_->NewestCorners()) record->corners = *corners;
    }
  }
  if (record != nullptr && !keep_features_) DropFeaturesOfTracks(*record);
  return Take(std::move(estimate), std::move(loops));
}

LoopedEstimate LoopedOdometry::Replay(FrameRecord record) {
  orientations_.BeginFrame(record.estimate);
  if (closure_) {
    closure_->Replay(
        record.estimate, std::move(record.corners), record.loops, result().cam_from_world);
  }
  return Take(std::move(record.estimate), std::move(record.loops));
}

LoopedEstimate LoopedOdometry::Take(FrameEstimate estimate, LoopReport loops) {
  LoopedEstimate looped;
  looped.frame = estimate.frame;
  looped.covariance = estimate.covariance;
  looped.report = estimate.report;
  looped.points = {estimate.timestamp_s, estimate.features.tracks, estimate.features.keypoints_px};
  orientations_.AddFrame(std::move(estimate));
  orientations_.AddLoop(std::move(loops.connections));
  orientations_.AddMatches(std::move(loops.matches));
  looped.loops = std::move(loops.checks);
  looped.has_averaged = orientations_.EndFrame();
  looped.cam_from_world = result().cam_from_world.at(looped.frame);
  return looped;
}

std::vector<LoopCheck> LoopedOdometry::Finish() {
  LoopReport loops;
  if (closure_) loops = closure_->Finish(result().cam_from_world, orientations_.pieces());
  orientations_.AddLoop(std::move(loops.connections));
  orientations_.AddMatches(std::move(loops.matches));
  orientations_.Finish();
  // Covariances of the views that are still in the window are not final yet.
  int count = 0;
  for (auto entry = result().cam_from_world.rbegin();
       entry != result().cam_from_world.rend() && count < window_;
       ++entry, ++count) {
    if (const auto covariance = odometry_.CovarianceOf(entry->first)) {
      orientations_.SetCovariance(entry->first, *covariance);
    }
  }
  return loops.checks;
}

}  // namespace rotslam
