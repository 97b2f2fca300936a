#include "rotodom/camera/section.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Text of a file as it is shown in a message: short, and on one line.
std::string Shown(const std::string& text) {
  constexpr std::size_t kLongest = 60;
  std::string shown = text.substr(0, kLongest);
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return c >= 0 && c < ' '; }, ' ');
  return text.size() > kLongest ? shown + "..." : shown;
}

bool ParseNumber(const std::string& text, double& value) {
  const char* begin = text.data() + (text.size() > 1 && text.front() == '+' ? 1 : 0);
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(begin, end, value);
  return !text.empty() && result.ec == std::errc() && result.ptr == end;
}

// "380.5" of "380,5"; empty where it is nothing of the kind.
std::string WithoutDecimalComma(std::string text) {
  double ignored = 0.0;
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return "";
  text[comma] = '.';
  return ParseNumber(text, ignored) ? text : "";
}

}  // namespace

void FailAt(const fs::path& file, int line, const std::string& reason) {
  if (line > 0) throw std::runtime_error(AtLine(file, line, reason));
  std::string text = file.string() + ": " + reason;
  std::replace(text.begin(), text.end(), '\n', ' ');
  throw std::runtime_error(text);
}

double FiniteNumber(const fs::path& file,
                    int line,
                    const std::string& key,
                    const std::string& text) {
  double value = 0.0;
  if (ParseNumber(text, value) && std::isfinite(value)) return value;
  const std::string pointed = WithoutDecimalComma(text);
  FailAt(file,
         line,
         key + " is '" + Shown(text) +
             (pointed.empty() ? "', must be a finite number"
                              : "', a number with a decimal comma; write " + pointed));
}

double PositiveNumber(const fs::path& file,
                      int line,
                      const std::string& key,
                      const std::string& text) {
  const double value = FiniteNumber(file, line, key, text);
  if (!(value > 0.0)) FailAt(file, line, key + " is '" + Shown(text) + "', must be positive");
  return value;
}

int PixelCount(const fs::path& file, int line, const std::string& key, const std::string& text) {
  const double value = FiniteNumber(file, line, key, text);
  if (value < 0.0 || value > 1e6 || value != std::floor(value)) {
    FailAt(file, line, key + " is '" + Shown(text) + "', must be a whole number of pixels");
  }
  return static_cast<int>(value);
}

std::optional<double> NumberOf(const std::string& text) {
  double value = 0.0;
  if (!ParseNumber(text, value)) return std::nullopt;
  return value;
}

