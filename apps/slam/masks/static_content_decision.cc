#include "apps/slam/masks/static_content_decision.h"

#include <algorithm>

#include "rotodom/types/archive.h"

namespace rotslam {
namespace {

bool HasRotated(const RotationMap& cam_from_world) {
  constexpr double kEnough_deg = 3.0;  // moves what is far away by some widths of an edge
  return std::any_of(cam_from_world.begin(), cam_from_world.end(), [&](const auto& entry) {
    return (entry.second * cam_from_world.begin()->second.Inverse()).AngleDeg() > kEnough_deg;
  });
}

}  // namespace

StaticContent StaticContentDecision::Decide(const RotationMap& cam_from_world) {
  if (!is_on_ || known_.kind != StaticContentKind::kNone || !finder_.IsDue() ||
      !finder_.HasNews()) {
    return {};
  }
  StaticContent found = finder_.Find(HasRotated(cam_from_world));
  // A camera that seems to stand may move later.
  if (found.kind != StaticContentKind::kOnPicture || !IsNew(found)) return {};
  return found;
}

StaticContent StaticContentDecision::Finish(const RotationMap& cam_from_world) {
  if (!is_on_) return {};
  StaticContent found = finder_.Find(HasRotated(cam_from_world));
  if (found.kind == StaticContentKind::kStanding) return found;
  const bool is_known = known_.kind != StaticContentKind::kNone;
  if (is_known || found.kind == StaticContentKind::kNone || !IsNew(found)) return {};
  return found;
}

bool StaticContentDecision::IsNew(const StaticContent& content) const {
  constexpr double kSameShare = 0.8;
  const double share = content.mask.Share();
  return Union(content.mask, ignored_).Share() - ignored_.Share() > (1.0 - kSameShare) * share;
}

std::string StaticContentDecision::SaveState() {
  ArchiveWriter archive;
  archive(finder_);
  return archive.TakeBytes();
}

void StaticContentDecision::RestoreState(std::string_view state) {
  ArchiveReader archive(state);
  archive(finder_);
  archive.ExpectEnd();
}

}  // namespace rotslam
