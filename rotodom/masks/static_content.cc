#include "rotodom/masks/static_content.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// Pixels of a reduced image: strokes of text and specks of dirt are still seen, and a decision
// takes some 80 ms.
constexpr double kReducedArea = 120e3;

// Edges are compared with those of a window around them, reduced pixels.
constexpr int kSurroundings = 15;
// Contrast of edges below which the normalisation lets them fade: noise, grey levels per pixel.
constexpr float kNoiseContrast = 1.5F;
// Window over which the agreement of edge maps is averaged, reduced pixels: a speck of dirt.
constexpr int kWindow = 7;
// Mean square of the normalised edges above which a window has texture; it is 1 at high contrast.
constexpr double kMinTexture = 0.3;

// Agreement of edge maps, mean over all pairs of frames: 1 for static content, 0 for a scene in
// motion. Above the first threshold nothing else reaches it. Where there is static content, its
// regions hold places above the second and extend to the third: specks whose edges the scene
// behind them often hides.
constexpr double kStaticAgreement = 0.5;
constexpr double kRegionAgreement = 0.3;
constexpr double kBorderAgreement = 0.18;
// Share of the textured area that agrees, above which there is static content. In few views edges
// that slide along themselves, or have hardly moved yet, agree by chance. Without a rotation what
// is far away stands still, too: the end of a street that a camera drives along.
constexpr double kMinStaticShareWithoutRotation = 8e-2;
constexpr double kMinStaticShareOfFewViews = 1e-2;
constexpr double kMinStaticShare = 3e-3;
constexpr int kManyViews = 20;
// Frames that show different views, needed for a decision.
constexpr int kMinDifferentViews = 8;
// Two frames show different views where less than this share of the texture agrees.
constexpr double kMaxUnchangedShare = 0.6;
constexpr double kPairAgreement = 0.6;

cv::Mat Reduced(const cv::Mat& image) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  const double scale = std::sqrt(kReducedArea / static_cast<double>(grey.total()));
  if (scale >= 1.0) return grey.clone();
  cv::Mat reduced;
  cv::resize(grey, reduced, cv::Size(), scale, scale, cv::INTER_AREA);
  return reduced;
}

cv::Mat WindowMean(const cv::Mat& values, int side) {
  cv::Mat mean;
  cv::blur(values, mean, cv::Size(side, side));
  return mean;
}

// The edges of one view.
struct EdgeView {
  cv::Mat edges;  // magnitude of the gradient with zero mean and unit variance in its surroundings
  cv::Mat squares;
  cv::Mat power;  // mean square in a window
};

// Finds and compares the edges of views of one size. The images in between are used again: memory
// for new ones would cost more time than what is computed.
class EdgeFinder {
 public:
  void Find(const cv::Mat& grey, EdgeView& view);
  // Share of the texture of two views that agrees.
  double UnchangedShare(const EdgeView& a, const EdgeView& b);

 private:
  cv::Mat dx_;
  cv::Mat dy_;
  cv::Mat mean_;
  cv::Mat square_;
  cv::Mat contrast_;
  cv::Mat product_;
  cv::Mat power_;
  cv::Mat is_textured_;
  cv::Mat agrees_;
};

void EdgeFinder::Find(const cv::Mat& grey, EdgeView& view) {
  constexpr double kSobelScale = 1.0 / 8.0;
  const cv::Size surroundings(kSurroundings, kSurroundings);
  cv::Sobel(grey, dx_, CV_32F, 1, 0, 3, kSobelScale);
  cv::Sobel(grey, dy_, CV_32F, 0, 1, 3, kSobelScale);
  cv::magnitude(dx_, dy_, view.edges);
  cv::blur(view.edges, mean_, surroundings);
  cv::multiply(view.edges, view.edges, square_);
  cv::blur(square_, contrast_, surroundings);
  cv::multiply(mean_, mean_, square_);
  cv::subtract(contrast_, square_, contrast_);
  cv::max(contrast_, 0.0, contrast_);
  cv::add(contrast_, kNoiseContrast * kNoiseContrast, contrast_);
  cv::sqrt(contrast_, contrast_);
  cv::subtract(view.edges, mean_, view.edges);
  cv::divide(view.edges, contrast_, view.edges);
  cv::multiply(view.edges, view.edges, view.squares);
  cv::blur(view.squares, view.power, cv::Size(kWindow, kWindow));
}

