#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "rotodom/camera/section.h"
#include "rotodom/types/text_file.h"

namespace rotslam {

/// A calibration file as the forms look at it: bytes, text, lines of words, and a tree.
class CameraDocument {
 public:
  /// Reads the file. Throws std::runtime_error naming it when it cannot be read, is UTF-16, or is
  /// too large for a calibration file.
  explicit CameraDocument(const std::filesystem::path& file);
  CameraDocument(const CameraDocument&) = delete;  // sections point into it
  CameraDocument& operator=(const CameraDocument&) = delete;

  const std::filesystem::path& file() const { return file_; }

  /// The file's bytes where it is not a text, else empty.
  const std::string& binary() const { return binary_; }

  /// Without a byte-order mark, every line ended by '\n'; empty where the file is not a text.
  const std::string& text() const { return text_; }

  /// Lines that are neither empty nor begin with '#', cut at blanks and tabs. Commas stay.
  const std::vector<TextRow>& rows() const { return rows_; }

  /// The text as XML where it begins with '<', as JSON where it begins with '{', else as YAML,
  /// which may be as OpenCV writes and reads it (%YAML:1.0, `key:value`, tabs). Parsed at the first
  /// call; a section that is no map where the text is nothing of the kind.
  Section root() const;

  /// "file:line: is not YAML: ..." where root() could not be parsed; empty else.
  const std::string& parse_problem() const;

 private:
  void Parse() const;

  std::filesystem::path file_;
  std::string binary_;
  std::string text_;
  std::vector<TextRow> rows_;
  mutable std::optional<TreeNode> tree_;
  mutable std::string parse_problem_;
};

}  // namespace rotslam
