#include "rotodom/loop/vocabulary_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace rotslam {
namespace {

static_assert(std::endian::native == std::endian::little, "binary vocabularies are copied as is");

// ---- both kinds

constexpr int kL1Norm = 0;
// As DBoW2 numbers them.
constexpr std::array<const char*, 6> kScorings = {
    "L1_NORM", "L2_NORM", "CHI_SQUARE", "KL", "BHATTACHARYYA", "DOT_PRODUCT"};
constexpr int kNumWeightings = 4;

// What is wrong with a header; nullopt when it can be read on.
std::optional<std::string> ProblemOfHeader(std::int64_t branching,
                                           std::int64_t depth,
                                           std::int64_t scoring,
                                           std::int64_t weighting) {
  if (branching < 2 || branching > 255) {
    return "the branching (k) is " + std::to_string(branching) + ", must be 2 to 255";
  }
  if (depth < 1 || depth > 20) {
    return "the depth (L) is " + std::to_string(depth) + ", must be 1 to 20";
  }
  if (weighting < 0 || weighting >= kNumWeightings) {
    return "there is no weighting " + std::to_string(weighting) + ", only 0 to 3";
  }
  if (scoring < 0 || scoring >= static_cast<std::int64_t>(kScorings.size())) {
    return "there is no scoring " + std::to_string(scoring) + ", only 0 to 5";
  }
  if (scoring != kL1Norm) {
    return std::string("it asks for ") + kScorings[static_cast<std::size_t>(scoring)] +
           " scores; only L1_NORM (0) is supported, as ORB-SLAM's vocabularies have it";
  }
  return std::nullopt;
}

// ---- text

class TextReader {
 public:
  TextReader(std::string name, std::string_view text) : name_(std::move(name)), text_(text) {}

  Vocabulary Read();

 private:
  struct Line {
    std::string_view rest;
    int number = 0;
  };

  [[noreturn]] void Refuse(const std::string& reason) const {
    throw std::runtime_error(name_ + ":" + std::to_string(line_.number) + ": " + reason);
  }

  bool NextLine();
  std::string_view NextWord();
  std::int64_t NextInteger(const char* what, std::int64_t least, std::int64_t most);
  float NextWeight();
  void ExpectEndOfLine();
  void ReadHeader();
  void ReadNode();
  void CheckBranches() const;
  VocabularyTree MakeTree() const;

  std::string name_;
  std::string_view text_;  // what has not been read
  Line line_;

