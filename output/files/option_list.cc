#include "output/files/option_list.h"

#include <algorithm>

namespace rotslam {
namespace {

struct ValueOf {
  OptionValue operator()(const ChoiceField& choice) const { return choice.Word(); }
  OptionValue operator()(const auto* field) const { return *field; }
};

}  // namespace

bool ChoiceField::Assign(const std::string& word) const {
  const auto found = std::find(words_.begin(), words_.end(), word);
  if (found == words_.end()) return false;
  set_index_(static_cast<std::size_t>(found - words_.begin()));
  return true;
}

std::string ChoiceField::AllWords() const {
  std::string all;
  for (std::size_t k = 0; k < words_.size(); ++k) {
    if (k > 0) all += k + 1 == words_.size() ? " or " : ", ";
    all += words_[k];
  }
  return all;
}

std::vector<OptionEntry> ReadOptionValues(const std::vector<OptionRef>& options) {
  std::vector<OptionEntry> entries;
  entries.reserve(options.size());
  for (const OptionRef& option : options) {
    entries.push_back({option.key, std::visit(ValueOf(), option.field)});
  }
  return entries;
}

}  // namespace rotslam