std::string Lower(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

Section::Section(const fs::path& file, const TreeNode& node, std::string name, std::string prefix)
    : file_(&file), node_(&node), name_(std::move(name)), prefix_(std::move(prefix)) {}

Section Section::WithPrefix(const std::string& prefix) const {
  return {*file_, *node_, name_, prefix};
}

std::optional<std::string> Section::FirstOf(const std::vector<std::string>& keys) const {
  for (const std::string& key : keys) {
    if (Has(key)) return key;
  }
  return std::nullopt;
}

const TreeNode* Section::Find(const std::string& key) const {
  if (!IsMap()) return nullptr;
  const std::string wanted = prefix_ + key;
  const TreeNode* found = nullptr;
  for (const TreeNode& child : node_->children) {
    if (child.key != wanted || child.kind == TreeNode::Kind::kNothing) continue;
    const bool same = found != nullptr && found->kind == TreeNode::Kind::kValue &&
                      child.kind == TreeNode::Kind::kValue && found->text == child.text;
    if (found != nullptr && !same) {
      FailAt(*file_,
             child.line,
             FullKey(key) + " is given twice, before in line " + std::to_string(found->line) +
                 "; keep one");
    }
    if (found == nullptr) found = &child;
  }
  return found;
}

bool Section::HasKind(const std::string& key, TreeNode::Kind kind) const {
  const TreeNode* found = Find(key);
  return found != nullptr && found->kind == kind;
}

const TreeNode& Section::Need(const std::string& key) const {
  const TreeNode* found = Find(key);
  if (found == nullptr) Fail(key, "is missing");
  return *found;
}

int Section::Line(const std::string& key) const {
  const TreeNode* found = Find(key);
  return found == nullptr ? node_->line : found->line;
}

void Section::Fail(const std::string& key, const std::string& reason) const {
  FailAt(*file_, Line(key), Shown(FullKey(key)) + " " + reason);
}

void Section::FailValue(const std::string& key, const std::string& reason) const {
  Fail(key, "is '" + Shown(Text(key)) + "', " + reason);
}

std::string Section::Text(const std::string& key) const {
  const TreeNode& value = Need(key);
  if (value.kind != TreeNode::Kind::kValue) Fail(key, "must be a single value");
  return value.text;
}

double Section::Number(const std::string& key) const {
  return FiniteNumber(*file_, Line(key), FullKey(key), Text(key));
}

double Section::Positive(const std::string& key) const {
  return PositiveNumber(*file_, Line(key), FullKey(key), Text(key));
}

double Section::NumberOr(const std::string& key, double fallback) const {
  return Has(key) ? Number(key) : fallback;
}

int Section::PixelsOrZero(const std::string& key) const {
  return Has(key) ? PixelCount(*file_, Line(key), FullKey(key), Text(key)) : 0;
}

bool Section::Flag(const std::string& key) const {
  if (!Has(key)) return false;
  const std::string text = Lower(Text(key));
  if (text == "1" || text == "true" || text == "yes" || text == "on") return true;
  if (text == "0" || text == "false" || text == "no" || text == "off") return false;
  FailValue(key, "must be 0 or 1");
}

void Section::AddNumbers(const std::string& key,
                         const TreeNode& node,
                         std::vector<double>& numbers) const {
  const auto add = [&](const TreeNode& at, const std::string& text) {
    const std::string name = FullKey(key) + "[" + std::to_string(numbers.size()) + "]";
    numbers.push_back(FiniteNumber(*file_, at.line, name, text));
  };
  if (node.kind == TreeNode::Kind::kValue) {
    std::istringstream words(node.text);
    for (std::string word; words >> word;) add(node, word);
  } else if (node.kind == TreeNode::Kind::kList) {
    for (const TreeNode& child : node.children) {
      if (child.kind == TreeNode::Kind::kValue) {
        add(child, child.text);
      } else if (child.kind == TreeNode::Kind::kList) {
        AddNumbers(key, child, numbers);
      } else {
        Fail(key, "must be a list of numbers");
      }
    }
  }
}

std::vector<double> Section::Numbers(const std::string& key) const {
  std::vector<double> numbers;
  const TreeNode* found = Find(key);
  if (found == nullptr) return numbers;
  if (found->kind != TreeNode::Kind::kMap) {
    AddNumbers(key, *found, numbers);
    return numbers;
  }
  const Section matrix(*file_, *found, FullKey(key) + ".");
  if (!matrix.Has("data")) {
    if (matrix.PixelsOrZero("rows") * matrix.PixelsOrZero("cols") == 0) return numbers;
    matrix.Fail("data", "is missing");
  }
  numbers = matrix.Numbers("data");
  if (matrix.Has("rows") && matrix.Has("cols")) {
    const std::size_t rows = matrix.PixelsOrZero("rows");
    const std::size_t cols = matrix.PixelsOrZero("cols");
    if (rows * cols != numbers.size()) {
      matrix.Fail("data",
                  "has " + std::to_string(numbers.size()) + " values, must have " +
                      std::to_string(rows) + " x " + std::to_string(cols));
    }
  }
  return numbers;
}

std::vector<double> Section::Numbers(const std::string& key,
                                     const std::vector<std::size_t>& counts,
                                     const std::string& names) const {
  std::vector<double> numbers = Numbers(key);
  if (std::find(counts.begin(), counts.end(), numbers.size()) != counts.end()) return numbers;
  std::string wanted;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (k > 0) wanted += k + 1 == counts.size() ? " or " : ", ";
    wanted += std::to_string(counts[k]);
  }
  if (!Has(key)) Fail(key, "is missing: " + wanted + " values, " + names);
  // "380,5, 382,0" is a list of twice as many.
  const bool may_have_commas = std::any_of(counts.begin(), counts.end(), [&](std::size_t count) {
    return count > 0 && numbers.size() == 2 * count;
  });
  Fail(key,
       "has " + std::to_string(numbers.size()) + " values, must have " + wanted + ": " + names +
           (may_have_commas ? "; if these are decimal commas, write points" : ""));
}

Section Section::Map(const std::string& key) const {
  const TreeNode& child = Need(key);
  if (child.kind != TreeNode::Kind::kMap) Fail(key, "must be a map of keys and values");
  return {*file_, child, FullKey(key) + "."};
}

std::vector<Section> Section::Maps(const std::string& key) const {
  std::vector<Section> maps;
  const TreeNode* found = Find(key);
  if (found == nullptr) return maps;
  if (found->kind != TreeNode::Kind::kList) Fail(key, "must be a list");
  for (std::size_t k = 0; k < found->children.size(); ++k) {
    const TreeNode& child = found->children[k];
    const std::string name = FullKey(key) + "[" + std::to_string(k) + "]";
    if (child.kind != TreeNode::Kind::kMap) {
      FailAt(*file_, child.line, name + " must be a map of keys and values");
    }
    maps.emplace_back(*file_, child, name + ".");
  }
  return maps;
}

void ReadSize(const Section& section,
              const std::string& width_key,
              const std::string& height_key,
              int& width,
              int& height) {
  width = section.PixelsOrZero(width_key);
  height = section.PixelsOrZero(height_key);
  if ((width == 0) == (height == 0)) return;
  const std::string& missing = width == 0 ? width_key : height_key;
  const std::string& given = width == 0 ? height_key : width_key;
  FailAt(section.file(),
         section.Line(section.Has(missing) ? missing : given),
         section.FullKey(missing) + " is missing or 0, and " + section.FullKey(given) + " is " +
             std::to_string(std::max(width, height)) +
             "; give both, or none and the images decide");
}

void ReadSizeList(const Section& section, const std::string& key, int& width, int& height) {
  width = height = 0;
  if (section.Numbers(key).empty()) return;
  const std::vector<double> size = section.Numbers(key, {2}, "width height");
  for (const double value : size) {
    if (value > 0.0 && value <= 1e6 && value == std::floor(value)) continue;
    section.Fail(key, "must be two whole numbers of pixels: [width, height]");
  }
  width = static_cast<int>(size[0]);
  height = static_cast<int>(size[1]);
}

}  // namespace rotslam
