#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include "apps/cli/input/config.h"

namespace rotslam {

/// Sets the options that a dict names; its dicts are the options' groups. Throws
/// std::invalid_argument for a key that does not exist or a value of the wrong kind.
void OverrideOptions(const pybind11::dict& given, const std::vector<OptionRef>& options);

/// The defaults, overridden by a dict or None, and in range: else std::invalid_argument.
template <class Options>
Options OptionsFrom(const pybind11::object& given) {
  Options options;
  if (!given.is_none()) {
    if (!pybind11::isinstance<pybind11::dict>(given)) {
      throw std::invalid_argument("options must be a dict, found " +
                                  std::string(pybind11::repr(given)));
    }
    OverrideOptions(pybind11::reinterpret_borrow<pybind11::dict>(given), ListOptions(options));
  }
  if (const auto problem = options.Problem()) throw std::invalid_argument(*problem);
  return options;
}

/// Throws std::invalid_argument unless there is at least one.
void CheckThreads(int threads);

/// The same with so many threads.
template <class Options>
Options OptionsFrom(const pybind11::object& given, int threads) {
  Options options = OptionsFrom<Options>(given);
  CheckThreads(threads);
  options.num_threads = threads;
  return options;
}

}  // namespace rotslam
