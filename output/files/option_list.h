#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace rotslam {

using OptionValue = std::variant<bool, int, std::uint64_t, double, std::string>;

/// One field of an options struct, by name. Fields of nested structs have dotted keys
/// ("matching.max_distance").
struct OptionRef {
  std::string key;
  std::variant<bool*, int*, std::uint64_t*, double*, std::string*> field;
};

/// The same with its value.
struct OptionEntry {
  std::string key;
  OptionValue value;
};

namespace internal {

struct OptionCollector {
  std::string prefix;
  std::vector<OptionRef>& options;

  template <class Field>
  void operator()(const char* name, Field& field) {
    const std::string key = prefix + name;
    if constexpr (std::is_class_v<Field> && !std::is_same_v<Field, std::string>) {
      field.Visit(OptionCollector{key + ".", options});
    } else {
      static_assert(std::is_constructible_v<decltype(OptionRef::field), Field*>,
                    "an option is a bool, int, std::uint64_t, double, std::string or a struct "
                    "with Visit");
      options.push_back({key, &field});
    }
  }
};

}  // namespace internal

/// All fields that `options.Visit` shows, nested structs included, in its order. The references
/// live as long as `options`.
template <class Options>
std::vector<OptionRef> ListOptions(Options& options) {
  std::vector<OptionRef> list;
  options.Visit(internal::OptionCollector{"", list});
  return list;
}

/// The present values, in the same order.
std::vector<OptionEntry> ReadOptionValues(const std::vector<OptionRef>& options);

/// Names and values of an options struct, as summary.json stores them.
template <class Options>
std::vector<OptionEntry> DescribeOptions(Options options) {
  return ReadOptionValues(ListOptions(options));
}

}  // namespace rotslam
