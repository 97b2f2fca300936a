#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "rotodom/loop/place_database.h"
#include "rotodom/loop/vocabulary.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// When an old place looks enough like the new frame to be compared.
struct CandidateOptions {
  // A frame is no loop of the ones that came up to this many frames before it.
  int recent_frames = 10;
  // Only places with more than this part of the most common words are looked at.
  double common_words_ratio = 0.8;
  // Of the groups of places that see the same scene, those whose scores add up to more than this
  // part of the best group's.
  double group_score_ratio = 0.75;
  // Neighbours whose scores are added to a place's own.
  int group_size = 10;

  std::optional<std::string> Problem() const;

  // Not configuration: the members that are not visited; programs and tests set them.
  template <class Visitor>
  void Visit(Visitor&& visit) {
    visit("recent_frames", recent_frames);
  }
};

/// An older place that is similar to the present one.
struct LoopCandidate {
  FrameId frame;
  double score = 0.0;        // Score() of the two bags
  double group_score = 0.0;  // sum with the scores of its neighbours
  // Number of successive places that led to the same group, including this one.
  int num_consistent = 0;
};

/// Stores places and their neighbours, and finds those that are similar to a new one.
/// Memory: PlaceDatabase's.
/// Source:  Mur-Artal & Tardos, Fast Relocalisation and Loop Closing in Keyframe-Based SLAM, ICRA
/// 2014: score relative to the neighbours', groups of covisible places, temporal consistency.
class CandidateFinder {
 public:
  /// Throws std::invalid_argument when an option is out of range.
  CandidateFinder(int num_words, const CandidateOptions& options);

  /// Adds a place and finds similar ones, best group first.
  /// @param neighbours  older places with common points, those with most first.
  std::vector<LoopCandidate> AddPlace(FrameId frame,
                                      const BagOfWords& bag,
                                      const std::vector<FrameId>& neighbours);

  /// Makes the two places neighbours.
  void Join(FrameId a, FrameId b);

  /// Neighbours in the order of AddPlace, followed by those of Join().
  const std::vector<FrameId>& NeighboursOf(FrameId place) const;

 private:
  // Neighbouring places, and the number of successive places that led to some of them.
  struct Group {
    std::set<FrameId> places;
    int num_consistent = 0;
  };
  std::vector<LoopCandidate> BestOfGroups(const std::vector<PlaceMatch>& matches) const;
  void CheckConsistency(std::vector<LoopCandidate>& candidates);

  CandidateOptions options_;
  PlaceDatabase database_;
  std::map<FrameId, std::vector<FrameId>> neighbours_;
  std::vector<Group> last_groups_;
};

}  // namespace rotslam