  int branching_ = 0;
  int depth_ = 0;
  Weighting weighting_ = Weighting::kTfIdf;
  // By node id.
  std::vector<std::uint32_t> parents_ = {0};
  std::vector<bool> is_leaf_ = {false};
  std::vector<BinaryDescriptor> descriptors_ = {BinaryDescriptor{}};
  std::vector<float> weights_ = {0.0F};
  std::vector<std::uint8_t> levels_ = {0};
  std::vector<std::uint8_t> num_children_ = {0};
};

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// For a message: a few printable characters.
std::string Shown(std::string_view word) {
  std::string shown;
  for (const char c : word.substr(0, 20))
    shown += std::isprint(static_cast<unsigned char>(c)) ? c : '?';
  return "\"" + shown + (word.size() > 20 ? "...\"" : "\"");
}

bool TextReader::NextLine() {
  if (text_.empty()) return false;
  ++line_.number;
  const std::size_t end = text_.find('\n');
  if (end == std::string_view::npos) {
    line_.rest = text_;
    Refuse("the last line has no end: the file is cut off; copy or unpack it again");
  }
  line_.rest = text_.substr(0, end);
  text_.remove_prefix(end + 1);
  return true;
}

std::string_view TextReader::NextWord() {
  std::string_view& rest = line_.rest;
  while (!rest.empty() && IsBlank(rest.front())) rest.remove_prefix(1);
  std::size_t length = 0;
  while (length < rest.size() && !IsBlank(rest[length])) ++length;
  const std::string_view word = rest.substr(0, length);
  rest.remove_prefix(length);
  return word;
}

std::int64_t TextReader::NextInteger(const char* what, std::int64_t least, std::int64_t most) {
  const std::string_view word = NextWord();
  if (word.empty()) Refuse(std::string("the line ends before ") + what);
  std::int64_t value = 0;
  const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (code != std::errc() || stop != word.data() + word.size() || value < least || value > most) {
    Refuse("expected " + std::string(what) + ", found " + Shown(word));
  }
  return value;
}

float TextReader::NextWeight() {
  const std::string_view word = NextWord();
  if (word.empty()) Refuse("the line ends before the weight");
  double value = 0.0;
  const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (code != std::errc() || stop != word.data() + word.size() ||
      !(value >= 0.0 && value <= std::numeric_limits<float>::max())) {
    Refuse("expected a weight, zero or more, found " + Shown(word));
  }
  return static_cast<float>(value);
}

void TextReader::ExpectEndOfLine() {
  const std::string_view word = NextWord();
  if (!word.empty()) Refuse("the line goes on after its last number: " + Shown(word));
}

void TextReader::ReadHeader() {
  constexpr std::int64_t kAny = std::numeric_limits<int>::max();
  NextLine();
  const std::int64_t branching = NextInteger("the branching (k)", -kAny, kAny);
  const std::int64_t depth = NextInteger("the depth (L)", -kAny, kAny);
  const std::int64_t scoring = NextInteger("the scoring", -kAny, kAny);
  const std::int64_t weighting = NextInteger("the weighting", -kAny, kAny);
  ExpectEndOfLine();
  if (const auto problem = ProblemOfHeader(branching, depth, scoring, weighting)) Refuse(*problem);
  branching_ = static_cast<int>(branching);
  depth_ = static_cast<int>(depth);
  weighting_ = static_cast<Weighting>(weighting);
}

void TextReader::ReadNode() {
  const auto id = static_cast<std::int64_t>(parents_.size());
  const auto parent =
      static_cast<std::size_t>(NextInteger("the number of an earlier node", 0, id - 1));
  const bool is_leaf = NextInteger("0 or 1 (is this a word?)", 0, 1) == 1;
  std::array<std::uint8_t, kDescriptorBytes> bytes;
  for (std::uint8_t& byte : bytes) {
    byte = static_cast<std::uint8_t>(NextInteger("a descriptor's byte, 0 to 255", 0, 255));
  }
  const float weight = NextWeight();
  ExpectEndOfLine();
  if (is_leaf_[parent]) Refuse("node " + std::to_string(parent) + " is a word and has a child");
  if (num_children_[parent] >= branching_) {
    Refuse("node " + std::to_string(parent) + " has more children than the header allows (" +
           std::to_string(branching_) + ")");
  }
  if (levels_[parent] >= depth_) {
    Refuse("the tree is deeper than the header says (" + std::to_string(depth_) + ")");
  }
  ++num_children_[parent];
  parents_.push_back(static_cast<std::uint32_t>(parent));
  is_leaf_.push_back(is_leaf);
  descriptors_.push_back(std::bit_cast<BinaryDescriptor>(bytes));
  weights_.push_back(is_leaf ? weight : 0.0F);
  levels_.push_back(static_cast<std::uint8_t>(levels_[parent] + 1));
  num_children_.push_back(0);
}

void TextReader::CheckBranches() const {
  for (std::size_t id = 0; id < parents_.size(); ++id) {
    if (is_leaf_[id] || num_children_[id] > 0) continue;
    throw std::runtime_error(name_ + ":" + std::to_string(id + 1) + ": node " + std::to_string(id) +
                             " has neither children nor a word: the file is cut off; copy or "
                             "unpack it again");
  }
}

VocabularyTree TextReader::MakeTree() const {
  const std::size_t count = parents_.size();
  // All children of node 0, of node 1 ..., ascending.
  std::vector<std::uint32_t> first_children(count, 0);
  std::exclusive_scan(
      num_children_.begin(), num_children_.end(), first_children.begin(), std::uint32_t{0});
  std::vector<std::uint32_t> children(count - 1);
  std::vector<std::uint32_t> next = first_children;
  for (std::size_t id = 1; id < count; ++id) {
    children[next[parents_[id]]++] = static_cast<std::uint32_t>(id);
  }
  VocabularyTree tree;
  tree.branching = branching_;
  tree.depth = depth_;
  tree.weighting = weighting_;
  tree.ids.reserve(count);
  tree.ids.push_back(0);
  for (std::size_t place = 0; place < count; ++place) {
    const auto begin = children.begin() + first_children[tree.ids[place]];
    tree.ids.insert(tree.ids.end(), begin, begin + num_children_[tree.ids[place]]);
  }
  bool in_order = true;
  tree.num_children.reserve(count);
  tree.descriptors.reserve(count);
  tree.weights.reserve(count);
  for (std::size_t place = 0; place < count; ++place) {
    const std::uint32_t id = tree.ids[place];
    in_order = in_order && id == place;
    tree.num_children.push_back(num_children_[id]);
    tree.descriptors.push_back(descriptors_[id]);
    tree.weights.push_back(weights_[id]);
  }
  if (in_order) tree.ids.clear();
  return tree;
}

Vocabulary TextReader::Read() {
  ReadHeader();
  while (NextLine()) {
    const std::string_view line = line_.rest;
    if (line.find_first_not_of(" \t\r") == std::string_view::npos) {
      if (text_.find_first_not_of(" \t\r\n") == std::string_view::npos) break;
      Refuse("the line is empty, and more follow");
    }
    ReadNode();
  }
  if (parents_.size() < 2) Refuse("no nodes follow the header: the file is cut off");
  CheckBranches();
  return Vocabulary(MakeTree());
}

// ---- binary

constexpr std::string_view kMagic = "ROTVOC\r\n";
constexpr std::uint32_t kVersion = 1;

struct BinaryHeader {
  std::array<char, 8> magic = {};
  std::uint32_t version = kVersion;
  std::uint32_t branching = 0;
  std::uint32_t depth = 0;
  std::uint32_t scoring = kL1Norm;
  std::uint32_t weighting = 0;
  std::uint32_t num_nodes = 0;
  std::uint32_t num_words = 0;
  std::uint32_t has_ids = 0;
  std::array<std::uint32_t, 2> reserved = {};
};
static_assert(sizeof(BinaryHeader) == 48);

std::uint64_t FileSize(const BinaryHeader& header) {
  const std::uint64_t nodes = header.num_nodes;
  return sizeof(BinaryHeader) + nodes + (nodes - 1) * kDescriptorBytes +
         std::uint64_t{header.num_words} * sizeof(float) +
         (header.has_ids != 0 ? nodes * sizeof(std::uint32_t) : 0) + sizeof(std::uint64_t);
}

template <class Value>
void Append(const Value* values, std::size_t count, std::string& bytes) {
  if (count > 0) bytes.append(reinterpret_cast<const char*>(values), count * sizeof(Value));
}

// Copies `count` values; the caller has checked that they are there.
template <class Value>
void Take(std::string_view& bytes, Value* values, std::size_t count) {
  if (count == 0) return;  // `values` may be null then
  std::memcpy(values, bytes.data(), count * sizeof(Value));
  bytes.remove_prefix(count * sizeof(Value));
}

BinaryHeader CheckedHeader(std::string_view bytes, const std::string& name) {
  const auto refuse = [&name](const std::string& reason) {
    throw std::runtime_error(name + ": " + reason);
  };
  if (bytes.size() < sizeof(BinaryHeader)) {
    refuse("the vocabulary is cut off in its header; copy it again");
  }
  BinaryHeader header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  if (header.version != kVersion) {
    refuse("the vocabulary has version " + std::to_string(header.version) +
           ", this program reads " + std::to_string(kVersion) +
           "; convert it with the program that wrote it");
  }
  if (const auto problem =
          ProblemOfHeader(header.branching, header.depth, header.scoring, header.weighting)) {
    refuse(*problem);
  }
  if (header.num_nodes < 2 || header.num_words >= header.num_nodes || header.has_ids > 1 ||
      FileSize(header) != bytes.size()) {
    refuse("the vocabulary has " + std::to_string(bytes.size()) + " bytes, its header speaks of " +
           std::to_string(header.num_nodes < 2 ? 0 : FileSize(header)) +
           ": the file is cut off or damaged; copy it again");
  }
  return header;
}

// ---- telling them apart

constexpr std::uintmax_t kMaxFileBytes = std::uintmax_t{2} << 30;

// Message about a file of another format: what it seems to be, and what to do.
std::string Foreign(std::string_view start) {
  constexpr std::string_view kExpected =
      "expected ORB-SLAM's text format (ORBvoc.txt) or one written by `rotslam vocabulary`";
  const auto is = [start](std::string_view magic) { return start.starts_with(magic); };
  std::string is_what = "is no vocabulary";
  if (is("\x1F\x8B"))
    return "is compressed with gzip; unpack it (tar xzf or gunzip) and name the file inside";
  if (is("BZh") ||
      is("\xFD"
         "7zXZ") ||
      is("PK\x03\x04"))
    return "is a compressed archive; unpack it and name the file inside";
  if (start.size() > 262 && start.substr(257, 5) == "ustar")
    return "is a tar archive; unpack it and name the file inside";
  if (is("%YAML") || is("<?xml") || is("vocabulary:")) {
    is_what = "is a vocabulary in OpenCV's YAML or XML form, which is not read";
  } else if (is(std::string_view("\x81\x3F\x86\xB1\x14\0\0\0", 8))) {
    is_what = "is a vocabulary in DBoW3's binary form, which is not read";
  } else if (is("\x89PNG") || is("\xFF\xD8\xFF")) {
    is_what = "is an image";
  }
  return is_what + "; " + std::string(kExpected);
}

// Four integers on the first line.
bool LooksLikeText(std::string_view start) {
  const std::string_view line = start.substr(0, start.find('\n'));
  return !line.empty() && line.find_first_not_of("0123456789-+. \t\r") == std::string_view::npos &&
         line.find_first_of("0123456789") != std::string_view::npos;
}

std::string ReadStart(std::ifstream& file, std::size_t count) {
  std::string start(count, '\0');
  file.read(start.data(), static_cast<std::streamsize>(count));
  start.resize(static_cast<std::size_t>(file.gcount()));
  return start;
}

std::string ReadRest(std::ifstream& file, std::string bytes, std::uintmax_t size) {
  const std::size_t have = bytes.size();
  if (size <= have) return bytes;
  bytes.resize(size);
  file.read(bytes.data() + have, static_cast<std::streamsize>(size - have));
  bytes.resize(have + static_cast<std::size_t>(file.gcount()));
  return bytes;
}

}  // namespace

