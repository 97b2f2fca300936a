#include "rotodom/sequence/bag/bag_sequence.h"

#include <algorithm>
#include <cstdint>
#include <future>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "rotodom/camera/ros_camera_info.h"
#include "rotodom/sequence/bag/bag_reader.h"
#include "rotodom/sequence/bag/ros_message.h"
#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/times.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

bool IsImageTopic(const BagTopic& topic) {
  return topic.type == kRosImageType || topic.type == kRosCompressedImageType;
}

bool IsTopicToRead(const BagTopic& topic) {
  return IsImageTopic(topic) || topic.type == kRosCameraInfoType;
}

// "/cam0/image_raw (sensor_msgs/Image, 200)"
std::string TopicText(const BagTopic& topic) {
  return topic.name + " (" + topic.type + ", " + std::to_string(topic.count) + ")";
}

// The first topics of a list, so that the line can be read.
std::string TopicList(const std::vector<BagTopic>& topics) {
  constexpr std::size_t kMostShown = 12;
  std::string text;
  for (std::size_t k = 0; k < std::min(topics.size(), kMostShown); ++k) {
    text += (k > 0 ? ", " : "") + TopicText(topics[k]);
  }
  if (topics.size() > kMostShown) {
    text += " and " + std::to_string(topics.size() - kMostShown) + " more";
  }
  return text;
}

// The words of a topic's name: "image", "rect" and "color" of "/image_rect_color".
bool HasWord(std::string_view name, std::string_view word) {
  for (std::size_t begin = 0; begin < name.size();) {
    const std::size_t end = std::min(name.find_first_of("/_", begin), name.size());
    if (name.substr(begin, end - begin) == word) return true;
    begin = end + 1;
  }
  return false;
}

bool IsRectified(const std::string& topic) {
  return HasWord(topic, "rect") || HasWord(topic, "rectified");
}

std::string ParentOf(const std::string& topic) {
  const std::size_t slash = topic.rfind('/');
  return slash == std::string::npos ? "" : topic.substr(0, slash);
}

// The topic that a compressed one is a copy of.
std::string PlainName(const BagTopic& topic) {
  constexpr std::string_view kEnding = "/compressed";
  std::string name = topic.name;
  if (topic.type == kRosCompressedImageType && name.ends_with(kEnding)) {
    name.resize(name.size() - kEnding.size());
  }
  return name;
}

// Finds the topic that is meant, among what the recording has.
class TopicChoice {
 public:
  TopicChoice(const fs::path& place, BagReader& reader) : place_(place), reader_(reader) {}

  std::size_t Named(std::string name) {
    if (!name.starts_with('/')) name = '/' + name;
    const std::vector<BagTopic>& topics = reader_.topics();
    const auto found = std::find_if(topics.begin(), topics.end(), [&](const BagTopic& topic) {
      return topic.name == name || '/' + topic.name == name;
    });
    if (found != topics.end()) {
      const auto k = static_cast<std::size_t>(found - topics.begin());
      const std::string why = IsImageTopic(*found)
                                  ? WhyNot(k)
                                  : "has " + found->type + ", not images" + OfImageTopics();
      if (why.empty()) return k;
      Fail(place_, "topic " + name + " " + why);
    }
    Fail(place_, "has no topic " + PrintableText(name) + OfImageTopics());
  }

  // Says in `notes` what it passed over.
  std::size_t Only(std::vector<std::string>* notes) {
    const std::vector<BagTopic>& topics = reader_.topics();
    std::vector<std::size_t> candidates;
    std::string first_why;
    for (std::size_t k = 0; k < topics.size(); ++k) {
      if (!IsImageTopic(topics[k])) continue;
      if (const std::string why = WhyNot(k); !why.empty()) {
        const std::string text = "topic " + topics[k].name + " " + why;
        if (first_why.empty()) first_why = text;
        notes->push_back(text + ": ignored");
        continue;
      }
      candidates.push_back(k);
    }
    // A compressed copy says nothing that the topic itself does not.
    const std::vector<std::size_t> all = candidates;
    std::erase_if(candidates, [&](std::size_t copy) {
      const bool is_copy = std::any_of(all.begin(), all.end(), [&](std::size_t k) {
        return topics[k].name != topics[copy].name && topics[k].name == PlainName(topics[copy]) &&
               topics[k].type == kRosImageType && topics[k].count >= topics[copy].count;
      });
      if (is_copy) notes->push_back("topic " + topics[copy].name + " is a copy: ignored");
      return is_copy;
    });
    if (candidates.size() == 1) return candidates[0];
    if (candidates.empty()) {
      if (!first_why.empty()) Fail(place_, first_why);
      Fail(place_,
           "has no topic of sensor_msgs/Image or sensor_msgs/CompressedImage; it has " +
               TopicList(topics));
    }
    std::vector<BagTopic> shown;
    shown.reserve(candidates.size());
    for (const std::size_t k : candidates) shown.push_back(topics[k]);
    Fail(place_,
         "has several topics with images, " + TopicList(shown) +
             "; name one behind a colon: " + place_.string() + ":" + shown[0].name);
  }

