// Recordings of ROS, and the images and calibrations in their messages.

#include <stdexcept>

#include "rotodom/sequence/sequence.h"
#include "tests/fuzz/fuzz_target.h"

namespace rotslam {
namespace {

// Reads every frame; one that is damaged comes empty, with a reason.
void ReadBag(const std::string& name, std::string_view bytes, const TemporaryFolder& folder) {
  folder.Write(name, std::string(bytes));
  const auto sequence = OpenSequence(folder.path() / name, {});
  int count = 0;
  while (const auto frame = sequence->Next()) {
    if (frame->image.empty() == frame->problem.empty()) throw std::logic_error("a wrong frame");
    if (frame->problem.find('\n') != std::string::npos) throw std::logic_error("two lines");
    ++count;
  }
  if (count != sequence->NumFrames()) throw std::logic_error("a frame is lost");
  for (const std::string& note : sequence->notes()) {
    if (note.find('\n') != std::string::npos) throw std::logic_error("a note of two lines");
  }
}

const RegisterFuzzTarget bag("bag", [](std::string_view bytes, const TemporaryFolder& folder) {
  ReadBag("ros1.bag", bytes, folder);
});

const RegisterFuzzTarget mcap("mcap", [](std::string_view bytes, const TemporaryFolder& folder) {
  ReadBag("ros2.mcap", bytes, folder);
});

const RegisterFuzzTarget db3("db3", [](std::string_view bytes, const TemporaryFolder& folder) {
  ReadBag("ros2.db3", bytes, folder);
});

}  // namespace
}  // namespace rotslam