std::uint64_t VocabularyChecksum(std::string_view bytes) {
  std::uint64_t sum = 0x243F6A8885A308D3U + bytes.size();
  while (!bytes.empty()) {
    std::uint64_t word = 0;
    const std::size_t length = std::min(bytes.size(), sizeof(word));
    std::memcpy(&word, bytes.data(), length);
    bytes.remove_prefix(length);
    sum = (sum ^ word) * 0x9E3779B97F4A7C15U;
    sum ^= sum >> 32;
  }
  return sum;
}

Vocabulary DecodeBinary(std::span<const char> file_bytes, const std::string& name) {
  const std::string_view all(file_bytes.data(), file_bytes.size());
  const BinaryHeader header = CheckedHeader(all, name);
  std::uint64_t checksum = 0;
  std::memcpy(&checksum, all.data() + all.size() - sizeof(checksum), sizeof(checksum));
  if (checksum != VocabularyChecksum(all.substr(0, all.size() - sizeof(checksum)))) {
    throw std::runtime_error(name +
                             ": the vocabulary is damaged (its checksum differs); copy it again");
  }
  std::string_view bytes = all.substr(sizeof(BinaryHeader));
  VocabularyTree tree;
  tree.branching = static_cast<int>(header.branching);
  tree.depth = static_cast<int>(header.depth);
  tree.weighting = static_cast<Weighting>(header.weighting);
  tree.num_children.resize(header.num_nodes);
  tree.descriptors.resize(header.num_nodes);
  std::vector<float> word_weights(header.num_words);
  Take(bytes, tree.num_children.data(), header.num_nodes);
  Take(bytes, tree.descriptors.data() + 1, header.num_nodes - 1);
  Take(bytes, word_weights.data(), header.num_words);
  if (header.has_ids != 0) {
    tree.ids.resize(header.num_nodes);
    Take(bytes, tree.ids.data(), header.num_nodes);
  }
  tree.weights.resize(header.num_nodes);
  std::size_t word = 0;
  for (std::size_t place = 0; place < tree.num_children.size(); ++place) {
    if (tree.num_children[place] > 0) continue;
    if (word < word_weights.size()) tree.weights[place] = word_weights[word];
    ++word;
  }
  std::optional<std::string> problem = tree.Problem();
  if (word != word_weights.size()) problem = "the numbers of words and of weights differ";
  if (problem) throw std::runtime_error(name + ": the vocabulary is damaged: " + *problem);
  return Vocabulary(std::move(tree));
}

