#include "rotodom/loop/candidates.h"

#include <algorithm>
#include <stdexcept>

#include "rotodom/types/options.h"

namespace rotslam {

std::optional<std::string> CandidateOptions::Problem() const {
  if (recent_frames < 0) return OutOfRange("recent_frames", recent_frames, "zero or more");
  if (!(common_words_ratio >= 0.0 && common_words_ratio < 1.0)) {
    return OutOfRange("common_words_ratio", common_words_ratio, "0 or more and below 1");
  }
  if (!(group_score_ratio >= 0.0 && group_score_ratio < 1.0)) {
    return OutOfRange("group_score_ratio", group_score_ratio, "0 or more and below 1");
  }
  if (group_size < 0) return OutOfRange("group_size", group_size, "zero or more");
  return std::nullopt;
}

CandidateFinder::CandidateFinder(int num_words, const CandidateOptions& options)
    : options_(options), database_(num_words) {
  if (const auto problem = options.Problem()) {
    throw std::invalid_argument("CandidateOptions: " + *problem);
  }
}

std::vector<LoopCandidate> CandidateFinder::AddPlace(FrameId frame,
                                                     const BagOfWords& bag,
                                                     const std::vector<FrameId>& neighbours) {
  const std::set<FrameId> covisible(neighbours.begin(), neighbours.end());
  // A candidate must be at least as similar as the least similar neighbour.
  double least_score = 1.0;
  std::size_t num_neighbours_found = 0;
  std::vector<PlaceMatch> matches;
  for (const PlaceMatch& match : database_.Query(bag)) {
    if (covisible.contains(match.frame)) {
      least_score = std::min(least_score, match.score);
      ++num_neighbours_found;
    } else if (frame.value - match.frame.value > options_.recent_frames) {
      matches.push_back(match);
    }
  }
  if (covisible.empty() || num_neighbours_found < covisible.size()) least_score = 0.0;
  matches = WithManyCommonWords(matches, options_.common_words_ratio);
  std::erase_if(matches, [&](const PlaceMatch& match) { return match.score < least_score; });

  std::vector<LoopCandidate> candidates = BestOfGroups(matches);
  CheckConsistency(candidates);
  database_.Add(frame, bag);
  neighbours_[frame] = neighbours;
  for (const FrameId neighbour : neighbours) neighbours_[neighbour].push_back(frame);
  return candidates;
}

std::vector<LoopCandidate> CandidateFinder::BestOfGroups(
    const std::vector<PlaceMatch>& matches) const {
  std::map<FrameId, double> scores;
  for (const PlaceMatch& match : matches) scores[match.frame] = match.score;
  std::map<FrameId, LoopCandidate> best;
  double best_group_score = 0.0;
  for (const auto& [frame, score] : scores) {
    LoopCandidate candidate{frame, score, score, 0};
    const std::vector<FrameId>& neighbours = NeighboursOf(frame);
    const std::size_t count =
        std::min(neighbours.size(), static_cast<std::size_t>(options_.group_size));
    for (std::size_t k = 0; k < count; ++k) {
      const auto neighbour = scores.find(neighbours[k]);
      if (neighbour == scores.end()) continue;
      candidate.group_score += neighbour->second;
      if (neighbour->second > candidate.score) {
        candidate.frame = neighbour->first;
        candidate.score = neighbour->second;
      }
    }
    best_group_score = std::max(best_group_score, candidate.group_score);
    LoopCandidate& known = best[candidate.frame];
    if (candidate.group_score > known.group_score) known = candidate;
  }
  std::vector<LoopCandidate> candidates;
  for (const auto& [frame, candidate] : best) {
    if (candidate.group_score > options_.group_score_ratio * best_group_score) {
      candidates.push_back(candidate);
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.group_score > b.group_score;
  });
  return candidates;
}

void CandidateFinder::CheckConsistency(std::vector<LoopCandidate>& candidates) {
  std::vector<Group> groups;
  groups.reserve(candidates.size());
  for (LoopCandidate& candidate : candidates) {
    Group& group = groups.emplace_back();
    group.places.insert(candidate.frame);
    for (const FrameId neighbour : NeighboursOf(candidate.frame)) group.places.insert(neighbour);
    for (const Group& last : last_groups_) {
      const bool is_same =
          std::any_of(group.places.begin(), group.places.end(), [&](const FrameId place) {
            return last.places.contains(place);
          });
      if (is_same) group.num_consistent = std::max(group.num_consistent, last.num_consistent);
    }
    candidate.num_consistent = ++group.num_consistent;
  }
  last_groups_ = std::move(groups);
}

void CandidateFinder::Join(FrameId a, FrameId b) {
  std::vector<FrameId>& of_a = neighbours_[a];
  if (std::find(of_a.begin(), of_a.end(), b) != of_a.end()) return;
  of_a.push_back(b);
  neighbours_[b].push_back(a);
}

const std::vector<FrameId>& CandidateFinder::NeighboursOf(FrameId place) const {
  static const std::vector<FrameId> kNone;
  const auto neighbours = neighbours_.find(place);
  return neighbours == neighbours_.end() ? kNone : neighbours->second;
}

}  // namespace rotslam