 private:
  // Why a topic's messages are no pictures; empty when they are.
  std::string WhyNot(std::size_t topic) {
    const BagTopic& wanted = reader_.topics()[topic];
    if (wanted.count == 0) return "has no messages";
    if (wanted.encoding != "ros1" && wanted.encoding != "cdr") {
      return "is serialised as '" + wanted.encoding + "'; ROS 1's serialisation and CDR are read";
    }
    const auto& entries = reader_.entries();
    const auto first = std::find_if(entries.begin(), entries.end(), [&](const BagEntry& entry) {
      return entry.topic == topic;
    });
    if (first == entries.end()) return "has no messages";
    try {
      const std::string message = reader_.Read(*first);
      return WhyNoPicture(wanted, ParseRosImage(wanted, message));
    } catch (const std::runtime_error&) {
      return {};  // one that is damaged among others that may be good
    }
  }

  std::string OfImageTopics() const {
    std::vector<BagTopic> shown;
    for (const BagTopic& topic : reader_.topics()) {
      if (IsImageTopic(topic)) shown.push_back(topic);
    }
    if (shown.empty()) return "; it has " + TopicList(reader_.topics());
    return "; its topics with images: " + TopicList(shown);
  }

  const fs::path& place_;
  BagReader& reader_;
};

// A message and the time of its picture.
struct BagFrame {
  BagEntry entry;
  std::int64_t time_ns = 0;
};

