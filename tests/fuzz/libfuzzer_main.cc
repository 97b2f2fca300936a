// What libFuzzer calls. Of the targets in the program, --target=NAME chooses one.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/fuzz/fuzz_target.h"

namespace {

const rotslam::FuzzTarget* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  const std::string flag = "--target=";
  for (int k = 1; k < *argc; ++k) {
    const std::string argument = (*argv)[k];
    if (!argument.starts_with(flag)) continue;
    for (const rotslam::FuzzTarget& target : rotslam::FuzzTargets()) {
      if (target.name == argument.substr(flag.size())) chosen = &target;
    }
  }
  if (chosen == nullptr) {
    std::fprintf(stderr, "give --target=NAME, of:");
    for (const auto& target : rotslam::FuzzTargets())
      std::fprintf(stderr, " %s", target.name.c_str());
    std::fprintf(stderr, "\n");
    std::exit(2);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto complaint =
      rotslam::ComplaintAbout(*chosen, {reinterpret_cast<const char*>(data), size});
  if (complaint) {
    std::fprintf(stderr, "%s\n", complaint->c_str());
    std::abort();
  }
  return 0;
}
