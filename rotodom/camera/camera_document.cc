#include "rotodom/camera/camera_document.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>
#include <tinyxml2.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

namespace rotslam {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargestFile = std::uintmax_t{256} << 20;
// Deeper than any calibration file; the tree is taken down recursively.
constexpr std::size_t kDeepest = 200;

// Builds a tree from what parsers tell one after the other: beginnings, ends, values.
class TreeBuilder {
 public:
  std::size_t depth() const { return open_.size(); }
  const TreeNode& root() const { return root_; }
  TreeNode Take() { return std::move(root_); }

  void SetKey(std::string key, int line) {
    open_.back().key = std::move(key);
    open_.back().key_line = line;
    open_.back().has_key = true;
  }

  void Begin(TreeNode::Kind kind, int line) {
    Open open;
    open.node.kind = kind;
    open.node.line = line;
    open_.push_back(std::move(open));
  }

  void End() {
    TreeNode node = std::move(open_.back().node);
    open_.pop_back();
    Add(std::move(node));
  }

  // A value in the place of a key is the key.
  void Add(TreeNode node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == TreeNode::Kind::kMap) {
      if (!parent.has_key) {
        SetKey(std::move(node.text), node.line);
        return;
      }
      node.key = std::move(parent.key);
      node.line = parent.key_line;
      parent.has_key = false;
    }
    parent.node.children.push_back(std::move(node));
  }

  void AddValue(std::string text, int line) {
    TreeNode node;
    node.kind = TreeNode::Kind::kValue;
    node.line = line;
    node.text = std::move(text);
    Add(std::move(node));
  }

  void AddNothing(int line) {
    TreeNode node;
    node.line = line;
    Add(std::move(node));
  }

 private:
  struct Open {
    TreeNode node;
    std::string key;
    int key_line = 0;
    bool has_key = false;
  };

  TreeNode root_;
  std::vector<Open> open_;
};

// Aliases stand for single values only: those of maps could make a file of some lines a tree of
// any size.
class YamlEvents : public YAML::EventHandler {
 public:
  explicit YamlEvents(TreeBuilder& builder) : builder_(builder) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    builder_.AddNothing(mark.line + 1);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = values_.find(anchor);
    if (found == values_.end()) {
      throw YAML::ParserException(mark, "an alias of a map or list is not supported here");
    }
    builder_.AddValue(found->second, mark.line + 1);
  }
  void OnScalar(const YAML::Mark& mark,
                const std::string&,
                YAML::anchor_t anchor,
                const std::string& value) override {
    if (anchor != YAML::NullAnchor) values_[anchor] = value;
    builder_.AddValue(value, mark.line + 1);
  }
  void OnSequenceStart(const YAML::Mark& mark,
                       const std::string&,
                       YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    Begin(TreeNode::Kind::kList, mark);
  }
  void OnSequenceEnd() override { builder_.End(); }
  void OnMapStart(const YAML::Mark& mark,
                  const std::string&,
                  YAML::anchor_t,
                  YAML::EmitterStyle::value) override {
    Begin(TreeNode::Kind::kMap, mark);
  }
  void OnMapEnd() override { builder_.End(); }

 private:
  void Begin(TreeNode::Kind kind, const YAML::Mark& mark) {
    if (builder_.depth() >= kDeepest) throw YAML::ParserException(mark, "nested too deeply");
    builder_.Begin(kind, mark.line + 1);
  }

  TreeBuilder& builder_;
  std::map<YAML::anchor_t, std::string> values_;
};

bool IsKeyLetter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '.' || c == '-';
}

// "Camera.fx:500" with a blank behind the colon, which YAML wants and OpenCV does not.
void SeparateKey(std::string& line) {
  std::size_t at = line.find_first_not_of(' ');
  if (at == std::string::npos) return;
  if (line.compare(at, 2, "- ") == 0) at = line.find_first_not_of(' ', at + 1);
  if (at == std::string::npos || !IsKeyLetter(line[at]) || line[at] == '-') return;
  if (line[at] >= '0' && line[at] <= '9') return;  // a time of day
  while (at < line.size() && IsKeyLetter(line[at])) ++at;
  at = std::min(line.find_first_not_of(' ', at), line.size());
  if (at + 1 >= line.size() || line[at] != ':') return;
  const char next = line[at + 1];
  if (next != ' ' && next != ':' && next != '/' && next != '\\') line.insert(at + 1, 1, ' ');
}

