// How well a vocabulary finds places again.
//
//   loop_retrieval [--vocabulary FILE] SEQUENCE ... [--against SEQUENCE SEQUENCE]
//
// Every frame of a sequence with ground truth is looked up among the others of it, but for those
// taken shortly before and after; with --against, those of the second sequence among those of the
// first. A frame is right when its pose is near (see kPlaces). Prints, over the frames that have a
// right one: how often the best score is right (P@1; frames neither near nor far do not count), how
// often one of the best five is, the mean score of the best right and of the best wrong frame and
// the share of frames where the first is above the second by a quarter.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "output/trajectory/trajectory.h"
#include "rotodom/features/features.h"
#include "rotodom/loop/default_vocabulary.h"
#include "rotodom/loop/place_database.h"
#include "rotodom/loop/vocabulary_file.h"
#include "rotodom/sequence/sequence.h"

namespace rotslam {
namespace {

struct Place {
  const char* sequence;  // part of its path
  double distance_m;     // nearer than this and
  double angle_deg;      // turned by less is right; farther than twice either is wrong
  int gap;               // frames before and after that are not looked at
};
constexpr Place kPlaces[] = {{"pan720", 1.0, 4.0, 30},
                             {"kitti00", 2.0, 10.0, 0},
                             {"7scenes", 0.25, 15.0, 30},
                             {"euroc", 1.0, 25.0, 2},
                             {"", 3.0, 10.0, 0}};

struct Images {
  std::string path;
  Trajectory truth;
  std::vector<BagOfWords> bags;
};

// The poses nearest in time.
Trajectory AtTimes(const Trajectory& truth, const std::vector<double>& times_s) {
  Trajectory at_times;
  for (const double time_s : times_s) {
    at_times.push_back(
        *std::min_element(truth.begin(), truth.end(), [&](const auto& a, const auto& b) {
          return std::abs(a.timestamp_s - time_s) < std::abs(b.timestamp_s - time_s);
        }));
  }
  return at_times;
}

Images Read(const std::string& path, const Vocabulary& vocabulary) {
  const std::unique_ptr<Sequence> sequence = OpenSequence(path, {});
  if (!sequence->GroundTruthFile()) throw std::runtime_error(path + ": has no ground truth");
  Images images{path, ReadTrajectory(*sequence->GroundTruthFile()), {}};
  Camera camera;
  camera.width = sequence->image_size().width;
  camera.height = sequence->image_size().height;
  camera.fx = camera.fy = camera.width;
  camera.cx = 0.5 * (camera.width - 1);
  camera.cy = 0.5 * (camera.height - 1);
  while (const auto frame = sequence->Next()) {
    const Features features = ExtractFeatures(frame->image, frame->id, camera, {}, 2);
    images.bags.push_back(vocabulary.Transform(ToBinaryDescriptors(features.descriptors), 3).bag);
  }
  if (images.bags.size() != images.truth.size()) {
    images.truth = AtTimes(images.truth, sequence->timestamps_s());
  }
  return images;
}

// How far apart, in units of what is still right.
double Apart(const StampedPose& a, const StampedPose& b, const Place& place) {
  const Rotation turn = a.world_from_cam.Inverse() * b.world_from_cam;
  return std::max((a.center_in_world - b.center_in_world).norm() / place.distance_m,
                  turn.Angle() * kDegFromRad / place.angle_deg);
}

struct Sums {
  int frames = 0;
  int first = 0;
  int first_five = 0;
  int clear = 0;
  double right = 0.0;
  double wrong = 0.0;
};

void Look(const Images& database_images, const Images& query_images, int num_words, bool same) {
  const Place& place = *std::find_if(std::begin(kPlaces), std::end(kPlaces), [&](const Place& p) {
    return database_images.path.find(p.sequence) != std::string::npos;
  });
  PlaceDatabase database(num_words);
  for (std::size_t k = 0; k < database_images.bags.size(); ++k) {
    database.Add(FrameId{static_cast<int>(k)}, database_images.bags[k]);
  }
  Sums sums;
  for (std::size_t k = 0; k < query_images.bags.size(); ++k) {
    std::vector<PlaceMatch> matches = database.Query(query_images.bags[k], [&](FrameId frame) {
      return same && std::abs(frame.value - static_cast<int>(k)) <= place.gap;
    });
    std::stable_sort(matches.begin(), matches.end(), [](const auto& a, const auto& b) {
      return a.score > b.score;
    });
    double right = 0.0;
    double wrong = 0.0;
    int num_wrong_before = 0;
    for (const PlaceMatch& match : matches) {
      const double apart =
          Apart(query_images.truth[k], database_images.truth[match.frame.value], place);
      if (apart < 1.0) right = std::max(right, match.score);
      if (apart > 2.0) wrong = std::max(wrong, match.score);
      num_wrong_before += apart > 2.0 && right == 0.0;
    }
    const auto is_right = [&](const StampedPose& pose) {
      const auto index = static_cast<int>(&pose - database_images.truth.data());
      return !(same && std::abs(index - static_cast<int>(k)) <= place.gap) &&
             Apart(query_images.truth[k], pose, place) < 1.0;
    };
    if (!std::any_of(database_images.truth.begin(), database_images.truth.end(), is_right)) {
      continue;
    }
    ++sums.frames;
    sums.first += right > wrong;
    sums.first_five += right > 0.0 && num_wrong_before < 5;
    sums.clear += right > 1.25 * wrong;
    sums.right += right;
    sums.wrong += wrong;
  }
  const double n = std::max(sums.frames, 1);
  std::printf(
      "%-60s frames %4d  P@1 %5.1f %%  first five %5.1f %%  right %.4f  wrong %.4f  "
      "clear %5.1f %%\n",
      query_images.path.substr(query_images.path.size() > 60 ? query_images.path.size() - 60 : 0)
          .c_str(),
      sums.frames,
      100.0 * sums.first / n,
      100.0 * sums.first_five / n,
      sums.right / n,
      sums.wrong / n,
      100.0 * sums.clear / n);
}

int Main(int argc, char** argv) {
  int next = 1;
  const bool is_given = argc > 2 && std::strcmp(argv[1], "--vocabulary") == 0;
  const Vocabulary vocabulary = is_given ? ReadVocabulary(argv[2]) : DefaultVocabulary();
  if (is_given) next = 3;
  for (; next < argc; ++next) {
    if (std::strcmp(argv[next], "--against") == 0 && next + 2 < argc) {
      Look(Read(argv[next + 1], vocabulary),
           Read(argv[next + 2], vocabulary),
           vocabulary.num_words(),
           false);
      next += 2;
      continue;
    }
    const Images images = Read(argv[next], vocabulary);
    Look(images, images, vocabulary.num_words(), true);
  }
  return 0;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  try {
    return rotslam::Main(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