double EdgeFinder::UnchangedShare(const EdgeView& a, const EdgeView& b) {
  cv::multiply(a.edges, b.edges, square_);
  cv::blur(square_, product_, cv::Size(kWindow, kWindow));
  cv::multiply(a.power, b.power, power_);
  cv::compare(power_, kMinTexture * kMinTexture / 4.0, is_textured_, cv::CMP_GT);
  cv::max(power_, 1e-12, power_);
  cv::sqrt(power_, power_);
  cv::multiply(power_, kPairAgreement, power_);
  cv::compare(product_, power_, agrees_, cv::CMP_GT);
  cv::bitwise_and(agrees_, is_textured_, agrees_);
  return static_cast<double>(cv::countNonZero(agrees_)) /
         std::max(1.0, static_cast<double>(cv::countNonZero(is_textured_)));
}

struct Agreement {
  cv::Mat of_edges;  // mean correlation of all pairs of views, per pixel
  cv::Mat is_textured;
  int num_views = 0;
};

// Of frames that show different views.
Agreement AgreementOf(const std::vector<cv::Mat>& samples) {
  cv::Mat sum;
  cv::Mat sum_of_squares;
  EdgeFinder finder;
  EdgeView view;
  EdgeView last;
  Agreement agreement;
  for (const cv::Mat& sample : samples) {
    finder.Find(sample, view);
    if (agreement.num_views == 0) {
      sum = view.edges.clone();
      sum_of_squares = view.squares.clone();
    } else {
      if (finder.UnchangedShare(view, last) > kMaxUnchangedShare) continue;
      sum += view.edges;
      sum_of_squares += view.squares;
    }
    std::swap(view, last);
    ++agreement.num_views;
  }
  if (agreement.num_views < 2) return agreement;
  const double n = agreement.num_views;
  const cv::Mat power = WindowMean(sum_of_squares, kWindow);
  const cv::Mat pairs = WindowMean(sum.mul(sum), kWindow) - power;
  agreement.of_edges = pairs / ((n - 1.0) * cv::max(power, 1e-6));
  agreement.is_textured = power > kMinTexture * n;
  return agreement;
}

// The connected regions of `candidates` that hold a pixel of `seeds`.
cv::Mat RegionsWith(const cv::Mat& seeds, const cv::Mat& candidates) {
  cv::Mat labels;
  const int num_labels = cv::connectedComponents(candidates, labels, 8, CV_32S);
  std::vector<std::uint8_t> is_kept(num_labels, 0);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      if (seeds.at<std::uint8_t>(y, x) != 0) is_kept[labels.at<int>(y, x)] = 255;
    }
  }
  is_kept[0] = 0;  // the background
  cv::Mat regions(labels.size(), CV_8U);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      regions.at<std::uint8_t>(y, x) = is_kept[labels.at<int>(y, x)];
    }
  }
  return regions;
}

// Adds what static regions enclose: the inside of a drop. The scene inside a round border is
// larger.
void FillHoles(cv::Mat& regions) {
  constexpr double kMaxHoleShare = 0.02;
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centroids;
  const cv::Mat rest = regions == 0;
  const int num_labels = cv::connectedComponentsWithStats(rest, labels, stats, centroids, 4);
  const double max_area = kMaxHoleShare * static_cast<double>(regions.total());
  for (int label = 1; label < num_labels; ++label) {
    const int left = stats.at<int>(label, cv::CC_STAT_LEFT);
    const int top = stats.at<int>(label, cv::CC_STAT_TOP);
    const bool reaches_border = left == 0 || top == 0 ||
                                left + stats.at<int>(label, cv::CC_STAT_WIDTH) == regions.cols ||
                                top + stats.at<int>(label, cv::CC_STAT_HEIGHT) == regions.rows;
    if (reaches_border || stats.at<int>(label, cv::CC_STAT_AREA) > max_area) continue;
    regions.setTo(255, labels == label);
  }
}