double SecondsOfNanoseconds(std::int64_t time_ns) {
  return SecondsFromTicks(time_ns, 1'000'000'000);
}

// Whether times increase from frame to frame; the first two that do not, otherwise.
std::optional<std::size_t> FirstNotLater(const std::vector<BagFrame>& frames) {
  for (std::size_t k = 1; k < frames.size(); ++k) {
    if (frames[k].time_ns <= frames[k - 1].time_ns) return k;
  }
  return std::nullopt;
}

class BagSequence : public Sequence {
 public:
  BagSequence(const Layout& layout, const SequenceOptions& options) : Sequence(layout) {
    const InputReference reference = ParseInputReference(layout.folder);
    place_ = image_folder_ = reference.file;
    reader_ = OpenBag(reference.file, IsTopicToRead);
    for (const std::string& note : reader_->notes()) notes_.push_back(note);
    TopicChoice choice(place_, *reader_);
    const std::size_t number =
        reference.part.empty() ? choice.Only(&notes_) : choice.Named(reference.part);
    topic_ = reader_->topics()[number];
    form_ += ", topic " + topic_.name;
    std::vector<BagFrame> frames;
    for (const BagEntry& entry : reader_->entries()) {
      if (entry.topic == number) frames.push_back({entry, StampOf(topic_, entry)});
    }
    SetTimes(frames);
    KeepWanted(frames, options);
    FindImageSize(frames);
    if (!own_camera_) FindCamera();
  }

  void Skip(int count) override {
    if (count <= 0) return;
    ahead_ = {};
    next_ += std::min(count, num_frames_ - next_);
  }

  std::vector<fs::path> Files() const override { return {place_}; }

 private:
  // Takes stamps or, where they are of no use, times of recording.
  void SetTimes(std::vector<BagFrame>& frames) {
    const auto is_zero = [](const BagFrame& frame) { return frame.time_ns == 0; };
    if (std::all_of(frames.begin(), frames.end(), is_zero)) {
      return TakeRecordedTimes(frames, "the stamps in the headers are all zero");
    }
    std::vector<std::size_t> order(frames.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return frames[a].time_ns < frames[b].time_ns;
    });
    constexpr std::size_t kMostPlaces = 16;
    std::int64_t num_moved = 0;
    std::vector<BagFrame> sorted;
    sorted.reserve(frames.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
      const std::size_t distance = std::max(order[k], k) - std::min(order[k], k);
      if (distance > kMostPlaces) {
        return TakeRecordedTimes(
            frames,
            "the stamps in the headers do not increase (message " + std::to_string(order[k]) + ")");
      }
      if (distance > 0) ++num_moved;
      sorted.push_back(frames[order[k]]);
    }
    const std::size_t num_before = sorted.size();
    DropCopies(sorted);
    if (const auto same = FirstNotLater(sorted)) {
      return TakeRecordedTimes(
          frames,
          "two messages have the same stamp, " + std::to_string(sorted[*same].time_ns) + " ns");
    }
    if (num_moved > 0) {
      notes_.push_back("frames that were put into the order of their stamps: " +
                       std::to_string(num_moved));
    }
    NoteCopies(num_before - sorted.size());
    frames = std::move(sorted);
    times_source_ = "stamps in the message headers";
  }

  void TakeRecordedTimes(std::vector<BagFrame>& frames, const std::string& reason) {
    for (BagFrame& frame : frames) frame.time_ns = frame.entry.time_ns;
    const std::size_t num_before = frames.size();
    DropCopies(frames);
    if (const auto late = FirstNotLater(frames)) {
      Fail(place_,
           "topic " + topic_.name + ": " + reason + ", and times of recording do not increase (" +
               std::to_string(frames[*late].time_ns) +
               " ns comes twice); give the images as a folder");
    }
    notes_.push_back(reason + ": times of recording are used");
    NoteCopies(num_before - frames.size());
    times_source_ = "times of recording";
  }

  // Takes out the second of neighbours with the same time and the same bytes.
  void DropCopies(std::vector<BagFrame>& frames) {
    const auto is_copy = [&](const BagFrame& a, const BagFrame& b) {
      if (a.time_ns != b.time_ns || a.entry.size != b.entry.size) return false;
      try {
        return reader_->Read(a.entry) == reader_->Read(b.entry);
      } catch (const std::runtime_error&) {
        return false;
      }
    };
    frames.erase(std::unique(frames.begin(), frames.end(), is_copy), frames.end());
  }

  void NoteCopies(std::size_t count) {
    if (count == 0) return;
    notes_.push_back("messages that are there twice and were counted once: " +
                     std::to_string(count));
  }

  void KeepWanted(std::vector<BagFrame>& frames, const SequenceOptions& options) {
    const int num_frames = static_cast<int>(frames.size());
    if (options.first >= num_frames) {
      Fail(place_,
           "first frame " + std::to_string(options.first) + " asked for, but there are only " +
               std::to_string(num_frames));
    }
    const bool to_the_end = options.last < 0 || options.last >= num_frames;
    const int end = to_the_end ? num_frames : options.last + 1;
    for (std::int64_t k = options.first; k < end; k += options.stride) {
      frames_.push_back(frames[static_cast<std::size_t>(k)]);
      timestamps_s_.push_back(SecondsOfNanoseconds(frames_.back().time_ns));
    }
    num_frames_ = static_cast<int>(frames_.size());
  }

  // Damaged images may come first, but not many.
  void FindImageSize(const std::vector<BagFrame>& all) {
    constexpr std::size_t kMostTried = 20;
    std::string first_problem;
    for (std::size_t k = 0; k < std::min(frames_.size(), kMostTried); ++k) {
      const DecodedImage decoded = DecodeEntry(frames_[k].entry);
      if (!decoded.image.empty()) {
        image_size_ = decoded.image.size();
        if (decoded.image.depth() != CV_8U) FindScale(all, decoded.image.depth());
        return;
      }
      if (first_problem.empty()) first_problem = decoded.problem;
    }
    Fail(place_, "topic " + topic_.name + ": none of its images can be read: " + first_problem);
  }

  // From images all over the recording, as the first ones may be dark.
  void FindScale(const std::vector<BagFrame>& all, int depth) {
    constexpr std::size_t kNumImages = 8;
    std::vector<cv::Mat> images;
    const std::size_t step = (all.size() - 1) / kNumImages + 1;
    for (std::size_t k = 0; k < all.size(); k += step) {
      images.push_back(DecodeEntry(all[k].entry).image);
    }
    scale_ = FindPixelScale(images);
    if (const auto note = rotslam::Describe(scale_, depth)) notes_.push_back(*note);
  }

  // The camera of the topic beside the images, where there is one.
  void FindCamera() {
    const std::string plain = PlainName(topic_);
    const std::string place = ParentOf(plain);
    const std::vector<BagTopic>& topics = reader_->topics();
    std::optional<std::size_t> found;
    std::string elsewhere;
    for (std::size_t k = 0; k < topics.size(); ++k) {
      if (topics[k].type != kRosCameraInfoType || topics[k].count == 0) continue;
      const bool is_beside =
          topics[k].name == place + "/camera_info" || topics[k].name == plain + "/camera_info";
      if (is_beside) found = k;
      if (elsewhere.empty()) elsewhere = topics[k].name;
    }
    if (!found) {
      if (!elsewhere.empty()) {
        notes_.push_back("no " + place + "/camera_info belongs to the images; " + elsewhere +
                         " is ignored");
      }
      return;
    }
    const BagTopic& topic = topics[*found];
    const bool is_rectified = IsRectified(plain);
    std::int64_t num_other = 0;
    std::uint64_t first_checksum = 0;
    for (const BagEntry& entry : reader_->entries()) {
      if (entry.topic != *found) continue;
      // Most say the same but for the stamp, which the checksum leaves out.
      if (own_camera_ && entry.checksum != 0 && entry.checksum == first_checksum) continue;
      try {
        const Camera camera =
            CameraOf(ParseRosCameraInfo(topic, reader_->Read(entry)), is_rectified);
        if (const auto problem = camera.Problem()) throw std::runtime_error(*problem);
        if (!own_camera_) {
          own_camera_ = camera;
          first_checksum = entry.checksum;
        }
        if (camera != *own_camera_) ++num_other;
      } catch (const std::runtime_error& error) {
        if (!own_camera_) {
          notes_.push_back("the calibration in " + topic.name + " is not used: " + error.what());
          return;
        }
        ++num_other;
      }
    }
    notes_.push_back("the calibration is that of " + topic.name +
                     (is_rectified ? ", matrix P, as the images are rectified" : ""));
    if (num_other > 0) {
      notes_.push_back("messages of " + topic.name +
                       " that differ from the first, which is used: " + std::to_string(num_other));
    }
  }

  DecodedImage DecodeEntry(const BagEntry& entry) {
    try {
      return DecodeRosImage(topic_, reader_->Read(entry));
    } catch (const std::runtime_error& error) {
      return {{}, error.what()};
    }
  }

  DecodedImage ReadFrame(const BagEntry& entry) {
    DecodedImage decoded = DecodeEntry(entry);
    return decoded.image.empty() ? decoded : ToEightBits(std::move(decoded.image), scale_);
  }

  std::optional<Frame> Decode() override {
    if (next_ == num_frames_) return std::nullopt;
    const auto number = static_cast<std::size_t>(next_);
    Frame frame;
    frame.id = FrameId{next_++};
    frame.timestamp_s = timestamps_s_[number];
    frame.name = std::to_string(frames_[number].time_ns);
    DecodedImage decoded = ahead_.valid() ? ahead_.get() : ReadFrame(frames_[number].entry);
    if (next_ < num_frames_) {
      ahead_ = std::async(std::launch::async,
                          [this, entry = frames_[number + 1].entry] { return ReadFrame(entry); });
    }
    frame.image = std::move(decoded.image);
    frame.problem = std::move(decoded.problem);
    return frame;
  }

  std::unique_ptr<BagReader> reader_;
  BagTopic topic_;
  std::vector<BagFrame> frames_;
  PixelScale scale_;
  int next_ = 0;
  // Image next_, read and decoded while the caller works on the one before. It alone uses reader_
  // meanwhile, and is the first member to go.
  std::future<DecodedImage> ahead_;
};

}  // namespace

std::unique_ptr<Sequence> OpenBagSequence(const Layout& layout, const SequenceOptions& options) {
  return std::make_unique<BagSequence>(layout, options);
}

}  // namespace rotslam