std::string EncodeBinary(const Vocabulary& vocabulary) {
  const VocabularyTree& tree = vocabulary.tree();
  BinaryHeader header;
  kMagic.copy(header.magic.data(), header.magic.size());
  header.branching = static_cast<std::uint32_t>(tree.branching);
  header.depth = static_cast<std::uint32_t>(tree.depth);
  header.weighting = static_cast<std::uint32_t>(tree.weighting);
  header.num_nodes = static_cast<std::uint32_t>(tree.num_children.size());
  header.num_words = static_cast<std::uint32_t>(vocabulary.num_words());
  header.has_ids = tree.ids.empty() ? 0 : 1;
  std::vector<float> word_weights;
  word_weights.reserve(header.num_words);
  for (std::size_t place = 0; place < tree.num_children.size(); ++place) {
    if (tree.num_children[place] == 0) word_weights.push_back(tree.weights[place]);
  }
  std::string bytes;
  bytes.reserve(FileSize(header));
  Append(&header, 1, bytes);
  Append(tree.num_children.data(), tree.num_children.size(), bytes);
  Append(tree.descriptors.data() + 1, tree.descriptors.size() - 1, bytes);
  Append(word_weights.data(), word_weights.size(), bytes);
  Append(tree.ids.data(), tree.ids.size(), bytes);
  const std::uint64_t checksum = VocabularyChecksum(bytes);
  Append(&checksum, 1, bytes);
  return bytes;
}

