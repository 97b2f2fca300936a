#include "apps/slam/observer.h"

namespace rotslam {

const char* ToString(SlamStage stage) {
  switch (stage) {
    case SlamStage::kOrientations:
      return "orientations";
    case SlamStage::kTracks:
      return "tracks";
    case SlamStage::kKnownRotation:
      return "known rotation";
    case SlamStage::kBundleAdjustment:
      return "bundle adjustment";
    case SlamStage::kPureRotation:
      return "pure rotation";
    case SlamStage::kFrameRegistration:
      return "frames between keyframes";
    case SlamStage::kCloud:
      return "cloud";
  }
  return "";
}

}  // namespace rotslam
