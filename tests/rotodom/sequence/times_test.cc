#include "rotodom/sequence/times.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace rotslam {
namespace {

using testing::DoubleEq;
using testing::ElementsAre;

std::vector<double> OfNames(const std::vector<std::string>& stems) {
  const auto times = TimesOfNames(stems);
  return times ? times->times_s : std::vector<double>{};
}

std::vector<double> OfWords(const std::vector<std::string>& words,
                            UnclearTimes unclear = UnclearTimes::kAreNone) {
  const auto times = TimesOfWords(words, unclear);
  return times ? times->times_s : std::vector<double>{};
}

TEST(TimesOfNames, ReadsSecondsAndDates) {
  EXPECT_THAT(OfNames({"1000.000000", "1000.033333"}), ElementsAre(1000.0, 1000.033333));
  EXPECT_THAT(OfNames({"1000.25", "1000.5"}), ElementsAre(1000.25, 1000.5));
  EXPECT_THAT(OfNames({"1403715273262142976"}), ElementsAre(1403715273.262142976));
  EXPECT_THAT(OfNames({"1403715273262142"}), ElementsAre(1403715273.262142));
  EXPECT_THAT(OfNames({"1403715273262"}), ElementsAre(1403715273.262));
  EXPECT_EQ(TimesOfNames({"1403715273262142976"})->unit, "ns since 1970");
  EXPECT_EQ(TimesOfNames({"1403715273262142"})->unit, "us since 1970");
  EXPECT_EQ(TimesOfNames({"1000.25"})->unit, "seconds");
}

TEST(TimesOfNames, LeavesIndicesAlone) {
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"000012", "000013"},
        {"frame-000012"},
        {"frame_000000", "frame_001000", "frame_002000"},
        {"1403715273"},            // could be anything
        {"20261121063000123456"},  // a date, but not ours to guess
        {"1000.5", "1001"},        // not all in the same way
        {"1.2.3"},
        {"1.2.3", "1.2.4"},
        {".5"},
        {"-1.5"},
        {"shot1.9", "shot1.10", "shot1.1"},
        {"scene.00.000122", "scene.00.000123"},
        {"seq_00.000122", "seq_00.000123"},
        {"DSC_0012", "DSC_0013"},
        {"12_0012", "12_0013"},
        {"frame-000000.color", "frame-000001.color"},
        {"1403715273262142976", "1403715273262142"}}) {
    EXPECT_FALSE(TimesOfNames(names)) << names.front();
  }
}

TEST(TimesOfNames, ReadsWhatStandsAroundTheTime) {
  EXPECT_THAT(OfNames({"frame_1403715273.262142", "frame_1403715273.312142"}),
              ElementsAre(1403715273.262142, 1403715273.312142));
  EXPECT_THAT(OfNames({"cam0-1403715273262142976-left", "cam0-1403715273312142976-left"}),
              ElementsAre(1403715273.262142976, 1403715273.312142976));
  EXPECT_THAT(OfNames({"000012_1403715273262142976", "000013_1403715273312142976"}),
              ElementsAre(1403715273.262142976, 1403715273.312142976));
}

TEST(TimesOfNames, ReadsCountsSinceBoot) {
  EXPECT_THAT(OfNames({"5033333333", "5066666666", "5100000000"}),
              ElementsAre(5.033333333, 5.066666666, 5.1));
  EXPECT_EQ(TimesOfNames({"5033333333", "5066666666"})->unit, "ns");
  // Half an hour and a fortnight, which are no dates in ms or us.
  EXPECT_THAT(OfNames({"1800033333333", "1800066666666"}),
              ElementsAre(1800.033333333, 1800.066666666));
  EXPECT_THAT(OfWords({"1209600033333333", "1209600066666666"}),
              ElementsAre(1209600.033333333, 1209600.066666666));
  EXPECT_THAT(OfNames({"000012_33333333", "000013_66666666", "000014_99999999"}),
              ElementsAre(0.033333333, 0.066666666, 0.099999999));
  EXPECT_THAT(OfNames({"img_33333", "img_66666", "img_100000"}),
              ElementsAre(0.033333, 0.066666, 0.1));
  EXPECT_EQ(TimesOfNames({"img_33333", "img_66666", "img_100000"})->unit, "us");
}

TEST(TimesOfNames, ReadsSecondsAndNanosecondsApart) {
  // Padded or not; nine digits somewhere, or a date before them.
  EXPECT_THAT(OfNames({"1403715273_262142976", "1403715273_312142976"}),
              ElementsAre(1403715273.262142976, 1403715273.312142976));
  EXPECT_THAT(OfNames({"1403715272_995000000", "1403715273_45678", "1403715273_95000000"}),
              ElementsAre(1403715272.995, 1403715273.000045678, 1403715273.095));
  EXPECT_THAT(OfNames({"12_950000000", "13_45678"}), ElementsAre(12.95, 13.000045678));
  EXPECT_THAT(OfNames({"1403715273_262142", "1403715273_9142"}),
              ElementsAre(DoubleEq(1403715273.262142), DoubleEq(1403715273.009142)));
}

