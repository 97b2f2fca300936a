#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

namespace rotslam {

using OptionValue = std::variant<bool, int, std::uint64_t, double, std::string>;

/// A field that is an enum, by the words for its values 0, 1, ...: `OptionWords(Enum)`, a function
/// next to the enum, gives them in that order.
class ChoiceField {
 public:
  template <class Enum>
  explicit ChoiceField(Enum& field)
      : words_(OptionWords(field)),
        index_([&field] { return static_cast<std::size_t>(field); }),
        set_index_([&field](std::size_t index) { field = static_cast<Enum>(index); }) {}

  std::string Word() const { return words_[index_()]; }
  /// False, and the field as it was, where no value has this word.
  bool Assign(const std::string& word) const;
  /// "off, window or global"
  std::string AllWords() const;

 private:
  std::span<const char* const> words_;
  std::function<std::size_t()> index_;
  std::function<void(std::size_t)> set_index_;
};

/// One field of an options struct, by name. Fields of nested structs have dotted keys
/// ("matching.max_distance").
struct OptionRef {
  std::string key;
  std::variant<bool*, int*, std::uint64_t*, double*, std::string*, ChoiceField> field;
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
    } else if constexpr (std::is_enum_v<Field>) {
      options.push_back({key, ChoiceField(field)});
    } else {
      static_assert(std::is_constructible_v<decltype(OptionRef::field), Field*>,
                    "an option is a bool, int, std::uint64_t, double, std::string, enum or "
                    "a struct with Visit");
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

/// The present values, in the same order; of an enum its word.
std::vector<OptionEntry> ReadOptionValues(const std::vector<OptionRef>& options);

/// Names and values of an options struct, as summary.json stores them.
template <class Options>
std::vector<OptionEntry> DescribeOptions(Options options) {
  return ReadOptionValues(ListOptions(options));
}

}  // namespace rotslam
