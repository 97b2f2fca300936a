#pragma once

#include <compare>
#include <cstddef>
#include <functional>

namespace rotslam {

/// An index that cannot be mistaken for an index of another kind.
template <class Tag>
struct Id {
  int value = -1;
  constexpr auto operator<=>(const Id&) const = default;
};

using FrameId =
    Id<struct FrameTag>;  // input frame, 0 is the first frame read; also a view of the view-graph
using TrackId = Id<struct TrackTag>;           // one scene point seen in several frames
using KeypointIndex = Id<struct KeypointTag>;  // position in one frame's `Features`

}  // namespace rotslam

template <class Tag>
struct std::hash<rotslam::Id<Tag>> {
  std::size_t operator()(const rotslam::Id<Tag>& id) const noexcept {
    return std::hash<int>{}(id.value);
  }
};
