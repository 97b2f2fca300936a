#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "apps/slam/live/growing_map.h"
#include "apps/slam/live/keyframe_chain.h"
#include "apps/slam/live/live_map.h"
#include "apps/slam/live/mapper_input.h"
#include "apps/slam/options.h"
#include "rotodom/camera/camera.h"

namespace rotslam {

/// Grows a map keyframe by keyframe: known rotation for the new view and points, then bundle
/// adjustment of the newest keyframes. The first component, and a new one where a pure rotation has
/// led to an entirely new view, is built from the known rotations of at least three keyframes with
/// parallax. The cost of a keyframe does not depend on how many there were before, except for
/// copying the points. Where a loop closes, all keyframes and points move (CloseLinks), and the
/// newest keyframes are adjusted against the older ones that see the same points.
class LiveMapper {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  LiveMapper(const Camera& camera, const SlamOptions& options);

  /// @return  the map after it; null as long as there is none.
  std::shared_ptr<const LiveMap> AddKeyframe(const KeyframeInput& input);

  /// Moves the map to where loops say, if it contradicts them, and ties the newest keyframes to the
  /// older places that they see.
  /// @return  the map after it; null as long as there is none.
  std::shared_ptr<const LiveMap> CloseLoops(const LoopInput& input);

 private:
  // The component to which keyframes are being added.
  struct NewestComponent {
    int number = 0;
    std::optional<FrameId> first;  // keyframe
    bool is_settled = false;       // until then it is built anew with every keyframe
    Eigen::Vector3d center_in_world = Eigen::Vector3d::Zero();  // of its first keyframe
    double depth = 1.0;  // median, that its first keyframe is to have
  };

  bool PlaceNewest();
  // Places the newest keyframe by the points of the map.
  bool Extend();
  void BeginComponent();
  bool BuildNewestComponent();
  void AdjustWindow();
  void MoveMap(const KeyframeMoves& moves);
  void JoinLinked(const std::vector<PlaceLink>& links);
  void Publish();

  Camera camera_;
  KrotOptions krot_options_;
  BundleOptions window_options_;
  BundleOptions component_options_;

  GrowingMap map_;
  NewestComponent newest_;
  int num_components_ = 1;
  double depth_ = 0.0;  // median, from the newest keyframe that sees points
  std::vector<std::pair<FrameId, FrameId>> links_;  // closed loops: older and newer keyframe
  int revision_ = 0;
  std::shared_ptr<const LiveMap> published_;
};

}  // namespace rotslam
