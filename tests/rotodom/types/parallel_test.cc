#include "rotodom/types/parallel.h"

#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

TEST(ParallelFor, VisitsEveryIndexOnce) {
  for (const int num_threads : {1, 2, 5}) {
    std::vector<int> visits(1000, 0);
    ParallelFor(1000, num_threads, [&](int index) { ++visits[index]; });
    EXPECT_EQ(visits, std::vector<int>(1000, 1)) << num_threads << " threads";
  }
}

TEST(ParallelFor, PassesOnTheFirstException) {
  const auto work = [](int index) {
    if (index >= 7) throw std::runtime_error(std::to_string(index));
  };
  try {
    ParallelFor(20, 3, work);
    FAIL() << "no exception";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "7");
  }
}

TEST(ParallelFor, MayBeCalledInsideAndFromManyThreads) {
  std::vector<std::vector<int>> visits(20, std::vector<int>(30, 0));
  const auto visit_all = [&](int first) {
    for (int repetition = 0; repetition < 50; ++repetition) {
      ParallelFor(10, 3, [&](int outer) {
        ParallelFor(30, 2, [&](int inner) { ++visits[first + outer][inner]; });
      });
    }
  };
  std::thread other([&] { visit_all(10); });
  visit_all(0);
  other.join();
  for (const std::vector<int>& of_one : visits) EXPECT_EQ(of_one, std::vector<int>(30, 50));
}

TEST(ParallelFor, DoesNothingForNoWork) {
  ParallelFor(0, 4, [](int) { FAIL(); });
}

}  // namespace
}  // namespace rotslam
