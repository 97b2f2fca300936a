#include "rotodom/odometry_archive.h"

namespace rotslam {

template <class Archive>
void RotationalOdometry::Transfer(Archive& archive) {
  // Each view once: a recent one may be a keyframe, too, and stays one object.
  std::map<FrameId, std::shared_ptr<View>> views;
  for (auto* list : {&recent_, &keyframes_}) {
    if constexpr (Archive::kIsReader) list->clear();
    std::vector<FrameId> frames;
    for (const std::shared_ptr<View>& view : *list) {
      frames.push_back(view->features.frame);
      views[frames.back()] = view;
    }
    archive(frames);
    if constexpr (!Archive::kIsReader) continue;
    for (const FrameId frame : frames) {
      const auto [entry, is_new] = views.try_emplace(frame);
      if (is_new) entry->second = std::make_shared<View>();
      list->push_back(entry->second);
    }
  }
  for (const auto& [frame, view] : views) {
    cv::Mat image = view->pyramid.levels.empty() ? cv::Mat() : view->pyramid.levels.front();
    archive(view->features, image, view->timestamp_s, view->flow_px_per_s, view->is_lost);
    if (Archive::kIsReader && !image.empty()) {
      view->pyramid = BuildPyramid(image, options_.features);
    }
  }
  archive(graph_, cam_from_world_, timestamps_s_, covariance_, seconds_, next_track_, exposure_);
}

std::string RotationalOdometry::SaveState() {
  ArchiveWriter archive;
  Transfer(archive);
  return archive.TakeBytes();
}

void RotationalOdometry::RestoreState(std::string_view state) {
  ArchiveReader archive(state);
  Transfer(archive);
  archive.ExpectEnd();
}

}  // namespace rotslam
