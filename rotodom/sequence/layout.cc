#include "rotodom/sequence/layout.h"

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Without a trailing slash or dots, so that names and parents are what they seem.
fs::path CleanPath(const fs::path& given) {
  const fs::path path = fs::absolute(given).lexically_normal();
  return path.filename().empty() ? path.parent_path() : path;
}

}  // namespace

const SequenceForm& FindSequenceForm(const fs::path& given) {
  std::error_code error;
  if (!fs::exists(given, error)) Fail(given, "no such file or folder");
  const fs::path path = CleanPath(given);
  const SequenceForm* best = nullptr;
  for (const SequenceForm& form : SequenceForms()) {
    if (best != nullptr && best->rank <= form.rank) continue;
    if (form.recognises(path)) best = &form;
  }
  if (best != nullptr) return *best;
  if (IsImageName(path)) Fail(path, "is a single image; give the folder that holds the images");
  Fail(path, "is no video; give the folder of the data set");
}

Layout FindLayout(const fs::path& path, const SequenceOptions& options) {
  const SequenceForm& form = FindSequenceForm(path);
  Layout layout = form.list(CleanPath(path), options);
  layout.form = form.name;
  return layout;
}

}  // namespace rotslam
