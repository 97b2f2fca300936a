#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "rotodom/sequence/frames.h"
#include "rotodom/sequence/layout.h"

namespace rotslam {

/// One form of input that OpenSequence reads. A source in rotodom/sequence/forms defines each.
struct SequenceForm {
  std::string name;         // "EuRoC ASL"
  std::string description;  // how it is recognised, one line for --help and docs
  // Of several forms that recognise a path, the one of the lowest rank is taken. 0: the layout of
  // a data set; 50: one that is hardly more than images; 100: images or a film and nothing else.
  int rank = 0;
  // Looks at names only and never throws. `path` exists, is absolute, and ends in a name.
  bool (*recognises)(const std::filesystem::path& path) = nullptr;
  // Lists frames, decodes none. Throws std::runtime_error, with path and reason in one line.
  Layout (*list)(const std::filesystem::path& path, const SequenceOptions& options) = nullptr;
  // Reads the frames of what `list` gave, where these are no image files; else nullptr.
  std::unique_ptr<Sequence> (*open)(const Layout& layout, const SequenceOptions& options) = nullptr;
};

/// All forms, by the names of their sources.
const std::vector<SequenceForm>& SequenceForms();

/// The names of all forms, separated by commas.
std::string SequenceFormNames();

/// Is there a form that reads `path`? Looks at names only.
bool IsSequence(const std::filesystem::path& path);

/// The form that reads `path`. Throws std::runtime_error, with path and reason in one line, when
/// nothing is there or no form recognises it.
const SequenceForm& FindSequenceForm(const std::filesystem::path& path);

/// Recognises a path as described at OpenSequence and lists its images; decodes none.
/// Throws std::runtime_error, with path and reason in one line.
Layout FindLayout(const std::filesystem::path& path, const SequenceOptions& options);

}  // namespace rotslam
