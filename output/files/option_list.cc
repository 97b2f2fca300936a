#include "output/files/option_list.h"

namespace rotslam {

std::vector<OptionEntry> ReadOptionValues(const std::vector<OptionRef>& options) {
  std::vector<OptionEntry> entries;
  entries.reserve(options.size());
  for (const OptionRef& option : options) {
    entries.push_back(
        {option.key, std::visit([](auto* field) { return OptionValue(*field); }, option.field)});
  }
  return entries;
}

}  // namespace rotslam
