#pragma once

#include <map>
#include <memory>
#include <vector>

#include "apps/paper_method/paper_graph.h"
#include "apps/paper_method/window_matching.h"
#include "rotodom/loop/candidates.h"
#include "rotodom/loop/vocabulary.h"

namespace rotslam {

/// A place that looks like the newest frame, and the matches with it.
struct PaperLoop {
  LoopCandidate candidate;
  PairMatches matches;
};

/// The paper's search for loops: every frame is a place, described by visual words; places that
/// look like the newest frame become candidates by ORB-SLAM2's rules, in four frames one after
/// another, and are matched by words.
/// Memory:  110 bytes a feature, 440 KB a frame with 4,000.
/// Source:  the paper, sec. IV-F; Mur-Artal & Tardos, ICRA 2014 (CandidateFinder).
class PaperLoops {
 public:
  /// @param vocabulary  null: DefaultVocabulary.
  PaperLoops(std::shared_ptr<const Vocabulary> vocabulary,
             const CandidateOptions& candidates,
             const MatchingOptions& matching);

  /// Adds the next frame and finds the places that look like it.
  /// @param view        of the frame; kept.
  /// @param neighbours  frames that it has edges with.
  std::vector<PaperLoop> AddFrame(std::shared_ptr<const OrbView> view,
                                  const std::vector<FrameId>& neighbours);

  /// Makes two frames neighbours, once a loop has joined them.
  void Join(FrameId a, FrameId b) { finder_.Join(a, b); }

  int num_places() const { return static_cast<int>(places_.size()); }

 private:
  struct Place {
    std::shared_ptr<const OrbView> view;
    DirectIndex words;
  };

  std::shared_ptr<const Vocabulary> vocabulary_;
  CandidateFinder finder_;
  MatchingOptions matching_;
  std::map<FrameId, Place> places_;
};

/// The bearings of matched features.
PairMatches ToPairMatches(const OrbView& i,
                          const OrbView& j,
                          const std::vector<std::array<int, 2>>& pairs);

}  // namespace rotslam