double MinStaticShare(int num_views, bool has_rotated) {
  if (!has_rotated) return kMinStaticShareWithoutRotation;
  return num_views < kManyViews ? kMinStaticShareOfFewViews : kMinStaticShare;
}

// Static regions, 255 in a reduced image; empty where there are none.
cv::Mat StaticRegions(const Agreement& agreement, bool has_rotated) {
  if (agreement.num_views < kMinDifferentViews) return {};
  const cv::Mat certain = (agreement.of_edges > kStaticAgreement) & agreement.is_textured;
  const double num_textured = cv::countNonZero(agreement.is_textured);
  const double min_share = MinStaticShare(agreement.num_views, has_rotated);
  if (cv::countNonZero(certain) < min_share * num_textured) return {};
  const cv::Mat seeds = (agreement.of_edges > kRegionAgreement) & agreement.is_textured;
  const cv::Mat candidates = (agreement.of_edges > kBorderAgreement) & agreement.is_textured;
  cv::Mat regions = RegionsWith(seeds, candidates);
  FillHoles(regions);
  return regions;
}

// At most half of kMaxSamples, spread over all: pairs of them are compared.
std::vector<cv::Mat> EverySecondOf(const std::vector<cv::Mat>& samples) {
  constexpr std::size_t kMost = StaticContentFinder::kMaxSamples / 2;
  const std::size_t step = (samples.size() + kMost - 1) / kMost;
  std::vector<cv::Mat> some;
  for (std::size_t k = 0; k < samples.size(); k += step) some.push_back(samples[k]);
  return some;
}

// Whether parts of the picture return to what they showed before, block by block.
class Background {
 public:
  explicit Background(const std::vector<cv::Mat>& samples)
      : samples_(samples),
        rows_(samples.front().rows / kBlock),
        cols_(samples.front().cols / kBlock) {
    FindDifferences();
    FindBackground();
  }

  // Share of the changing blocks that show their background, in the fifth of the frames with the
  // smallest shares; 0 where next to nothing changes.
  double Presence() const;
  // Share of all blocks that change.
  double ChangingShare() const { return Share(is_changing_); }
  // Share of all blocks that have texture and never change.
  double UnchangingShare() const { return Share(is_unchanging_); }
  // Median motion of the blocks that never change, reduced pixels.
  double Shift() const;

 private:
  static constexpr int kBlock = 8;  // side, reduced pixels

  int num_blocks() const { return rows_ * cols_; }
  double Share(const std::vector<bool>& blocks) const {
    return static_cast<double>(std::count(blocks.begin(), blocks.end(), true)) / num_blocks();
  }
  cv::Mat BlockMean(const cv::Mat& values) const;
  cv::Mat BlockMeanOfBytes(const cv::Mat& values) const;
  float Difference(std::size_t i, std::size_t j, int block) const {
    if (i == j) return 0.0F;
    const auto [low, high] = std::minmax(i, j);
    return differences_[high * (high - 1) / 2 + low].at<float>(block / cols_, block % cols_);
  }
  void FindDifferences();
  void FindBackground();

  const std::vector<cv::Mat>& samples_;
  int rows_;
  int cols_;
  std::vector<cv::Mat> differences_;  // of pairs of frames j < i: mean absolute one of each block
  float noise_ = 0.0F;                // below which two blocks are the same
  std::vector<std::vector<bool>> shows_background_;  // by block and frame
  std::vector<bool> is_changing_;
  std::vector<bool> is_unchanging_;
};

cv::Mat Background::BlockMean(const cv::Mat& values) const {
  cv::Mat means;
  cv::resize(values(cv::Rect(0, 0, cols_ * kBlock, rows_ * kBlock)),
             means,
             cv::Size(cols_, rows_),
             0.0,
             0.0,
             cv::INTER_AREA);
  return means;
}

