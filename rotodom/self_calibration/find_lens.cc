#include "rotodom/self_calibration/find_lens.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>

#include "rotodom/features/view.h"

namespace rotslam {
namespace {

constexpr int kMostPairs = 40;
constexpr std::size_t kMostPointsOfPair = 120;
// Common points that a pair needs: to be estimated, and as a share of the first frame's.
constexpr int kLeastCommonPoints = 60;
constexpr double kLeastCommonShare = 0.3;

// Every n-th of the pairs, with every m-th of their points.
std::vector<LensPair> Thinned(std::span<const LensPair> pairs,
                              std::size_t num_pairs,
                              std::size_t num_points) {
  std::vector<LensPair> some;
  const std::size_t step = std::max<std::size_t>(1, pairs.size() / num_pairs);
  for (std::size_t n = step / 2; n < pairs.size(); n += step) {
    LensPair& pair = some.emplace_back(pairs[n]);
    const std::size_t stride = std::max<std::size_t>(1, pair.points.size() / num_points);
    std::vector<SharedPoint> points;
    for (std::size_t k = 0; k < pair.points.size(); k += stride) points.push_back(pair.points[k]);
    pair.points = std::move(points);
  }
  return some;
}

// The pairs with the points of even or odd position.
std::vector<LensPair> Half(std::span<const LensPair> pairs, std::size_t first) {
  std::vector<LensPair> half(pairs.begin(), pairs.end());
  for (LensPair& pair : half) {
    std::vector<SharedPoint> points;
    for (std::size_t k = first; k < pair.points.size(); k += 2) points.push_back(pair.points[k]);
    pair.points = std::move(points);
  }
  return half;
}

// The frame farthest after `first` that sees enough of its points; null: none does.
const Features* FarthestPartner(std::map<FrameId, Features>::const_iterator first,
                                std::map<FrameId, Features>::const_iterator end) {
  const Features& features = first->second;
  const int least =
      std::max(kLeastCommonPoints,
               static_cast<int>(kLeastCommonShare * static_cast<double>(features.tracks.size())));
  const Features* farthest = nullptr;
  for (auto next = std::next(first); next != end; ++next) {
    if (CountCommonTracks(features, next->second) < least) break;
    farthest = &next->second;
  }
  return farthest;
}

struct Projection {
  CameraModel model;
  std::span<const double> focal_shares;  // of the image's longer side, where fits start
};

// From 25 deg of view to 100, and from 80 deg to 220 over the longer side.
constexpr std::array<double, 6> kPinholeShares = {0.42, 0.6, 0.8, 1.1, 1.5, 2.2};
constexpr std::array<double, 5> kFisheyeShares = {0.26, 0.33, 0.42, 0.55, 0.72};
constexpr std::array<Projection, 2> kProjections = {
    Projection{CameraModel::kRadtan, kPinholeShares},
    Projection{CameraModel::kEquidistant, kFisheyeShares}};

// Fits start that far from each other, as a share; a guess from EXIF data is better than that.
constexpr double kStartSigma = 0.5;
constexpr double kExifSigma = 0.15;

// The best of the fits that start from all focal lengths of a projection.
std::optional<FittedLens> BestStart(std::span<const LensPair> pairs,
                                    const Projection& projection,
                                    const cv::Size& image_size,
                                    std::optional<double> focal_px,
                                    LensPairsOptions options) {
  constexpr std::size_t kPairsOfStart = 12;
  constexpr std::size_t kPointsOfStart = 100;
  const std::vector<LensPair> some = Thinned(pairs, kPairsOfStart, kPointsOfStart);
  options.is_rough = true;
  std::optional<FittedLens> best;
  const auto try_from = [&](double start_px, double sigma) {
    const LensPrior prior = UnknownLens(projection.model, image_size, start_px, sigma);
    const auto fit = FitLensToPairs(some, prior, prior.camera, options);
    if (fit && !fit->camera.Problem() && (!best || fit->cost < best->cost)) best = fit;
  };
  if (focal_px) {
    try_from(*focal_px, kExifSigma);
    return best;
  }
  const int side_px = std::max(image_size.width, image_size.height);
  for (const double share : projection.focal_shares) try_from(share * side_px, kStartSigma);
  return best;
}

// The best starts of all projections, for cameras that move or only turn.
struct Starts {
  std::array<std::optional<FittedLens>, kProjections.size()> fits;
  double least_cost = 1.0;
  double explained = 0.0;  // share of the points, of the best fit
};

Starts StartsOf(std::span<const LensPair> pairs,
                const cv::Size& image_size,
                std::optional<double> focal_px,
                const LensPairsOptions& options) {
  Starts starts;
  for (std::size_t n = 0; n < kProjections.size(); ++n) {
    starts.fits[n] = BestStart(pairs, kProjections[n], image_size, focal_px, options);
    if (!starts.fits[n]) continue;
    const FittedLens& fit = *starts.fits[n];
    starts.least_cost = std::min(starts.least_cost, fit.cost);
    starts.explained = std::max(
        starts.explained, static_cast<double>(fit.num_explained) / std::max(1, fit.num_points));
  }
  return starts;
}

}  // namespace

std::vector<LensPair> ChooseLensPairs(const std::map<FrameId, Features>& features,
                                      const RotationMap& cam_from_world) {
  std::vector<LensPair> pairs;
  const std::size_t step = std::max<std::size_t>(1, features.size() / kMostPairs);
  std::size_t number = 0;
  for (auto first = features.begin(); first != features.end(); ++first, ++number) {
    if (number % step != 0) continue;
    const Features* partner = FarthestPartner(first, features.end());
    if (partner == nullptr) continue;
    const auto R_i = cam_from_world.find(first->first);
    const auto R_j = cam_from_world.find(partner->frame);
    if (R_i == cam_from_world.end() || R_j == cam_from_world.end()) continue;
    pairs.push_back({first->first,
                     partner->frame,
                     R_j->second * R_i->second.Inverse(),
                     SharedPoints(first->second, *partner)});
  }
  return Thinned(pairs, pairs.size(), kMostPointsOfPair);
}

LensPrior UnknownLens(CameraModel model,
                      const cv::Size& image_size,
                      double focal_px,
                      double focal_sigma) {
  // Of the first two coefficients: those of lenses that are sold. Pairs do not tell the others.
  constexpr double kRadialSigma = 0.2;
  // Of the principal point, as a share of the longer side.
  constexpr double kCenterSigma = 0.02;
  LensPrior prior;
  Camera& camera = prior.camera;
  camera.model = model;
  camera.width = image_size.width;
  camera.height = image_size.height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * (image_size.width - 1);
  camera.cy = 0.5 * (image_size.height - 1);
  const int side_px = std::max(image_size.width, image_size.height);
  prior.sigmas.setZero();
  prior.sigmas[kLensFocal] = focal_sigma;
  prior.sigmas.segment<2>(kLensCenter).setConstant(kCenterSigma * side_px / focal_px);
  prior.sigmas.segment<2>(kLensDistortion).setConstant(kRadialSigma);
  return prior;
}

std::optional<FoundLens> FindLens(std::span<const LensPair> pairs,
                                  const cv::Size& image_size,
                                  std::optional<double> focal_px,
                                  const LensPairsOptions& given_options) {
  constexpr double kClearly = 0.8;   // as large a cost
  constexpr double kHopeless = 1.5;  // times the least cost
  // A point has two coordinates to agree with a rotation, and one with a pose: where rotations
  // explain nearly as many points through some lens, the camera only turns.
  constexpr double kAsMany = 0.9;
  LensPairsOptions options = given_options;
  Starts starts = StartsOf(pairs, image_size, focal_px, options);
  options.rotates_only = true;
  if (Starts turned = StartsOf(pairs, image_size, focal_px, options);
      turned.explained > 0.0 && turned.explained >= kAsMany * starts.explained) {
    starts = std::move(turned);
  } else {
    options.rotates_only = false;
  }
  const std::vector<LensPair> even = Half(pairs, 0);
  const std::vector<LensPair> odd = Half(pairs, 1);
  FoundLens found;
  std::array<double, kProjections.size()> cost_of = {1.0, 1.0};
  std::array<std::optional<FittedLens>, kProjections.size()> fits;
  for (std::size_t n = 0; n < kProjections.size(); ++n) {
    const Projection& projection = kProjections[n];
    const auto& start = starts.fits[n];
    if (!start || start->cost > kHopeless * starts.least_cost) continue;
    const LensPrior prior =
        UnknownLens(projection.model, image_size, start->camera.MeanFocal(), kStartSigma);
    fits[n] = FitLensToPairs(even, prior, start->camera, options);
    if (!fits[n] || fits[n]->camera.Problem()) {
      fits[n].reset();
      continue;
    }
    cost_of[n] = CostOfLens(odd, fits[n]->camera, options);
  }
  found.cost_of_pinhole = cost_of[0];
  found.cost_of_fisheye = cost_of[1];
  const std::size_t best = fits[1] && (!fits[0] || cost_of[1] < kClearly * cost_of[0]) ? 1 : 0;
  if (!fits[best]) return std::nullopt;
  const Camera& start = fits[best]->camera;
  const LensPrior prior =
      UnknownLens(kProjections[best].model, image_size, start.MeanFocal(), kStartSigma);
  const auto fit = FitLensToPairs(pairs, prior, start, options);
  if (!fit || fit->camera.Problem()) return std::nullopt;
  found.fit = *fit;
  return found;
}

}  // namespace rotslam
