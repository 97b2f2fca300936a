// Which reader a path is for, and folders of several files.

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/image_list.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void FailAtBag(const fs::path& path, const std::string& reason) {
  throw std::runtime_error(path.string() + ": " + reason);
}

std::string LowerName(const fs::path& path) {
  std::string name = path.filename().string();
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return name;
}

// The kind of recording that a file's name says: ".bag", ".db3", ".mcap"; else empty. What ROS
// itself puts behind it stays away.
std::string BagKind(const fs::path& path) {
  std::string name = LowerName(path);
  for (const std::string_view suffix : {".zstd", ".active"}) {
    if (name.ends_with(suffix)) name.resize(name.size() - suffix.size());
  }
  for (const char* kind : {".bag", ".db3", ".mcap"}) {
    if (name.ends_with(kind)) return kind;
  }
  return {};
}

// The recordings in a folder, by name, numbers counting as such.
std::vector<fs::path> BagsIn(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_regular_file(error) && !BagKind(entry.path()).empty()) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return files;
}

// What the parts of one recording have in common: the name without its number ("walk" of
// walk_0.bag and of walk_2026-01-01-12-00-00_3.bag, whose parts begin at times of their own).
std::string NameOfParts(const fs::path& file) {
  std::string stem = file.stem().string();
  const std::size_t end = stem.find_last_not_of("0123456789");
  if (end == std::string::npos || end + 1 == stem.size() || stem[end] != '_') return stem;
  stem.resize(end);
  constexpr std::string_view kDate = "_dddd-dd-dd-dd-dd-dd";
  if (stem.size() >= kDate.size()) {
    const std::string_view date = std::string_view(stem).substr(stem.size() - kDate.size());
    const bool is_date = std::equal(date.begin(), date.end(), kDate.begin(), [](char c, char form) {
      return form == 'd' ? std::isdigit(static_cast<unsigned char>(c)) != 0 : c == form;
    });
    if (is_date) stem.resize(stem.size() - kDate.size());
  }
  return stem;
}

// Several files as one recording.
class FolderBag : public BagReader {
 public:
  FolderBag(const fs::path& folder, const std::vector<fs::path>& files, const BagFilter& wanted)
      : BagReader(folder, wanted) {
    for (const fs::path& file : files) {
      const std::size_t part = parts_.size();
      parts_.push_back(OpenBag(file, wanted));
      const BagReader& reader = *parts_.back();
      std::vector<std::size_t> topics;
      for (const BagTopic& topic : reader.topics()) {
        BagTopic plain = topic;
        plain.count = 0;
        topics.push_back(AddTopic(plain));
        topics_[topics.back()].count += topic.count;
      }
      for (std::size_t k = 0; k < reader.entries().size(); ++k) {
        BagEntry entry = reader.entries()[k];
        entry.topic = topics[entry.topic];
        entry.part = part;
        entry.offset = k;
        entries_.push_back(entry);
      }
      for (const std::string& note : reader.notes()) {
        notes_.push_back(file.filename().string() + ": " + note);
      }
    }
    Finish();
  }

 private:
  std::string ReadStored(const BagEntry& entry) override {
    BagReader& part = *parts_[entry.part];
    return part.Read(part.entries()[entry.offset]);
  }

  std::vector<std::unique_ptr<BagReader>> parts_;
};

std::unique_ptr<BagReader> OpenFolder(const fs::path& folder, const BagFilter& wanted) {
  const std::vector<fs::path> files = BagsIn(folder);
  if (files.empty()) FailAtBag(folder, "holds no recording (.bag, .db3 or .mcap)");
  // The files of one rosbag2 recording; others must have names that say that they belong together.
  std::error_code error;
  if (!fs::exists(folder / "metadata.yaml", error)) {
    const auto other = std::find_if(files.begin(), files.end(), [&](const fs::path& file) {
      return NameOfParts(file) != NameOfParts(files[0]) || BagKind(file) != BagKind(files[0]);
    });
    if (other != files.end()) {
      FailAtBag(folder,
                "holds several recordings, " + files[0].filename().string() + " and " +
                    other->filename().string() + " among them; give the path of one");
    }
  }
  if (files.size() == 1) return OpenBag(files[0], wanted);
  return std::make_unique<FolderBag>(folder, files, wanted);
}

}  // namespace

std::unique_ptr<BagReader> OpenBag(const fs::path& path, const BagFilter& wanted) {
  std::error_code error;
  if (fs::is_directory(path, error)) return OpenFolder(path, wanted);
  if (LowerName(path).ends_with(".zstd")) {
    FailAtBag(path, "is compressed as a whole; run `unzstd " + path.string() + "` first");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) FailAtBag(path, "cannot be opened");
  std::array<char, 16> begin{};
  stream.read(begin.data(), begin.size());
  const std::string_view magic(begin.data(), static_cast<std::size_t>(stream.gcount()));
  if (magic.empty()) FailAtBag(path, "is empty");
  if (magic.starts_with("#ROSBAG ")) return OpenRos1Bag(path, wanted);
  if (magic.starts_with("\x89MCAP")) return OpenMcapBag(path, wanted);
  if (magic.starts_with("SQLite format 3")) return OpenSqliteBag(path, wanted);
  FailAtBag(path,
            "does not begin as a recording does: ROS 1 bag (`#ROSBAG V2.0`), ROS 2 SQLite file or "
            "MCAP file");
}

bool IsBagName(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return !BagKind(path).empty();
  if (BagsIn(path).empty()) return false;
  const fs::directory_iterator entries(path, error);
  return fs::exists(path / "metadata.yaml", error) ||
         std::none_of(begin(entries), end(entries), [](const fs::directory_entry& entry) {
           return IsImageName(entry.path());
         });
}

}  // namespace rotslam