// A line as YAML wants it: OpenCV's first line is empty, tabs and no-break spaces are blanks.
std::string YamlLine(std::string_view given) {
  if (given.starts_with("%YAML")) return "";
  std::string line;
  bool is_indentation = true;
  for (std::size_t k = 0; k < given.size(); ++k) {
    if (given[k] == '\t') {
      line += is_indentation ? "    " : " ";
    } else if (given.substr(k, 2) == "\xc2\xa0") {
      line += ' ';
      ++k;
    } else {
      is_indentation = is_indentation && given[k] == ' ';
      line += given[k];
    }
  }
  SeparateKey(line);
  return line;
}

// Throws YAML::Exception.
TreeNode ParseYaml(const std::string& text) {
  std::istringstream given(text);
  std::stringstream rewritten;
  for (std::string line; std::getline(given, line);) rewritten << YamlLine(line) << '\n';
  TreeBuilder builder;
  YamlEvents events(builder);
  YAML::Parser parser(rewritten);
  parser.HandleNextDocument(events);
  return builder.Take();
}

// Where nlohmann's lexer is; it reads one character beyond a number.
struct JsonPlace {
  int line = 1;
  int line_of_previous = 1;
};

class JsonCharacters {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  JsonCharacters(const char* at, JsonPlace* place) : at_(at), place_(place) {}
  reference operator*() const { return *at_; }
  JsonCharacters& operator++() {
    place_->line_of_previous = place_->line;
    if (*at_ == '\n') ++place_->line;
    ++at_;
    return *this;
  }
  JsonCharacters operator++(int) {
    JsonCharacters before = *this;
    ++*this;
    return before;
  }
  bool operator==(const JsonCharacters& other) const { return at_ == other.at_; }

 private:
  const char* at_;
  JsonPlace* place_;
};

// Parts of a reconstruction that no form reads and that may be huge.
bool IsBulky(const std::string& key) {
  return key == "structure" || key == "control_points" || key == "views" || key == "extrinsics";
}

class JsonEvents : public nlohmann::json_sax<nlohmann::json> {
 public:
  JsonEvents(TreeBuilder& builder, const JsonPlace& place) : builder_(builder), place_(place) {}

  const std::string& problem() const { return problem_; }

  bool null() override {
    if (Keeps()) builder_.AddNothing(place_.line);
    return true;
  }
  bool boolean(bool value) override { return Value(value ? "1" : "0", place_.line); }
  bool number_integer(number_integer_t value) override {
    return Value(std::to_string(value), place_.line_of_previous);
  }
  bool number_unsigned(number_unsigned_t value) override {
    return Value(std::to_string(value), place_.line_of_previous);
  }
  bool number_float(number_float_t, const string_t& text) override {
    return Value(text, place_.line_of_previous);
  }
  bool string(string_t& value) override { return Value(value, place_.line); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return Begin(TreeNode::Kind::kMap); }
  bool key(string_t& value) override {
    if (!Keeps()) return true;
    builder_.SetKey(value, place_.line);
    if (builder_.depth() == 1 && IsBulky(value)) skips_next_ = true;
    return true;
  }
  bool end_object() override { return End(); }
  bool start_array(std::size_t) override { return Begin(TreeNode::Kind::kList); }
  bool end_array() override { return End(); }
  bool parse_error(std::size_t,
                   const std::string& token,
                   const nlohmann::detail::exception&) override {
    std::string shown;
    for (const char c : token.substr(0, 40)) {
      if (c >= ' ' && c <= '~') shown += c;
    }
    problem_ = "is not JSON at '" + shown + "'";
    return false;
  }

 private:
  // nlohmann's own word for the number of open arrays and objects is not to be had.
  bool Keeps() const { return skipped_depth_ == 0; }

  bool Value(std::string text, int line) {
    if (!Keeps()) return true;
    skips_next_ = false;
    builder_.AddValue(std::move(text), line);
    return true;
  }
  bool Begin(TreeNode::Kind kind) {
    if (skips_next_ || !Keeps()) {
      ++skipped_depth_;
      skips_next_ = false;
      return true;
    }
    if (builder_.depth() >= kDeepest) {
      problem_ = "is nested too deeply";
      return false;
    }
    builder_.Begin(kind, place_.line);
    return true;
  }
  bool End() {
    if (Keeps()) {
      builder_.End();
    } else if (--skipped_depth_ == 0) {
      builder_.AddNothing(place_.line);
    }
    return true;
  }