// The same of 8-bit values, eight at a time: a block is as wide as a word, whose bytes are summed
// by pairs in 16 bits over the block's rows.
cv::Mat Background::BlockMeanOfBytes(const cv::Mat& values) const {
  static_assert(kBlock == sizeof(std::uint64_t));
  constexpr std::uint64_t kEvenBytes = 0x00FF00FF00FF00FF;
  constexpr std::uint64_t kSumOfFour = 0x0001000100010001;
  cv::Mat means(rows_, cols_, CV_32F);
  for (int row = 0; row < rows_; ++row) {
    for (int col = 0; col < cols_; ++col) {
      std::uint64_t pairs = 0;
      for (int y = 0; y < kBlock; ++y) {
        std::uint64_t bytes = 0;
        std::memcpy(&bytes, values.ptr<std::uint8_t>(row * kBlock + y) + col * kBlock, kBlock);
        pairs += (bytes & kEvenBytes) + ((bytes >> 8) & kEvenBytes);
      }
      means.at<float>(row, col) =
          static_cast<float>((pairs * kSumOfFour) >> 48) / (kBlock * kBlock);
    }
  }
  return means;
}

void Background::FindDifferences() {
  cv::Mat difference;
  cv::Mat smallest(rows_, cols_, CV_32F, cv::Scalar(255.0));
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      cv::absdiff(samples_[i], samples_[j], difference);
      differences_.push_back(BlockMeanOfBytes(difference));
      cv::min(smallest, differences_.back(), smallest);
    }
  }
  // The quietest tenth of the blocks shows the noise; where all is in motion, chance is the least.
  std::vector<float> sorted(smallest.begin<float>(), smallest.end<float>());
  const auto tenth = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 10);
  std::nth_element(sorted.begin(), tenth, sorted.end());
  noise_ = std::clamp(1.5F * *tenth, 5.0F, 10.0F);
}

void Background::FindBackground() {
  constexpr float kMinContrast = 3.0F;  // grey levels per pixel
  constexpr double kAlways = 0.9;
  const std::size_t num_frames = samples_.size();
  cv::Mat contrast(rows_, cols_, CV_32F, cv::Scalar(0.0));
  for (const cv::Mat& sample : samples_) {
    cv::Mat laplacian;
    cv::Laplacian(sample, laplacian, CV_32F);
    contrast += BlockMean(cv::abs(laplacian)) / static_cast<double>(num_frames);
  }
  for (int block = 0; block < num_blocks(); ++block) {
    std::vector<bool> best(num_frames, false);
    std::ptrdiff_t most = 0;
    for (std::size_t i = 0; i < num_frames; ++i) {
      std::vector<bool> same(num_frames);
      for (std::size_t j = 0; j < num_frames; ++j) same[j] = Difference(i, j, block) < noise_;
      const auto count = std::count(same.begin(), same.end(), true);
      if (count <= most) continue;
      most = count;
      best = std::move(same);
    }
    const bool has_texture = contrast.at<float>(block / cols_, block % cols_) > kMinContrast;
    const bool is_constant = static_cast<double>(most) > kAlways * static_cast<double>(num_frames);
    is_changing_.push_back(has_texture && !is_constant);
    is_unchanging_.push_back(has_texture && is_constant);
    shows_background_.push_back(std::move(best));
  }
}

double Background::Presence() const {
  const auto num_changing = std::count(is_changing_.begin(), is_changing_.end(), true);
  if (num_changing == 0) return 0.0;
  std::vector<double> shares(samples_.size(), 0.0);
  for (int block = 0; block < num_blocks(); ++block) {
    if (!is_changing_[block]) continue;
    for (std::size_t i = 0; i < shares.size(); ++i) {
      shares[i] += shows_background_[block][i] ? 1.0 / static_cast<double>(num_changing) : 0.0;
    }
  }
  const auto fifth = shares.begin() + static_cast<std::ptrdiff_t>(shares.size() / 5);
  std::nth_element(shares.begin(), fifth, shares.end());
  return *fifth;
}

