#include "apps/cli/export/picture_check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace rotslam {
namespace {

// A picture that leaves less than this against its frame fits, whatever other frames leave: what
// strong JPEG compression of small images changes. Grey levels.
constexpr double kFitting = 2.0;
// The same where many pictures fit another frame better.
constexpr double kFittingOfMany = 0.7;
constexpr double kShareOfMany = 0.1;
constexpr int kLeastOfMany = 5;
// Another frame fits better when it leaves less than this share.
constexpr double kBetter = 0.5;
// Frames on either side that a picture is compared with: a second of video at the usual rates.
constexpr int kReach = 60;
// Below this correlation it is another scene.
constexpr double kSameScene = 0.7;

using Grey = std::vector<std::uint8_t>;

double MeanOf(const Grey& grey) {
  double sum = 0.0;
  for (const std::uint8_t value : grey) sum += value;
  return sum / static_cast<double>(grey.size());
}

struct PictureDifference {
  double residual = 0.0;     // grey levels of the picture with more contrast
  double correlation = 1.0;  // 1 where neither has any contrast
};

PictureDifference CompareThumbnails(const Grey& a, const Grey& b) {
  const double mean_a = MeanOf(a);
  const double mean_b = MeanOf(b);
  double aa = 0.0;
  double bb = 0.0;
  double ab = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double of_a = a[k] - mean_a;
    const double of_b = b[k] - mean_b;
    aa += of_a * of_a;
    bb += of_b * of_b;
    ab += of_a * of_b;
  }
  const double contrast = std::sqrt(std::max(aa, bb) / static_cast<double>(a.size()));
  if (contrast == 0.0) return {};
  PictureDifference difference;
  difference.correlation = aa > 0.0 && bb > 0.0 ? ab / std::sqrt(aa * bb) : 0.0;
  const double c = std::max(0.0, difference.correlation);
  difference.residual = contrast * std::sqrt(std::max(0.0, 1.0 - c * c));
  return difference;
}

// How a picture stands to the frame that it is offered for, and to the others.
struct Finding {
  PictureDifference own;
  int better = -1;  // the frame nearby that fits best and much better; -1: none
};

Finding Judge(const ThumbnailTable& thumbnails, const OfferedPicture& picture) {
  const int own = picture.frame.value;
  const int num_frames = static_cast<int>(std::ssize(thumbnails.grey));
  Finding finding;
  finding.own = CompareThumbnails(thumbnails.grey[own], picture.grey);
  double least = kBetter * finding.own.residual;
  if (finding.own.residual <= kFittingOfMany) return finding;
  for (int k = std::max(0, own - kReach); k <= std::min(num_frames - 1, own + kReach); ++k) {
    if (k == own || thumbnails.grey[k].empty()) continue;
    const double residual = CompareThumbnails(thumbnails.grey[k], picture.grey).residual;
    if (residual >= least) continue;
    least = residual;
    finding.better = k;
  }
  return finding;
}

std::string DescribeWrong(const OfferedPicture& picture, const Finding& finding) {
  const std::string frame = std::to_string(picture.frame.value);
  return picture.name + ": is not the picture that the run read as frame " + frame +
         (finding.better < 0 ? "" : "; it looks like frame " + std::to_string(finding.better));
}

}  // namespace

std::optional<std::string> FindWrongPicture(const ThumbnailTable& thumbnails,
                                            const std::vector<OfferedPicture>& pictures) {
  std::optional<std::string> first_of_many;
  int num_doubtful = 0;
  int num_compared = 0;
  for (const OfferedPicture& picture : pictures) {
    const auto frame = static_cast<std::size_t>(picture.frame.value);
    if (frame >= thumbnails.grey.size()) continue;
    if (thumbnails.grey[frame].size() != picture.grey.size()) continue;
    ++num_compared;
    const Finding finding = Judge(thumbnails, picture);
    const bool is_other_scene =
        finding.own.correlation < kSameScene && finding.own.residual > kFitting;
    const bool is_other_frame = finding.better >= 0 && finding.own.residual > kFitting;
    if (is_other_scene || is_other_frame) return DescribeWrong(picture, finding);
    if (finding.better < 0) continue;
    ++num_doubtful;
    if (!first_of_many) first_of_many = DescribeWrong(picture, finding);
  }
  const bool are_many = num_doubtful >= kLeastOfMany && num_doubtful > kShareOfMany * num_compared;
  return are_many ? first_of_many : std::nullopt;
}

}  // namespace rotslam
