#include "rotodom/sequence/sequence_form.h"

#include <algorithm>
#include <system_error>

#include "rotodom/sequence/image_list.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

// Without a trailing slash or dots, so that names and parents are what they seem.
fs::path CleanPath(const fs::path& given) {
  const fs::path path = fs::absolute(given).lexically_normal();
  return path.filename().empty() ? path.parent_path() : path;
}

// Says where frames are missing in the times.
void NoteGaps(Layout& layout) {
  // A frame that is missing makes a step of two.
  constexpr double kLeastGap = 1.75;
  // More gaps than that, and the frames were never meant to be even.
  constexpr double kMostGaps = 0.2;
  std::vector<double> steps;
  for (std::size_t k = 1; k < layout.entries.size(); ++k) {
    steps.push_back(layout.entries[k].timestamp_s - layout.entries[k - 1].timestamp_s);
  }
  if (steps.size() < 2) return;
  const auto longest = std::max_element(steps.begin(), steps.end());
  const auto frame = longest - steps.begin();
  const std::string text =
      FormatNumber("%.3g", *longest) + " s after frame " + std::to_string(frame);
  const double shortest_s = *std::min_element(steps.begin(), steps.end());
  std::vector<double> sorted = steps;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const auto is_gap = [&](double step) { return step > kLeastGap * *middle; };
  const auto num_gaps = std::count_if(steps.begin(), steps.end(), is_gap);
  if (num_gaps == 0 || shortest_s <= 0.0) return;
  if (static_cast<double>(num_gaps) > kMostGaps * static_cast<double>(steps.size())) {
    layout.notes.push_back("times are uneven: " + FormatNumber("%.3g", shortest_s) + " to " +
                           FormatNumber("%.3g", *longest) + " s from frame to frame");
  } else {
    layout.notes.push_back("times have " + std::to_string(num_gaps) +
                           (num_gaps == 1 ? " gap: " : " gaps, the longest ") + text +
                           " (frames are " + FormatNumber("%.3g", *middle) + " s apart)");
  }
}

}  // namespace

const SequenceForm& FindSequenceForm(const fs::path& given) {
  std::error_code error;
  if (!fs::exists(ParseInputReference(given).file, error)) {
    if (given.filename().string().find_first_of("%*?") != std::string::npos) {
      const fs::path folder = given.has_parent_path() ? given.parent_path() : fs::path(".");
      Fail(given, "is a pattern of names; give the folder, " + folder.string());
    }
    Fail(given, "no such file or folder");
  }
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

std::string SequenceFormNames() {
  std::string names;
  for (const SequenceForm& form : SequenceForms()) {
    names += (names.empty() ? "" : ", ") + form.name;
  }
  return names;
}

bool IsSequence(const fs::path& given) {
  std::error_code error;
  if (!fs::exists(ParseInputReference(given).file, error)) return false;
  const fs::path path = CleanPath(given);
  return std::any_of(SequenceForms().begin(), SequenceForms().end(), [&](const SequenceForm& form) {
    return form.recognises(path);
  });
}

Layout FindLayout(const fs::path& path, const SequenceOptions& options) {
  const SequenceForm& form = FindSequenceForm(path);
  Layout layout = form.list(CleanPath(path), options);
  layout.form = form.name;
  if (!layout.times_are_made_up) NoteGaps(layout);
  return layout;
}

}  // namespace rotslam
