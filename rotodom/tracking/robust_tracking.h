#pragma once

#include <span>

#include "rotodom/tracking/recovery.h"
#include "rotodom/tracking/tracking.h"

namespace rotslam {

/// The result of TrackOrRecover.
struct RobustTracking {
  TrackingResult tracked;      // without points where none can be trusted
  bool searched_wide = false;  // TrackPoints found too little
};

/// TrackPoints. Where that finds too little, RecoverMotion gives a second prediction to track from,
/// and matches of its own. Of these results the one is taken of which most points of one view agree
/// on a relative rotation; a result whose rotation contradicts that of clear descriptor matches is
/// left out, since patches that look alike can be found in wrong places all together.
/// @param views  newest first.
RobustTracking TrackOrRecover(std::span<const OrientedView> views,
                              const TrackingTarget& target,
                              const Camera& camera,
                              const RecoveryOptions& options);

}  // namespace rotslam