double Background::Shift() const {
  const cv::Rect area(0, 0, cols_ * kBlock, rows_ * kBlock);
  constexpr double kSobelScale = 1.0 / 8.0;
  cv::Mat dx;
  cv::Mat dy;
  cv::Sobel(samples_.front()(area), dx, CV_32F, 1, 0, 3, kSobelScale);
  cv::Sobel(samples_.front()(area), dy, CV_32F, 0, 1, 3, kSobelScale);
  std::vector<double> shifts;
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    cv::Mat change;
    cv::subtract(samples_[i](area), samples_.front()(area), change, cv::noArray(), CV_32F);
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (int block = 0; block < num_blocks(); ++block) {
      const std::vector<bool>& shows = shows_background_[block];
      if (!is_unchanging_[block] || !shows[0] || !shows[i]) continue;
      const cv::Rect part(block % cols_ * kBlock, block / cols_ * kBlock, kBlock, kBlock);
      const double xy = dx(part).dot(dy(part));
      Eigen::Matrix2d of_part;
      of_part << dx(part).dot(dx(part)), xy, xy, dy(part).dot(dy(part));
      normal += of_part;
      right += Eigen::Vector2d(dx(part).dot(change(part)), dy(part).dot(change(part)));
    }
    if (!(normal.determinant() > 0.0)) continue;
    shifts.push_back((normal.inverse() * right).norm());
  }
  return Median(std::move(shifts), 0.0);
}

}  // namespace

void StaticContentFinder::Add(const cv::Mat& image) {
  if (image.empty() || num_frames_++ % stride_ != 0) return;
  image_size_ = image.size();
  samples_.push_back(Reduced(image));
  ++num_new_;
  if (static_cast<int>(samples_.size()) <= kMaxSamples) return;
  // Full: every second sample stays.
  std::vector<cv::Mat> kept;
  for (std::size_t k = 0; k < samples_.size(); k += 2) kept.push_back(samples_[k]);
  samples_ = std::move(kept);
  stride_ *= 2;
}

StaticContent StaticContentFinder::Find(bool has_rotated) {
  due_ = kMaxSamples;
  if (IsAsLastTime(has_rotated)) return {last_kind_, {}};
  StaticContent found = Decide(has_rotated);
  num_new_ = 0;
  last_kind_ = found.kind;
  had_rotated_ = has_rotated;
  return found;
}

bool StaticContentFinder::IsAsLastTime(bool has_rotated) const {
  constexpr double kFew = 0.25;  // of the samples
  const bool needs_no_mask =
      last_kind_ == StaticContentKind::kNone || last_kind_ == StaticContentKind::kStanding;
  return needs_no_mask && has_rotated == had_rotated_ &&
         num_new_ < kFew * static_cast<double>(samples_.size());
}

StaticContent StaticContentFinder::Decide(bool has_rotated) const {
  if (static_cast<int>(samples_.size()) < kMinDifferentViews) return {};
  // Shares of changing blocks that show their background: 0.1 to 0.2 for a moving camera, by
  // chance; with traffic that covers half of the road they are 0.4.
  constexpr double kStandingPresence = 0.32;
  constexpr double kMovingPresence = 0.24;
  constexpr double kMinChanging = 0.03;
  constexpr double kMinUnchanging = 0.02;
  constexpr double kMaxShift = 0.1;  // reduced pixels; hands are not as steady
  const std::vector<cv::Mat> some = EverySecondOf(samples_);
  const Background background(some);
  const double presence = background.Presence();
  const bool may_stand = presence > kMovingPresence && background.ChangingShare() > kMinChanging &&
                         background.UnchangingShare() > kMinUnchanging;
  if (may_stand && presence > kStandingPresence) {
    // In the hand of somebody who stands, the camera rotates a little, which the odometry measures.
    if (background.Shift() > kMaxShift) return {};
    return {StaticContentKind::kStanding, {}};
  }
  const cv::Mat regions = StaticRegions(AgreementOf(samples_), has_rotated);
  if (regions.empty()) return {};
  cv::Mat is_static;
  cv::resize(regions, is_static, image_size_, 0.0, 0.0, cv::INTER_LINEAR);
  const Mask mask(is_static < 128);
  return {may_stand ? StaticContentKind::kUndecided : StaticContentKind::kOnPicture, mask};
}

}  // namespace rotslam