// As ROS prints times with "%d.%d": .95, .0, .05 of a second at 20 Hz.
TEST(TimesOfNames, ReadsNanosecondsWithoutLeadingZeros) {
  EXPECT_THAT(OfNames({"100.850000001",
                       "100.900000001",
                       "100.950000001",
                       "101.1",
                       "101.50000001",
                       "101.100000001"}),
              ElementsAre(100.850000001,
                          100.900000001,
                          100.950000001,
                          101.000000001,
                          101.050000001,
                          101.100000001));
  // The same digits as decimal numbers that a program has cut at their end.
  EXPECT_THAT(OfNames({"100.85", "100.900000001", "100.950000001", "101", "101.05"}),
              ElementsAre());
  EXPECT_THAT(OfNames({"100.85", "100.900000001", "100.95", "101.0", "101.05"}),
              ElementsAre(100.85, 100.900000001, 100.95, 101.0, 101.05));
}

TEST(TimesOfNames, ReadsTheClockOfPhones) {
  const std::vector<double> times =
      OfNames({"IMG_20260115_235959967", "IMG_20260116_000000000", "IMG_20260116_000000033"});
  ASSERT_EQ(times.size(), 3u);
  EXPECT_DOUBLE_EQ(times[0], 1768521599.967);  // date -u -d '2026-01-15 23:59:59' +%s
  EXPECT_NEAR(times[2] - times[0], 0.066, 1e-6);
  EXPECT_FALSE(TimesOfNames({"IMG_20260115_235959", "IMG_20260115_235959"}));
  EXPECT_FALSE(TimesOfNames({"IMG_20261315_235959", "IMG_20261315_235960"}));
}

TEST(TimesOfWords, TellsTheUnit) {
  EXPECT_THAT(OfWords({"0", "33", "67", "100"}), ElementsAre(0, 0.033, 0.067, 0.1));
  EXPECT_THAT(OfWords({"0", "33333", "66667"}), ElementsAre(0, 0.033333, 0.066667));
  EXPECT_THAT(OfWords({"0", "33333333", "66666667"}), ElementsAre(0, 0.033333333, 0.066666667));
  EXPECT_THAT(OfWords({"0.0", "33.3", "66.7"}), ElementsAre(0, DoubleEq(0.0333), DoubleEq(0.0667)));
  EXPECT_THAT(OfWords({"0", "0.033", "6.6e-2"}), ElementsAre(0, 0.033, 0.066));
  EXPECT_THAT(OfWords({"0,0", "0,033"}), ElementsAre(0, 0.033));
  EXPECT_THAT(OfWords({"1403715273262142976", "1403715273312142976"}),
              ElementsAre(1403715273.262142976, 1403715273.312142976));
  EXPECT_THAT(OfWords({"1403715273", "1403715275"}), ElementsAre(1403715273, 1403715275));
  EXPECT_EQ(TimesOfWords({"0", "33", "67"}, UnclearTimes::kAreNone)->unit, "ms");
  EXPECT_EQ(TimesOfWords({"0", "0.1"}, UnclearTimes::kAreNone)->unit, "seconds");
  EXPECT_THAT(TimesOfWords({"0", "5", "10"}, UnclearTimes::kAreNone, 1000)->times_s,
              ElementsAre(0, 0.005, 0.01));
}

TEST(TimesOfWords, LeavesNumbersOfFramesAlone) {
  EXPECT_THAT(OfWords({"0", "1", "2"}), ElementsAre());
  EXPECT_THAT(OfWords({"0", "5", "10"}), ElementsAre());
  EXPECT_THAT(OfWords({"0", "1", "2"}, UnclearTimes::kAreSeconds), ElementsAre(0, 1, 2));
  for (const char* word : {"soon", "nan", "inf", "1e999", "0x10", "1.5s", "", "1,5,5"}) {
    EXPECT_THAT(OfWords({"0.5", word}), ElementsAre()) << word;
  }
}

TEST(TimesOfWords, ReadsDates) {
  // date -u -d '2011-09-26 13:02:25' +%s
  EXPECT_THAT(OfWords({"2011-09-26 13:02:25.964389445", "2011-09-26T13:02:26Z"}),
              ElementsAre(DoubleEq(1317042145.964389445), 1317042146));
  EXPECT_THAT(OfWords({"2011-09-26 13:02:25.9", "5"}), ElementsAre());
  for (const char* word : {"2011-13-26 13:02:25",
                           "2011-09-26 25:02:25",
                           "2011-09-26 13:02:25,5",
                           "2011-09-26",
                           "2011-02-30 00:00:00"}) {
    EXPECT_FALSE(ParseDate(word)) << word;
  }
}

TEST(TicksOfTitle, FindsTheUnit) {
  EXPECT_EQ(TicksOfTitle("timestamp [ns]"), 1'000'000'000);
  EXPECT_EQ(TicksOfTitle("t_us"), 1'000'000);
  EXPECT_EQ(TicksOfTitle("Time (ms)"), 1'000);
  EXPECT_EQ(TicksOfTitle("time_s"), 1);
  EXPECT_EQ(TicksOfTitle("timestamp"), 0);
  EXPECT_EQ(TicksOfTitle("times"), 0);
}

}  // namespace
}  // namespace rotslam
