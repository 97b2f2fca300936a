#include "apps/cli/run_directory/checkpoint.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <variant>

#include "apps/cli/run_directory/unfinished.h"
#include "apps/cli/versions.h"
#include "output/files/atomic_file.h"
#include "output/files/option_list.h"
#include "output/tables/summary.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Changes with what is written.
constexpr std::string_view kMagic = "rotslam checkpoint 8\n";

std::string Hex(std::uint64_t number) {
  std::array<char, 17> text = {};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(number));
  return text.data();
}

template <class... Values>
std::string ChecksumOf(Values... values) {
  ArchiveWriter archive;
  archive(values...);
  return Hex(Checksum(archive.TakeBytes()));
}

std::string Text(const OptionValue& value) {
  struct Printer {
    std::string operator()(bool on) const { return on ? "true" : "false"; }
    std::string operator()(int number) const { return std::to_string(number); }
    std::string operator()(std::uint64_t number) const { return std::to_string(number); }
    std::string operator()(double number) const {
      std::array<char, 32> text = {};
      std::snprintf(text.data(), text.size(), "%.17g", number);
      return text.data();
    }
    std::string operator()(const std::string& text) const { return text; }
  };
  return std::visit(Printer(), value);
}

std::string DescribeCamera(const Camera& camera) {
  const auto& [model, width, height, fx, fy, cx, cy, distortion, readout_s, from, knows] = camera;
  return Describe(camera) + " (" +
         ChecksumOf(model, width, height, fx, fy, cx, cy, distortion, readout_s, from, knows) + ")";
}

// Names, sizes and times of the images, in their order.
std::string DescribeImages(const Sequence& sequence) {
  std::vector<std::string> names;
  std::vector<std::uintmax_t> sizes;
  for (const fs::path& file : sequence.Files()) {
    std::error_code error;
    names.push_back(file.filename().string());
    sizes.push_back(fs::file_size(file, error));
  }
  const std::string count = std::to_string(names.size());
  return count + (names.size() == 1 ? " file (" : " files (") +
         ChecksumOf(names, sizes, sequence.timestamps_s()) + ")";
}

std::string DescribeVocabulary(const std::string& path) {
  if (path.empty()) return "the program's own";
  std::error_code error;
  const fs::path file = path;
  return file.filename().string() + ", " + std::to_string(fs::file_size(file, error)) + " bytes";
}

std::string DescribeMasksOf(const Input& input) {
  Mask common = input.masks.common();
  return ChecksumOf(common) + (input.masks.folder().empty() ? "" : ", ") +
         input.masks.folder().string() + (input.find_static_content ? "" : ", no automatic one");
}

std::string ReadAll(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// A damaged file may say anything, and a message is one line.
std::string OneLine(std::string text) {
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  std::replace_if(text.begin(), text.end(), is_control, '?');
  return text;
}

// In words: the first thing that is not the same.
std::string Difference(const RunIdentity& was, const RunIdentity& is) {
  for (std::size_t k = 0; k < std::min(was.size(), is.size()); ++k) {
    if (was[k] == is[k]) continue;
    if (was[k].first != is[k].first) break;
    return is[k].first + " was " + OneLine(was[k].second) + ", is now " + is[k].second;
  }
  return "other options";
}

}  // namespace

void AddCheckpointEveryFlag(CLI::App& command, CheckpointFlags& flags) {
  command
      .add_option(
          "--checkpoint-every",
          flags.every,
          "Frames after which the work so far is kept for --resume; 0: never (default: 500)")
      ->check(AtLeastZero());
}

void AddCheckpointFlags(CLI::App& command, CheckpointFlags& flags) {
  AddCheckpointEveryFlag(command, flags);
  command.add_flag("--resume",
                   flags.resume,
                   "Go on where an interrupted run with the same --out stopped; the result is that "
                   "of one in a single piece");
}

RunIdentity IdentityOf(const std::string& command,
                       const Input& input,
                       const InputFlags& flags,
                       const RunOptions& options,
                       std::uint64_t seed) {
  RunIdentity identity = {
      {"rotslam", Version() + " (" + ChecksumOf(VersionText()) + ")"},
      {"the command", command},
      {"the sequence", DescribeImages(input.sequence())},
      {"the camera", DescribeCamera(input.camera)},
      {"the vocabulary", DescribeVocabulary(flags.vocabulary)},
      {"the mask", DescribeMasksOf(input)},
      {"the seed", std::to_string(seed)},
      {"max_image_side_px", std::to_string(options.max_image_side_px)},
  };
  const auto add = [&](const std::string& name, const auto& part) {
    for (const OptionEntry& option : DescribeOptions(part)) {
      identity.emplace_back(name + "." + option.key, Text(option.value));
    }
  };
  add("sequence", options.sequence);
  add("rotodom", options.rotodom);
  add("readout", options.readout);
  add("loop", options.loop);
  return identity;
}

Checkpoint::Checkpoint(const fs::path& run,
                       const CheckpointFlags& flags,
                       RunIdentity identity,
                       Progress& progress)
    : folder_(UnfinishedFolder(run)),
      every_(flags.every),
      identity_(std::move(identity)),
      progress_(progress) {
  const bool is_there = fs::exists(folder_ / "state.bin");
  if (flags.resume && is_there) {
    Open(identity_);
    return;
  }
  if (flags.resume) {
    progress_.Say("no checkpoint in " + run.string() + ": starts with the first frame");
  } else if (is_there) {
    progress_.Warn("throws away the checkpoint of the interrupted run in " + run.string() +
                   "; --resume would have gone on from it");
  }
  Remove();
  if (every_ > 0) StartWriting();
}

