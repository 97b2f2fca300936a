#include "rotodom/sequence/image_times.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/sequence/image_list.h"
#include "rotodom/sequence/sequence_form.h"
#include "tests/rotodom/sequence/scratch_folder.h"

namespace rotslam {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(CutIntoCells, CutsAtWhatSeparates) {
  EXPECT_THAT(CutIntoCells(" 1.5\tb.png "), ElementsAre("1.5", "b.png"));
  EXPECT_THAT(CutIntoCells("15, my b.png"), ElementsAre("15", "my b.png"));
  EXPECT_THAT(CutIntoCells("15,,\"b.png\""), ElementsAre("15", "", "b.png"));
  EXPECT_THAT(CutIntoCells("1,5 b.png"), ElementsAre("1,5", "b.png"));
  EXPECT_THAT(CutIntoCells("b.png;1,5"), ElementsAre("b.png", "1,5"));
  EXPECT_THAT(CutIntoCells("15,16"), ElementsAre("15", "16"));
  EXPECT_THAT(CutIntoCells("2011-09-26 13:02:25.9 b.png"),
              ElementsAre("2011-09-26 13:02:25.9", "b.png"));
}

class ImageTimes : public ScratchFolderTest {
 protected:
  // Four images in `images`.
  void SetUp() override {
    ScratchFolderTest::SetUp();
    for (const char* name : {"f0", "f1", "f2", "f3"}) {
      WriteText("images/" + std::string(name) + ".png", "x");
    }
  }

  Layout Read(const std::string& list, const std::string& text) const {
    WriteText(list, text);
    const Layout layout = FindLayout(folder_ / "images", {});
    std::filesystem::remove(folder_ / list);
    return layout;
  }

  std::vector<double> Times(const std::string& list, const std::string& text) const {
    const Layout layout = Read(list, text);
    EXPECT_FALSE(layout.times_are_made_up) << text;
    EXPECT_THAT(layout.times_source, testing::StartsWith(list.substr(list.find('/') + 1)));
    std::vector<double> times_s;
    for (const ImageEntry& entry : layout.entries) times_s.push_back(entry.timestamp_s);
    return times_s;
  }