std::string EncodeText(const Vocabulary& vocabulary) {
  const VocabularyTree& tree = vocabulary.tree();
  const std::size_t count = tree.num_children.size();
  const auto id_of = [&tree](std::size_t place) {
    return tree.ids.empty() ? static_cast<std::uint32_t>(place) : tree.ids[place];
  };
  std::vector<std::size_t> places(count);
  std::vector<std::uint32_t> parents(count);
  std::size_t child = 1;
  for (std::size_t place = 0; place < count; ++place) {
    places[id_of(place)] = place;
    for (int k = 0; k < tree.num_children[place]; ++k) parents[child++] = id_of(place);
  }
  std::string text = std::to_string(tree.branching) + ' ' + std::to_string(tree.depth) + ' ' +
                     std::to_string(kL1Norm) + ' ' +
                     std::to_string(static_cast<int>(tree.weighting)) + '\n';
  for (std::size_t id = 1; id < count; ++id) {
    const std::size_t place = places[id];
    text += std::to_string(parents[place]);
    text += tree.num_children[place] == 0 ? " 1" : " 0";
    const auto bytes =
        std::bit_cast<std::array<std::uint8_t, kDescriptorBytes>>(tree.descriptors[place]);
    for (const std::uint8_t byte : bytes) (text += ' ') += std::to_string(byte);
    std::array<char, 32> weight;
    const auto [end, code] =
        std::to_chars(weight.data(), weight.data() + weight.size(), tree.weights[place]);
    (text += ' ').append(weight.data(), end);
    text += '\n';
  }
  return text;
}

Vocabulary ReadVocabulary(const std::filesystem::path& path) {
  const std::string name = path.string();
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    throw std::runtime_error(name + ": there is no such file; name a vocabulary file");
  }
  if (!std::filesystem::is_regular_file(status)) {
    throw std::runtime_error(name + ": is not a file; name a vocabulary file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) {
    throw std::runtime_error(name + ": " + std::generic_category().message(errno));
  }
  std::string start = ReadStart(file, 512);
  if (start.empty()) throw std::runtime_error(name + ": is empty; copy the vocabulary again");
  const bool is_binary = start.starts_with(kMagic);
  if (!is_binary && !LooksLikeText(start)) throw std::runtime_error(name + ": " + Foreign(start));
  if (size > kMaxFileBytes) {
    throw std::runtime_error(name + ": is larger than 2 GB, which no vocabulary is");
  }
  const std::string bytes = ReadRest(file, std::move(start), size);
  if (is_binary) return DecodeBinary(bytes, name);
  return TextReader(name, bytes).Read();
}

}  // namespace rotslam
