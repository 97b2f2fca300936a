// Every parser over its seed corpus and what becomes of it when bytes are lost or changed, the same
// each time: read or refused in one clear line, soon, and without more memory than the file is
// worth. libFuzzer drives the same targets without end, see CMakeLists.txt.

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/largest_allocation.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using Random = std::mt19937_64;

// A line buffer, a table of options: what a parser may take for nothing. Then what it may take for
// each byte: the largest thing that the fewest bytes stand for is a row of words ("1\n", 32 bytes
// of string and 32 of row, twice while the array grows).
constexpr std::size_t kFreeBytes = std::size_t{1} << 20;
constexpr std::size_t kBytesPerByte = 128;
// A parser that hangs; a slow machine under sanitizers is far below.
constexpr double kMaxSeconds = 10.0;
constexpr std::size_t kMaxCuts = 60;

// Changes of each seed; more where ROTSLAM_FUZZ_CHANGES says so.
int NumChanges() {
  const char* wanted = std::getenv("ROTSLAM_FUZZ_CHANGES");
  return wanted == nullptr ? 60 : std::atoi(wanted);
}

std::vector<fs::path> SeedsOf(const FuzzTarget& target) {
  std::vector<fs::path> seeds;
  for (const auto& entry : fs::directory_iterator(fs::path(ROTSLAM_FUZZ_CORPUS) / target.name)) {
    seeds.push_back(entry.path());
  }
  std::sort(seeds.begin(), seeds.end());
  return seeds;
}

std::size_t Below(std::size_t bound, Random& random) { return random() % bound; }

// Numbers that parsers trip over, as text.
std::string AwkwardNumber(Random& random) {
  static const std::array<const char*, 16> kNumbers = {"-1",
                                                       "0",
                                                       "1e309",
                                                       "-1e308",
                                                       "1e-320",
                                                       "nan",
                                                       "inf",
                                                       ".inf",
                                                       "2147483647",
                                                       "2147483648",
                                                       "-2147483649",
                                                       "4294967296",
                                                       "9223372036854775807",
                                                       "18446744073709551616",
                                                       "0x10",
                                                       ""};
  return kNumbers[Below(kNumbers.size(), random)];
}

void ReplaceANumber(std::string& bytes, Random& random) {
  constexpr const char* kDigits = "0123456789+-.e";
  const std::size_t begin = bytes.find_first_of("0123456789", Below(bytes.size(), random));
  if (begin == std::string::npos) return;
  const std::size_t end = std::min(bytes.find_first_not_of(kDigits, begin), bytes.size());
  bytes.replace(begin, end - begin, AwkwardNumber(random));
}

// A count or a float, as binary files have them.
void OverwriteANumber(std::string& bytes, Random& random) {
  static const std::array<std::uint64_t, 8> kNumbers = {0,
                                                        ~std::uint64_t{0},
                                                        0x7fffffff,
                                                        0x80000000,
                                                        0x7fffffffffffffff,
                                                        0x7ff8000000000000,
                                                        0x7ff0000000000000,
                                                        0x100000000};
  const std::uint64_t number = kNumbers[Below(kNumbers.size(), random)];
  const std::size_t at = Below(bytes.size(), random);
  const std::size_t size = std::min(std::size_t{1} << Below(4, random), bytes.size() - at);
  std::memcpy(bytes.data() + at, &number, size);
}

std::string Changed(std::string bytes, Random& random) {
  for (std::size_t left = 1 + Below(3, random); left > 0 && !bytes.empty(); --left) {
    const std::size_t at = Below(bytes.size(), random);
    const std::size_t length = 1 + Below(std::min<std::size_t>(40, bytes.size() - at), random);
    switch (Below(6, random)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << Below(8, random)));
        break;
      case 1:
        bytes[at] = static_cast<char>(random());
        break;
      case 2:
        bytes.erase(at, length);
        break;
      case 3:
        bytes.insert(Below(bytes.size(), random), bytes.substr(at, length));
        break;
      case 4:
        ReplaceANumber(bytes, random);
        break;
      default:
        OverwriteANumber(bytes, random);
    }
  }
  return bytes;
}

std::string Shown(const std::string& bytes) {
  return testing::PrintToString(bytes.substr(0, 2000));
}

class Replay : public testing::TestWithParam<FuzzTarget> {
 protected:
  // False after the first fault: thousands of inputs would fail alike.
  [[nodiscard]] bool Try(const std::string& bytes) const {
    largest_allocation = 0;
    const std::clock_t start = std::clock();
    const std::optional<std::string> complaint = ComplaintAbout(GetParam(), bytes);
    const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    EXPECT_FALSE(complaint) << *complaint;
    EXPECT_LT(seconds, kMaxSeconds);
    EXPECT_LE(largest_allocation, kFreeBytes + kBytesPerByte * bytes.size());
    if (HasFailure()) ADD_FAILURE() << "input: " << Shown(bytes);
    return !HasFailure();
  }
};

TEST_P(Replay, ReadsOrRefusesInOneLine) {
  const std::vector<fs::path> seeds = SeedsOf(GetParam());
  ASSERT_FALSE(seeds.empty());
  ASSERT_TRUE(Try(""));
  for (const fs::path& seed : seeds) {
    SCOPED_TRACE(seed);
    const std::string bytes = ReadWholeFile(seed);
    ASSERT_TRUE(Try(bytes));
    const std::size_t step = bytes.size() / kMaxCuts + 1;
    for (std::size_t length = 0; length < bytes.size(); length += step) {
      ASSERT_TRUE(Try(bytes.substr(0, length)));
    }
    Random random(bytes.size());
    for (int k = NumChanges(); k > 0; --k) ASSERT_TRUE(Try(Changed(bytes, random)));
  }
}

// A corpus that is refused at its first line would prove nothing.
TEST_P(Replay, ReadsItsGoodSeeds) {
  int num_good = 0;
  for (const fs::path& seed : SeedsOf(GetParam())) {
    if (!seed.filename().string().starts_with("good")) continue;
    ++num_good;
    const TemporaryFolder folder;
    EXPECT_NO_THROW(GetParam().read(ReadWholeFile(seed), folder)) << seed;
  }
  EXPECT_GT(num_good, 0);
}

INSTANTIATE_TEST_SUITE_P(Parsers, Replay, testing::ValuesIn(FuzzTargets()), [](const auto& target) {
  return target.param.name;
});

TEST(Corpus, HasNoFolderWithoutATarget) {
  std::set<std::string> names;
  for (const FuzzTarget& target : FuzzTargets()) names.insert(target.name);
  for (const auto& entry : fs::directory_iterator(ROTSLAM_FUZZ_CORPUS)) {
    EXPECT_TRUE(names.contains(entry.path().filename().string())) << entry.path();
  }
}

}  // namespace
}  // namespace rotslam
