#include "rotodom/loop/place_database.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

namespace rotslam {
namespace {

constexpr std::uint32_t kNoSlot = 0xFFFFFFFFU;

// Weights are multiples of 2^-32, so that sums do not depend on their order. A single addition to a
// frame's sum counts the word (bits above 40) and adds to the score (bits below).
constexpr double kFixedOne = 4294967296.0;
constexpr int kCountBit = 40;

std::uint32_t ToFixed(float weight) {
  return static_cast<std::uint32_t>(std::clamp(kFixedOne * weight, 0.0, kFixedOne - 1.0));
}

void CheckBag(const BagOfWords& bag, std::size_t num_words) {
  for (std::size_t k = 0; k < bag.size(); ++k) {
    if (bag[k].word >= num_words) {
      throw std::invalid_argument("PlaceDatabase: there is no word " + std::to_string(bag[k].word));
    }
    if (k > 0 && bag[k].word <= bag[k - 1].word) {
      throw std::invalid_argument("PlaceDatabase: the words of a bag must ascend");
    }
    if (!(bag[k].weight >= 0.0F)) {
      throw std::invalid_argument("PlaceDatabase: a word's weight is negative or not a number");
    }
  }
}

}  // namespace

std::vector<PlaceMatch> WithManyCommonWords(const std::vector<PlaceMatch>& matches, double ratio) {
  if (!(ratio >= 0.0 && ratio <= 1.0)) {
    throw std::invalid_argument("WithManyCommonWords: the ratio must be 0 to 1");
  }
  int most = 0;
  for (const PlaceMatch& match : matches) most = std::max(most, match.common_words);
  std::vector<PlaceMatch> kept;
  for (const PlaceMatch& match : matches) {
    if (match.common_words > ratio * most) kept.push_back(match);
  }
  return kept;
}

PlaceDatabase::PlaceDatabase(int num_words) {
  if (num_words < 0) throw std::invalid_argument("PlaceDatabase: num_words is negative");
  postings_.resize(static_cast<std::size_t>(num_words));
}

void PlaceDatabase::Add(FrameId frame, const BagOfWords& bag) {
  if (frame.value < 0) throw std::invalid_argument("PlaceDatabase: a frame's number is negative");
  if (Contains(frame)) {
    throw std::invalid_argument("PlaceDatabase: frame " + std::to_string(frame.value) +
                                " is there already");
  }
  CheckBag(bag, postings_.size());
  const auto slot = static_cast<std::uint32_t>(frames_.size());
  frames_.push_back(frame);
  num_words_.push_back(static_cast<std::uint32_t>(bag.size()));
  slots_.emplace(frame, slot);
  for (const auto& [word, weight] : bag) {
    std::vector<Posting>& list = postings_[word];
    // Capacity grows by a quarter; doubling would leave a third of the memory unused.
    if (list.size() == list.capacity()) list.reserve(list.size() + list.size() / 4 + 2);
    list.push_back({slot, ToFixed(weight)});
  }
  num_postings_ += bag.size();
}

void PlaceDatabase::Erase(FrameId frame) {
  const auto entry = slots_.find(frame);
  if (entry == slots_.end()) {
    throw std::invalid_argument("PlaceDatabase: there is no frame " + std::to_string(frame.value));
  }
  frames_[entry->second] = FrameId{};
  num_erased_ += num_words_[entry->second];
  slots_.erase(entry);
  if (2 * num_erased_ > num_postings_ || slots_.empty()) Compact();
}

void PlaceDatabase::Compact() {
  std::vector<std::uint32_t> new_slots(frames_.size(), kNoSlot);
  std::uint32_t num_kept = 0;
  for (std::size_t slot = 0; slot < frames_.size(); ++slot) {
    if (frames_[slot] == FrameId{}) continue;
    new_slots[slot] = num_kept;
    slots_[frames_[slot]] = num_kept;
    frames_[num_kept] = frames_[slot];
    num_words_[num_kept] = num_words_[slot];
    ++num_kept;
  }
  frames_.resize(num_kept);
  num_words_.resize(num_kept);
  std::vector<Posting> kept;
  for (std::vector<Posting>& list : postings_) {
    kept.clear();
    for (const Posting& posting : list) {
      if (new_slots[posting.slot] == kNoSlot) continue;
      kept.push_back({new_slots[posting.slot], posting.weight});
    }
    list = std::vector<Posting>(kept.begin(), kept.end());
  }
  num_postings_ -= num_erased_;
  num_erased_ = 0;
}

std::vector<PlaceMatch> PlaceDatabase::Query(
    const BagOfWords& bag, const std::function<bool(FrameId)>& is_excluded) const {
  CheckBag(bag, postings_.size());
  std::vector<std::uint64_t> sums(frames_.size());
  for (std::size_t k = 0; k < bag.size(); ++k) {
    if (k + 1 < bag.size()) __builtin_prefetch(postings_[bag[k + 1].word].data());
    const std::uint32_t weight = ToFixed(bag[k].weight);
    for (const Posting& posting : postings_[bag[k].word]) {
      sums[posting.slot] += (std::uint64_t{1} << kCountBit) + std::min(weight, posting.weight);
    }
  }
  std::vector<PlaceMatch> matches;
  matches.reserve(slots_.size());
  for (std::size_t slot = 0; slot < sums.size(); ++slot) {
    if (sums[slot] == 0 || frames_[slot] == FrameId{}) continue;
    if (is_excluded && is_excluded(frames_[slot])) continue;
    const std::uint64_t score = sums[slot] & ((std::uint64_t{1} << kCountBit) - 1);
    matches.push_back({frames_[slot],
                       static_cast<int>(sums[slot] >> kCountBit),
                       static_cast<double>(score) / kFixedOne});
  }
  const auto by_frame = [](const PlaceMatch& a, const PlaceMatch& b) { return a.frame < b.frame; };
  std::sort(matches.begin(), matches.end(), by_frame);
  return matches;
}

std::size_t PlaceDatabase::MemoryBytes() const {
  // Overhead of the allocator per block, and the size of a node of the map: pair, next pointer and
  // share of the buckets.
  constexpr std::size_t kBlock = 16;
  constexpr std::size_t kMapNode = sizeof(std::pair<FrameId, std::uint32_t>) + 3 * sizeof(void*);
  std::size_t bytes = sizeof(*this) + postings_.capacity() * sizeof(std::vector<Posting>) +
                      frames_.capacity() * sizeof(FrameId) +
                      num_words_.capacity() * sizeof(std::uint32_t) + slots_.size() * kMapNode;
  for (const std::vector<Posting>& list : postings_) {
    if (list.capacity() > 0) bytes += list.capacity() * sizeof(Posting) + kBlock;
  }
  return bytes;
}

}  // namespace rotslam