  TreeBuilder& builder_;
  const JsonPlace& place_;
  bool skips_next_ = false;
  std::size_t skipped_depth_ = 0;
  std::string problem_;
};

// A map in braces whose first key stands without quotes is YAML's.
bool LooksLikeJson(std::string_view text) {
  if (!text.starts_with('{')) return false;
  const std::size_t first = text.find_first_not_of(" \t\r\n", 1);
  return first == std::string_view::npos || text[first] == '"' || text[first] == '}';
}

TreeNode ParseJson(const fs::path& file, const std::string& text) {
  TreeBuilder builder;
  JsonPlace place;
  JsonEvents events(builder, place);
  const bool parsed = nlohmann::json::sax_parse(JsonCharacters(text.data(), &place),
                                                JsonCharacters(text.data() + text.size(), &place),
                                                &events);
  if (!parsed) FailAt(file, place.line, events.problem());
  return builder.Take();
}

// tinyxml2 refuses files that are nested too deeply.
TreeNode FromXml(const tinyxml2::XMLElement& element) {
  TreeNode node;
  node.key = element.Name();
  node.line = element.GetLineNum();
  bool is_list = true;
  for (const auto* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    node.children.push_back(FromXml(*child));
    is_list = is_list && node.children.back().key == "_";
  }
  if (!node.children.empty()) {
    node.kind = is_list ? TreeNode::Kind::kList : TreeNode::Kind::kMap;
    return node;
  }
  const char* text = element.GetText();
  if (text == nullptr) return node;
  const std::string_view given = text;
  const std::size_t begin = given.find_first_not_of(" \t\n\"");
  if (begin == std::string_view::npos) return node;
  node.kind = TreeNode::Kind::kValue;
  node.text = given.substr(begin, given.find_last_not_of(" \t\n\"") - begin + 1);
  return node;
}

TreeNode ParseXml(const fs::path& file, const std::string& text) {
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    FailAt(file,
           std::max(document.ErrorLineNum(), 1),
           std::string("is not XML: ") + tinyxml2::XMLDocument::ErrorIDToName(document.ErrorID()));
  }
  const tinyxml2::XMLElement* root = document.RootElement();
  if (root == nullptr) FailAt(file, 1, "is not XML: it has no element");
  return FromXml(*root);
}

std::vector<TextRow> RowsOf(const std::string& text) {
  std::vector<TextRow> rows;
  std::istringstream stream(text);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::istringstream words(line);
    TextRow row{number, {}};
    for (std::string word; words >> word;) row.words.push_back(std::move(word));
    if (!row.words.empty() && row.words.front().front() != '#') rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

CameraDocument::CameraDocument(const fs::path& file) : file_(file) {
  std::error_code ignored;
  if (const auto size = fs::file_size(file_, ignored); !ignored && size > kLargestFile) {
    FailAt(file_, 0, "is larger than 256 MB, no calibration file");
  }
  std::string bytes = ReadBytes(file_);
  const bool is_utf16 = bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff");
  if (!is_utf16 && bytes.find('\0') != std::string::npos) {
    binary_ = std::move(bytes);
    return;
  }
  text_ = ReadText(file_);
  rows_ = RowsOf(text_);
}

void CameraDocument::Parse() const {
  if (tree_) return;
  tree_.emplace();
  const std::size_t begin = text_.find_first_not_of(" \t\n");
  if (begin == std::string::npos) return;
  try {
    if (text_[begin] == '<') {
      tree_ = ParseXml(file_, text_);
    } else if (LooksLikeJson(std::string_view(text_).substr(begin))) {
      tree_ = ParseJson(file_, text_);
    } else {
      tree_ = ParseYaml(text_);
    }
  } catch (const YAML::Exception& error) {
    parse_problem_ = AtLine(file_, std::max(error.mark.line, 0) + 1, "is not YAML: " + error.msg);
  } catch (const std::runtime_error& error) {
    parse_problem_ = error.what();
  }
}

Section CameraDocument::root() const {
  Parse();
  return Section(file_, *tree_);
}

const std::string& CameraDocument::parse_problem() const {
  Parse();
  return parse_problem_;
}

}  // namespace rotslam