  std::string Complaint(const std::string& list, const std::string& text) const {
    try {
      Read(list, text);
      return "no complaint";
    } catch (const std::runtime_error& error) {
      return error.what();
    }
  }
};

TEST_F(ImageTimes, AreMadeUpWithAWord) {
  SequenceOptions options;
  options.fps = 10.0;
  const Layout layout = FindLayout(folder_, options);
  EXPECT_TRUE(layout.times_are_made_up);
  EXPECT_EQ(layout.times_source, "made up at 10 frames a second (--fps sets the rate)");
  EXPECT_THAT(layout.notes, ElementsAre());
}

TEST_F(ImageTimes, ReadsListsOfAllForms) {
  const auto are_right = ElementsAre(0.0, 0.1, 0.2, 0.3);
  for (const char* list : {"images/times.txt",
                           "times.txt",
                           "timestamps.txt",
                           "images/timestamp.txt",
                           "image_timestamps",
                           "timestamps.csv"}) {
    EXPECT_THAT(Times(list, "0.0\n0.1\r\n0.2\n0.3"), are_right) << list;
  }
  for (const char* text :
       {"\xef\xbb\xbf# time\n0\n1e-1\n+0.2 \n0.3\n",
        "0\n100\n200\n300\n",
        "0 0.0 0.02\n1 0.1 0.02\n2 0.2 0.02\n3 0.3 0.02\n",
        "f0.png 0.0\nf1.png 0.1\nf2.png 0.2\nf3.png 0.3\n",
        "0.3 f3.png\n0.1 images/f1.png\n0.2 C:\\x\\f2.png\n0.0 F0.PNG\n",
        "f0,0.0\nf1,0.1\nf2,0.2\nf3,0.3\n",
        "f0.png;0,0\nf1.png;0,1\nf2.png;0,2\nf3.png;0,3\n",
        "index,time_ms,name\n0,0,f0.png\n1,100,f1.png\n2,200,f2.png\n3,300,f3.png"}) {
    EXPECT_THAT(Times("times.txt", text), are_right) << text;
  }
  EXPECT_THAT(Times("frames.csv",
                    "#t [ns],file\n0,f0.png\n100000000,f1.png\n200000000,f2.png\n"
                    "300000000,f3.png\n"),
              are_right);
  // KITTI's dates.
  const std::vector<double> dates =
      Times("timestamps.txt",
            "2011-09-26 13:02:25.900000000\n2011-09-26 13:02:26.000000000\n"
            "2011-09-26 13:02:26.100000000\n2011-09-26 13:02:26.200000000\n");
  EXPECT_NEAR(dates[3] - dates[0], 0.3, 1e-6);
}

TEST_F(ImageTimes, DecimalCommasAloneAreTimes) {
  EXPECT_THAT(Times("times.txt", "0,0\n0,1\n0,2\n0,3\n"), ElementsAre(0.0, 0.1, 0.2, 0.3));
  // But with an index they are two columns.
  EXPECT_THAT(Times("times.txt", "0,100\n1,200\n2,300\n3,400\n"), ElementsAre(0.1, 0.2, 0.3, 0.4));
}

TEST_F(ImageTimes, TakesTheTimeOfAnImagesNumber) {
  const Layout layout = Read("times.txt", "0.0\n0.1\n0.2\n0.3\n0.4\n");
  EXPECT_EQ(layout.entries[3].timestamp_s, 0.3);
  EXPECT_THAT(
      layout.notes,
      ElementsAre("times.txt has 5 times for 4 images: an image has the time of its number"));
}

TEST_F(ImageTimes, SaysWhichListsDoNotFit) {
  const Layout layout = Read("times.txt", "0.0\n0.1\n0.2\n");
  EXPECT_TRUE(layout.times_are_made_up);
  EXPECT_THAT(layout.notes, Contains(HasSubstr("times.txt has 3 times for 4 images: not used")));
  EXPECT_THAT(Read("times.txt", "0\n1\n2\n3\n").notes,
              Contains(HasSubstr("times.txt numbers the frames and tells no times: not used")));
  EXPECT_THAT(Read("times.txt", "0.0 a.png\n0.1 b.png\n0.2 c.png\n").notes,
              Contains(HasSubstr("times.txt names other images: not used")));
  EXPECT_THAT(Read("times.txt", "# nothing\n").notes, Contains(HasSubstr("is empty: not used")));
  // A table that may be about anything is not worth a word.
  EXPECT_THAT(Read("other.csv", "t,name\n0.0,a.png\n0.1,b.png\n").notes, ElementsAre());
}

TEST_F(ImageTimes, LeavesOutImagesThatAListWithNamesLeavesOut) {
  const Layout layout = Read("times.csv", "0.0,f0.png\n0.1,f1.png\n0.3,f3.png\n");
  EXPECT_EQ(layout.entries.size(), 3u);
  EXPECT_THAT(layout.notes, Contains("times.csv has no times for f2.png: left out"));
}

TEST_F(ImageTimes, NamesTheLineThatIsAtFault) {
  EXPECT_THAT(Complaint("times.txt", "0.0\n0.1\nsoon\n0.3\n"),
              HasSubstr("times.txt:3: is 'soon', expected a time"));
  EXPECT_THAT(Complaint("times.txt", "0.0\n0.1\n\nnan\n0.3\n"), HasSubstr("times.txt:4: is 'nan'"));
  WriteText("times.txt", "0.0\n0.2\n0.1\n0.3\n");
  for (int k = 0; k < 4; ++k) WriteImage("images/f" + std::to_string(k) + ".png");
  try {
    OpenSequence(folder_, {});
    FAIL() << "no complaint";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("times.txt:3: f2.png: timestamp 0.1"));
    EXPECT_THAT(error.what(), HasSubstr("in line 2"));
  }
}

TEST_F(ImageTimes, CountsGaps) {
  EXPECT_THAT(Read("times.txt", "0.0\n0.1\n0.2\n0.3\n").notes, IsEmpty());
  for (int k = 4; k < 9; ++k) WriteText("images/f" + std::to_string(k) + ".png", "x");
  EXPECT_THAT(Read("times.txt", "0.0\n0.1\n0.2\n0.3\n0.9\n1.0\n1.1\n1.2\n1.3\n").notes,
              ElementsAre("times have 1 gap: 0.6 s after frame 3 (frames are 0.1 s apart)"));
  EXPECT_THAT(Read("times.txt", "0.0\n0.1\n0.2\n0.9\n1.9\n2.8\n2.9\n3.0\n3.1\n").notes,
              ElementsAre(HasSubstr("times are uneven: 0.1 to 1 s")));
}

}  // namespace
}  // namespace rotslam
