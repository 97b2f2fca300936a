#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace rotslam {

/// A value of a parsed YAML, JSON or XML file with its place in the text.
struct TreeNode {
  enum class Kind { kNothing, kValue, kList, kMap };
  Kind kind = Kind::kNothing;
  int line = 1;      // where the key begins, or the value where there is no key; 1 is the first
  std::string key;   // in a map
  std::string text;  // of a kValue
  std::vector<TreeNode> children;
};

/// Throws std::runtime_error: "file:line: reason"; without a line where it is 0.
[[noreturn]] void FailAt(const std::filesystem::path& file, int line, const std::string& reason);

/// `text` as a finite number. Throws as FailAt with `key`, the text and what is expected; names
/// decimal commas.
double FiniteNumber(const std::filesystem::path& file,
                    int line,
                    const std::string& key,
                    const std::string& text);

/// The same for a number that has to be positive.
double PositiveNumber(const std::filesystem::path& file,
                      int line,
                      const std::string& key,
                      const std::string& text);

/// The same for a whole number from 0 to 1e6.
int PixelCount(const std::filesystem::path& file,
               int line,
               const std::string& key,
               const std::string& text);

/// The number that the whole text is, finite or not; nullopt where it is something else.
std::optional<double> NumberOf(const std::string& text);

inline bool IsNumber(const std::string& text) { return NumberOf(text).has_value(); }

/// ASCII letters in lower case.
std::string Lower(std::string text);

/// A map of a parsed file. It knows the file, its place there and the lines of its keys: every
/// function that reads a key throws std::runtime_error as "file:line: cam0.fx is 'x', must be ..."
/// where the value is missing or malformed, and where a key is given twice with two values.
/// Points into the tree, which must outlive it.
class Section {
 public:
  /// @param name    put before keys in messages: "cam0."
  /// @param prefix  put before keys when they are looked up: "Camera." of files without levels
  Section(const std::filesystem::path& file,
          const TreeNode& node,
          std::string name = "",
          std::string prefix = "");

  /// The same map; `prefix` is put before every key.
  Section WithPrefix(const std::string& prefix) const;

  const std::filesystem::path& file() const { return *file_; }
  bool IsMap() const { return node_->kind == TreeNode::Kind::kMap; }
  const TreeNode& node() const { return *node_; }

  /// True where the key is there and has a value.
  bool Has(const std::string& key) const { return Find(key) != nullptr; }
  bool HasMap(const std::string& key) const { return HasKind(key, TreeNode::Kind::kMap); }
  bool HasList(const std::string& key) const { return HasKind(key, TreeNode::Kind::kList); }
  bool HasAny(const std::vector<std::string>& keys) const { return FirstOf(keys).has_value(); }

  /// The first of the keys that is there.
  std::optional<std::string> FirstOf(const std::vector<std::string>& keys) const;

  std::string Text(const std::string& key) const;
  double Number(const std::string& key) const;
  double Positive(const std::string& key) const;
  double NumberOr(const std::string& key, double fallback) const;
  /// 0 where the key is missing.
  int PixelsOrZero(const std::string& key) const;
  /// 1, true, yes or on; false where the key is missing.
  bool Flag(const std::string& key) const;

  /// The numbers of a list, of a list of lists, of a matrix as OpenCV writes it (rows, cols, data)
  /// or of a text with blanks between numbers; empty where the key is missing.
  std::vector<double> Numbers(const std::string& key) const;
  /// The same, of one of these counts; `names` says what they are: "fx fy cx cy".
  std::vector<double> Numbers(const std::string& key,
                              const std::vector<std::size_t>& counts,
                              const std::string& names) const;

  Section Map(const std::string& key) const;
  /// The maps of a list.
  std::vector<Section> Maps(const std::string& key) const;

  /// Line of the key; of the section where the key is missing.
  int Line(const std::string& key) const;
  std::string FullKey(const std::string& key) const { return name_ + prefix_ + key; }

  /// Throws "file:line: key reason".
  [[noreturn]] void Fail(const std::string& key, const std::string& reason) const;
  /// Throws "file:line: key is 'value', reason".
  [[noreturn]] void FailValue(const std::string& key, const std::string& reason) const;

 private:
  const TreeNode* Find(const std::string& key) const;
  bool HasKind(const std::string& key, TreeNode::Kind kind) const;
  const TreeNode& Need(const std::string& key) const;
  void AddNumbers(const std::string& key, const TreeNode& node, std::vector<double>& numbers) const;

  const std::filesystem::path* file_;
  const TreeNode* node_;
  std::string name_;
  std::string prefix_;
};

/// Reads width and height, which come together or not at all; 0 by 0 where both are missing.
/// Throws std::runtime_error where one of them is.
void ReadSize(const Section& section,
              const std::string& width_key,
              const std::string& height_key,
              int& width,
              int& height);

/// The same from a list [width, height]; 0 by 0 where it is missing or empty.
void ReadSizeList(const Section& section, const std::string& key, int& width, int& height);

}  // namespace rotslam
