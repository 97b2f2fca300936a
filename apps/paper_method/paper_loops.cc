#include "apps/paper_method/paper_loops.h"

#include <algorithm>
#include <utility>

#include "rotodom/loop/default_vocabulary.h"

namespace rotslam {
namespace {

// Successive frames that must lead to the same places: one, and three that confirm it (ORB-SLAM2).
constexpr int kMinConsistent = 4;
// Level of the vocabulary whose nodes matches share: 100 nodes at a branching of ten (ORB-SLAM2).
constexpr int kIndexLevel = 2;

std::shared_ptr<const Vocabulary> OrDefault(std::shared_ptr<const Vocabulary> vocabulary) {
  return vocabulary ? std::move(vocabulary)
                    : std::make_shared<const Vocabulary>(DefaultVocabulary());
}

}  // namespace

PairMatches ToPairMatches(const OrbView& i,
                          const OrbView& j,
                          const std::vector<std::array<int, 2>>& pairs) {
  PairMatches matches{i.frame, j.frame, {}};
  matches.pairs.reserve(pairs.size());
  for (const auto& [in_i, in_j] : pairs) {
    matches.pairs.push_back({i.bearings[in_i], j.bearings[in_j]});
  }
  return matches;
}

PaperLoops::PaperLoops(std::shared_ptr<const Vocabulary> vocabulary,
                       const CandidateOptions& candidates,
                       const MatchingOptions& matching)
    : vocabulary_(OrDefault(std::move(vocabulary))),
      finder_(vocabulary_->num_words(), candidates),
      matching_(matching) {}

std::vector<PaperLoop> PaperLoops::AddFrame(std::shared_ptr<const OrbView> view,
                                            const std::vector<FrameId>& neighbours) {
  const int levels_up = std::max(0, vocabulary_->tree().depth - kIndexLevel);
  ImageWords words = vocabulary_->Transform(view->descriptors, levels_up);
  std::vector<PaperLoop> loops;
  for (const LoopCandidate& candidate : finder_.AddPlace(view->frame, words.bag, neighbours)) {
    if (candidate.num_consistent < kMinConsistent) continue;
    const Place& place = places_.at(candidate.frame);
    loops.push_back(
        {candidate,
         ToPairMatches(*place.view,
                       *view,
                       MatchByWords(*place.view, place.words, *view, words.index, matching_))});
  }
  const FrameId frame = view->frame;
  places_.emplace(frame, Place{std::move(view), std::move(words.index)});
  return loops;
}

}  // namespace rotslam
