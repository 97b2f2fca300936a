#include "apps/python/options.h"

#include <algorithm>
#include <type_traits>
#include <variant>

namespace py = pybind11;

namespace rotslam {
namespace {

[[noreturn]] void Refuse(const std::string& key,
                         const std::string& expected,
                         const py::handle& value) {
  throw std::invalid_argument("\"" + key + "\" expects " + expected + ", found " +
                              std::string(py::repr(value)));
}

void Assign(const std::string& key, const py::handle& value, const ChoiceField& choice) {
  if (!py::isinstance<py::str>(value) || !choice.Assign(value.cast<std::string>())) {
    Refuse(key, choice.AllWords(), value);
  }
}

template <class Field>
void Assign(const std::string& key, const py::handle& value, Field* field) {
  const bool is_bool = py::isinstance<py::bool_>(value);
  const bool is_int = py::isinstance<py::int_>(value) && !is_bool;
  bool fits = is_int;
  const char* expected = "a whole number";
  if constexpr (std::is_same_v<Field, bool>) {
    fits = is_bool;
    expected = "True or False";
  } else if constexpr (std::is_same_v<Field, double>) {
    fits = is_int || py::isinstance<py::float_>(value);
    expected = "a number";
  } else if constexpr (std::is_same_v<Field, std::string>) {
    fits = py::isinstance<py::str>(value);
    expected = "text";
  }
  try {
    if (fits) {
      *field = value.cast<Field>();
      return;
    }
  } catch (const py::cast_error&) {  // does not fit into the field
  }
  Refuse(key, expected, value);
}

void OverrideGroup(const py::dict& given,
                   const std::string& prefix,
                   const std::vector<OptionRef>& options) {
  for (const auto& [name, value] : given) {
    const std::string key = prefix + std::string(py::str(name));
    const bool is_group = std::any_of(options.begin(), options.end(), [&](const OptionRef& option) {
      return option.key.starts_with(key + ".");
    });
    if (py::isinstance<py::dict>(value) && is_group) {
      OverrideGroup(py::reinterpret_borrow<py::dict>(value), key + ".", options);
      continue;
    }
    bool found = false;
    for (const OptionRef& option : options) {
      if (option.key != key) continue;
      found = true;
      std::visit([&, v = value](const auto& field) { Assign(key, v, field); }, option.field);
    }
    if (found) continue;
    throw std::invalid_argument(is_group ? "\"" + key + "\" is a group of options, found " +
                                               std::string(py::repr(value))
                                         : UnknownOption(key, options));
  }
}

}  // namespace

void OverrideOptions(const py::dict& given, const std::vector<OptionRef>& options) {
  OverrideGroup(given, "", options);
}

void CheckThreads(int threads) {
  if (threads >= 1) return;
  throw std::invalid_argument("threads is " + std::to_string(threads) + ", must be 1 or more");
}

}  // namespace rotslam
