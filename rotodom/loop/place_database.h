#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <vector>

#include "rotodom/loop/vocabulary.h"
#include "rotodom/types/ids.h"

namespace rotslam {

/// A frame that shares words with the queried one.
struct PlaceMatch {
  FrameId frame;
  int common_words = 0;
  double score = 0.0;  // Score() of the two bags, to 1e-6
  bool operator==(const PlaceMatch&) const = default;
};

/// Keeps the matches with more than `ratio` times the largest number of common words, in the same
/// order. ORB-SLAM2 uses 0.8.
/// @param ratio  0 to 1, else throws std::invalid_argument.
std::vector<PlaceMatch> WithManyCommonWords(const std::vector<PlaceMatch>& matches, double ratio);

/// Inverse index from words to frames: finds the frames that are similar to a new one.
/// Memory:  8 bytes and growth for each word of each frame, and 24 bytes for each word of the
///          vocabulary: with the shipped one 21 MB for 1,000 frames of 2,000 features, to which
///          direct indices kept beside it add 5 MB (tests/bench/loop_bench.cc).
/// Source:  Galvez-Lopez & Tardos, Bags of Binary Words, T-RO 2012, sec. IV (inverse index).
class PlaceDatabase {
 public:
  /// @param num_words  of the vocabulary; words of all bags are below it.
  explicit PlaceDatabase(int num_words);

  /// Throws std::invalid_argument when the frame is there already, or when its words do not ascend,
  /// are not below num_words or have weights below zero.
  void Add(FrameId frame, const BagOfWords& bag);

  /// Throws std::invalid_argument when the frame is not there. Memory comes back when half of what
  /// is held has been erased; that takes as long as adding the frames that are left.
  void Erase(FrameId frame);

  bool Contains(FrameId frame) const { return slots_.contains(frame); }
  /// Number of frames.
  int size() const { return static_cast<int>(slots_.size()); }

  /// All frames that share words with the bag, but for those that `is_excluded` names, by
  /// ascending id.
  /// @param is_excluded  called once for each frame with a common word; may be empty.
  /// Cost:    1.5 to 2.5 ns for each pair of a word of the bag and a frame that has it: 4 ms for
  ///          10,000 frames that share 150 words each (tests/bench/loop_bench.cc).
  std::vector<PlaceMatch> Query(const BagOfWords& bag,
                                const std::function<bool(FrameId)>& is_excluded = {}) const;

  /// Allocated memory, including unused capacity.
  std::size_t MemoryBytes() const;

 private:
  struct Posting {
    std::uint32_t slot = 0;
    std::uint32_t weight = 0;  // as ToFixed gives it
  };

  void Compact();

  std::vector<std::vector<Posting>> postings_;  // by word, slots ascending
  std::vector<FrameId> frames_;                 // by slot; -1: erased
  std::vector<std::uint32_t> num_words_;        // by slot
  std::unordered_map<FrameId, std::uint32_t> slots_;
  std::size_t num_postings_ = 0;
  std::size_t num_erased_ = 0;  // of them
};

}  // namespace rotslam