Checkpoint::~Checkpoint() {
  writer_.reset();
  if (!fs::exists(folder_ / "state.bin")) Remove();
}

void Checkpoint::Open(const RunIdentity& identity) {
  const fs::path file = folder_ / "state.bin";
  const std::string bytes = ReadAll(file);
  std::uint64_t checksum = 0;
  if (!bytes.starts_with(kMagic) || bytes.size() < kMagic.size() + sizeof(checksum)) {
    Refuse(file.string() + ": is no checkpoint of this version");
  }
  std::memcpy(&checksum, bytes.data() + kMagic.size(), sizeof(checksum));
  const std::string_view body = std::string_view(bytes).substr(kMagic.size() + sizeof(checksum));
  if (Checksum(body) != checksum) Refuse(file.string() + ": is damaged (checksum)");
  RunIdentity identity_then;
  try {
    ArchiveReader archive(body);
    archive(identity_then, committed_.num_records, committed_.num_bytes, committed_.checksum);
    archive(state_, found_);
    archive.ExpectEnd();
  } catch (const std::runtime_error& error) {
    Refuse(file.string() + ": " + error.what());
  }
  if (identity_then != identity) {
    Refuse(file.string() + ": is of another run: " + Difference(identity_then, identity));
  }
  try {
    reader_ = std::make_unique<JournalReader>(folder_ / "frames.bin", committed_);
  } catch (const std::runtime_error& error) {
    Refuse(error.what());
  }
}

void Checkpoint::Refuse(const std::string& reason) {
  throw std::runtime_error(reason + "; leave --resume out to start anew");
}

std::optional<RecordedFrame> Checkpoint::NextRecorded() {
  if (!reader_) return std::nullopt;
  std::optional<std::string> bytes;
  try {
    bytes = reader_->Next();
  } catch (const std::runtime_error& error) {
    Refuse(error.what());
  }
  if (bytes) {
    try {
      RecordedFrame frame;
      ArchiveReader archive(*bytes);
      archive(frame);
      archive.ExpectEnd();
      return frame;
    } catch (const std::runtime_error& error) {
      Refuse((folder_ / "frames.bin").string() + ": a record " + error.what());
    }
  }
  reader_.reset();
  progress_.Say("resumed: frames 0 to " + std::to_string(committed_.num_records - 1) +
                " are from the checkpoint");
  if (every_ > 0) StartWriting();
  return std::nullopt;
}

void Checkpoint::Restore(const std::function<void(const TrackingState&)>& restore) const {
  try {
    restore(state_);
  } catch (const std::runtime_error& error) {
    Refuse((folder_ / "state.bin").string() + ": the odometry's state " + error.what());
  }
}

void Checkpoint::StartOver(const FoundInImages& found) {
  reader_.reset();
  Remove();
  committed_ = {};
  found_ = found;
  if (every_ > 0) StartWriting();
}

void Checkpoint::StartWriting() {
  try {
    fs::create_directories(folder_);
    writer_ = std::make_unique<JournalWriter>(folder_ / "frames.bin", committed_);
  } catch (const std::runtime_error& error) {
    GiveUp(error.what());
  }
}

void Checkpoint::Append(RecordedFrame& frame) {
  if (!IsOn()) return;
  ArchiveWriter archive;
  archive(frame);
  try {
    writer_->Append(archive.TakeBytes());
  } catch (const std::runtime_error& error) {
    GiveUp(error.what());
  }
}

bool Checkpoint::IsDue() const {
  return IsOn() && writer_->extent().num_records >=
                       committed_.num_records + static_cast<std::uint64_t>(every_);
}

void Checkpoint::Commit(TrackingState state) {
  if (!IsOn() || writer_->extent().num_records == committed_.num_records) return;
  try {
    writer_->Sync();
    JournalExtent extent = writer_->extent();
    ArchiveWriter body;
    body(identity_, extent.num_records, extent.num_bytes, extent.checksum, state, found_);
    const std::string bytes = body.TakeBytes();
    ArchiveWriter checksum;
    std::uint64_t sum = Checksum(bytes);
    checksum(sum);
    ReplaceFile(folder_ / "state.bin", std::string(kMagic) + checksum.TakeBytes() + bytes);
    committed_ = extent;
  } catch (const std::runtime_error& error) {
    GiveUp(error.what());
  }
}

void Checkpoint::GiveUp(const std::string& reason) {
  progress_.Warn(
      "no checkpoints from here on: " + reason +
      (committed_.num_records == 0
           ? std::string()
           : "; the one after " + std::to_string(committed_.num_records) + " frames stays"));
  if (!writer_) return;
  try {
    writer_->CutOff(committed_);  // others may need the room
  } catch (const std::runtime_error&) {
    // It has been said.
  }
  writer_.reset();
}

void Checkpoint::Remove() {
  writer_.reset();
  std::error_code error;
  // What makes a checkpoint of the frames goes first.
  fs::remove(folder_ / "state.bin", error);
  fs::remove(folder_ / "frames.bin", error);
  fs::remove(folder_, error);
}

}  // namespace rotslam
