// Layouts of sequences and their images.

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence.h"
#include "rotodom/sequence/sequence_form.h"
#include "rotodom/sequence/times.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// A place with files that do not change.
fs::path Place(const TemporaryFolder& folder,
               const std::string& name,
               const std::vector<std::string>& files) {
  const fs::path place = folder.path() / name;
  if (fs::exists(place)) return place;
  for (const std::string& file : files) {
    fs::create_directories((place / file).parent_path());
    folder.Write(name + "/" + file, "");
  }
  return place;
}

const RegisterFuzzTarget euroc_list("euroc_list",
                                    [](std::string_view bytes, const TemporaryFolder& folder) {
                                      const fs::path place =
                                          Place(folder, "euroc", {"cam0/data/1.png"});
                                      folder.Write("euroc/cam0/data.csv", std::string(bytes));
                                      FindLayout(place, {});
                                    });

const RegisterFuzzTarget kitti_times(
    "kitti_times", [](std::string_view bytes, const TemporaryFolder& folder) {
      const fs::path place = Place(folder, "kitti", {"image_0/000000.png", "image_0/000003.png"});
      folder.Write("kitti/times.txt", std::string(bytes));
      FindLayout(place, {});
    });

const RegisterFuzzTarget tum_list("tum_list",
                                  [](std::string_view bytes, const TemporaryFolder& folder) {
                                    const fs::path place = Place(folder, "tum", {"rgb/1.png"});
                                    folder.Write("tum/rgb.txt", std::string(bytes));
                                    FindLayout(place, {});
                                  });

const RegisterFuzzTarget association_list(
    "association_list", [](std::string_view bytes, const TemporaryFolder& folder) {
      const fs::path place = Place(folder, "icl", {"rgb/0.png", "rgb/1.png", "depth/0.png"});
      folder.Write("icl/associations.txt", std::string(bytes));
      FindLayout(place, {});
    });

// A list beside images of whose lines nothing is known.
const RegisterFuzzTarget time_list(
    "time_list", [](std::string_view bytes, const TemporaryFolder& folder) {
      const fs::path place = Place(
          folder, "timed", {"images/f0.png", "images/f1.png", "images/f2.png", "images/f3.png"});
      folder.Write("timed/times.txt", std::string(bytes));
      FindLayout(place, {});
    });

const RegisterFuzzTarget kitti_raw_times(
    "kitti_raw_times", [](std::string_view bytes, const TemporaryFolder& folder) {
      const fs::path place =
          Place(folder, "raw", {"image_00/data/0000000000.png", "image_00/data/0000000001.png"});
      folder.Write("raw/image_00/timestamps.txt", std::string(bytes));
      FindLayout(place, {});
    });

const RegisterFuzzTarget scannet_camera(
    "scannet_camera", [](std::string_view bytes, const TemporaryFolder& folder) {
      const fs::path place = Place(folder, "scannet", {"color/0.jpg", "pose/0.txt"});
      fs::create_directories(place / "intrinsic");
      folder.Write("scannet/intrinsic/intrinsic_color.txt", std::string(bytes));
      FindLayout(place, {});
    });

// Names of images, one a line: their order and times.
const RegisterFuzzTarget image_names("image_names",
                                     [](std::string_view bytes, const TemporaryFolder&) {
                                       std::vector<std::string> names;
                                       for (std::size_t begin = 0;
                                            begin < bytes.size() && names.size() < 20;) {
                                         const std::size_t end =
                                             std::min(bytes.find('\n', begin), bytes.size());
                                         names.emplace_back(bytes.substr(begin, end - begin));
                                         begin = end + 1;
                                       }
                                       TimesOfNames(names);
                                       // Sorting asks for an order; std::sort runs out of the array
                                       // without one.
                                       for (const std::string& a : names) {
                                         for (const std::string& b : names) {
                                           const bool less = NaturalLess(a, b);
                                           if (less == NaturalLess(b, a) && (less || a != b))
                                             throw std::logic_error("no order");
                                           for (const std::string& c : names) {
                                             if (less && NaturalLess(b, c) && !NaturalLess(a, c))
                                               throw std::logic_error("no order");
                                           }
                                         }
                                       }
                                     });

// An image between two good ones, which may be of another size and cannot stop the sequence.
const RegisterFuzzTarget image("image", [](std::string_view bytes, const TemporaryFolder& folder) {
  constexpr const char* kGood = "P5 4 2 255\nabcdefgh";
  const fs::path place = Place(folder, "image", {"0.pgm", "1.png", "2.pgm"});
  folder.Write("image/0.pgm", kGood);
  folder.Write("image/1.png", std::string(bytes));
  folder.Write("image/2.pgm", kGood);
  const auto sequence = OpenSequence(place, {});
  int count = 0;
  while (const auto frame = sequence->Next()) {
    const bool is_good = !frame->image.empty() && frame->problem.empty();
    const bool is_bad = frame->image.empty() && !frame->problem.empty();
    if (is_good == is_bad || (count != 1 && is_bad)) throw std::logic_error("a wrong frame");
    ++count;
  }
  if (count != 3) throw std::logic_error("a frame is lost");
});

// A film that may be damaged: frames in the order of time, each a picture or a problem.
const RegisterFuzzTarget video("video", [](std::string_view bytes, const TemporaryFolder& folder) {
  folder.Write("film.mp4", std::string(bytes));
  const auto sequence = OpenSequence(folder.path() / "film.mp4", {});
  const std::size_t limit = 10 * bytes.size() + 10;
  double time_s = -std::numeric_limits<double>::infinity();
  std::size_t count = 0;
  for (; const auto frame = sequence->Next(); ++count) {
    if (frame->image.empty() == frame->problem.empty()) throw std::logic_error("a wrong frame");
    if (!(frame->timestamp_s > time_s)) throw std::logic_error("a wrong time");
    time_s = frame->timestamp_s;
    if (count > limit) throw std::logic_error("frames without end");
  }
  if (sequence->NumFrames() != static_cast<int>(count)) throw std::logic_error("a wrong count");
});

}  // namespace
}  // namespace rotslam
