#include "rotodom/sequence/layout.h"

#include <algorithm>
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

using testing::ElementsAre;
using testing::HasSubstr;

TEST(NaturalLess, CountsDigitsAsNumbers) {
  std::vector<std::string> names = {"f10.png",
                                    "f9.png",
                                    "g1.png",
                                    "f009.png",
                                    "f1b2",
                                    "f1b10",
                                    "f99999999999999999999999.png",
                                    "f.png",
                                    "f09.png"};
  std::sort(names.begin(), names.end(), NaturalLess);
  EXPECT_THAT(names,
              ElementsAre("f.png",
                          "f1b2",
                          "f1b10",
                          "f009.png",
                          "f09.png",
                          "f9.png",
                          "f10.png",
                          "f99999999999999999999999.png",
                          "g1.png"));
}

SequenceOptions At10Fps() {
  SequenceOptions options;
  options.fps = 10.0;
  return options;
}

class LayoutTest : public ScratchFolderTest {
 protected:
  std::vector<std::string> Names(const Layout& layout) const {
    std::vector<std::string> names;
    for (const ImageEntry& entry : layout.entries) {
      names.push_back(std::filesystem::relative(entry.file, folder_).string());
    }
    return names;
  }
  static std::vector<double> Times(const Layout& layout) {
    std::vector<double> times_s;
    for (const ImageEntry& entry : layout.entries) times_s.push_back(entry.timestamp_s);
    return times_s;
  }
  std::string Complaint(const std::filesystem::path& path) const {
    try {
      FindLayout(path, At10Fps());
      return "no complaint";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      return error.what();
    }
  }
};

TEST_F(LayoutTest, ImageFolder) {
  for (const char* name : {"f10.png", "f9.JPG", "._f9.JPG", "notes.txt"}) WriteText(name, "x");
  std::filesystem::create_directories(folder_ / "f0.png");  // a folder, whatever its name says
  const Layout layout = FindLayout(folder_, At10Fps());
  EXPECT_EQ(layout.form, "image folder");
  EXPECT_THAT(Names(layout), ElementsAre("f9.JPG", "f10.png"));
  EXPECT_THAT(Times(layout), ElementsAre(0.0, 0.1));
  EXPECT_FALSE(layout.camera);
  EXPECT_FALSE(layout.ground_truth_file);
}

TEST_F(LayoutTest, ImageFolderWithTimesInItsNames) {
  // By name, digits as numbers, 1000.25 would come after 1000.5.
  for (const char* name : {"images/1000.5.png", "images/1000.25.png"}) WriteText(name, "x");
  WriteText("camera.yaml", "x");
  WriteText("groundtruth_tum.txt", "x");
  for (const auto& path : {folder_, folder_ / "images", folder_ / "images" / ""}) {
    const Layout layout = FindLayout(path, At10Fps());
    EXPECT_THAT(Names(layout), ElementsAre("images/1000.25.png", "images/1000.5.png"));
    EXPECT_THAT(Times(layout), ElementsAre(1000.25, 1000.5));
    EXPECT_EQ(layout.camera.value().file, folder_ / "camera.yaml");
    EXPECT_EQ(layout.ground_truth_file, folder_ / "groundtruth_tum.txt");
  }
}

TEST_F(LayoutTest, ImageFolderLeavesDepthMapsOut) {
  for (const char* name : {"frame-000000.color.png", "frame-000000.depth.png"}) {
    WriteText(name, "x");
  }
  EXPECT_THAT(Names(FindLayout(folder_, At10Fps())), ElementsAre("frame-000000.color.png"));
}

TEST_F(LayoutTest, Kitti) {
  for (const char* name : {"image_0/000000.png", "image_0/000002.png", "image_2/000000.png"}) {
    WriteText(name, "x");
  }
  EXPECT_THAT(Complaint(folder_), HasSubstr("times.txt: is missing"));
  WriteText("times.txt", "0.000000e+00\r\n1.037359e-01\n2.073381e-01\n");
  WriteText("calib.txt", "x");
  WriteText("poses.txt", "x");
  const Layout layout = FindLayout(folder_, At10Fps());
  EXPECT_EQ(layout.form, "KITTI odometry");
  EXPECT_THAT(Names(layout), ElementsAre("image_0/000000.png", "image_0/000002.png"));
  EXPECT_THAT(Times(layout), ElementsAre(0.0, 0.2073381));
  EXPECT_EQ(layout.camera.value().file, folder_ / "calib.txt");
  EXPECT_EQ(layout.ground_truth_file, folder_ / "poses.txt");
  EXPECT_THAT(Names(FindLayout(folder_ / "image_2", At10Fps())), ElementsAre("image_2/000000.png"));
  WriteText("times.txt", "0.0\n0.1\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("has 2 times, none for"));
  WriteText("times.txt", "0.0\nsoon\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("times.txt:2: is 'soon'"));
}

TEST_F(LayoutTest, TumRgbd) {
  WriteText("rgb.txt",
            "# color images\n# timestamp filename\n1305.5 rgb/1305.5.png\n"
            "1306.25 rgb/1306.25.png\r\n");
  WriteText("groundtruth.txt", "x");
  const Layout layout = FindLayout(folder_, At10Fps());
  EXPECT_EQ(layout.form, "TUM RGB-D");
  EXPECT_THAT(Names(layout), ElementsAre("rgb/1305.5.png", "rgb/1306.25.png"));
  EXPECT_THAT(Times(layout), ElementsAre(1305.5, 1306.25));
  EXPECT_EQ(layout.ground_truth_file, folder_ / "groundtruth.txt");
  WriteText("rgb.txt", "1305.5\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("rgb.txt:1: is '1305.5'"));
  WriteText("rgb.txt", "# nothing\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("rgb.txt: lists no images"));
}

TEST_F(LayoutTest, ListsMayCountFrom1970InSmallerUnits) {
  for (const char* zeros : {"", "000", "000000"}) {
    const std::string unit = zeros;
    WriteText("rgb.txt", "1305031102175" + unit + " a.png\n1305031102211" + unit + "\tb.png\n");
    EXPECT_THAT(Times(FindLayout(folder_, At10Fps())), ElementsAre(1305031102.175, 1305031102.211));
  }
  WriteText("rgb.txt", "1305031102175 a.png\n1305031102211.5 b.png\n");
  EXPECT_THAT(Times(FindLayout(folder_, At10Fps())), ElementsAre(1305031102.175, 1305031102.2115));
}

TEST_F(LayoutTest, NumbersThatAreNoTimes) {
  for (const std::string word : {"nan", "inf", "-inf", "1e999", "0x10", "1,5,5", "1.5s", ""}) {
    WriteText("rgb.txt", "0.5 a.png\n" + word + " b.png\n");
    EXPECT_THAT(Complaint(folder_), HasSubstr("rgb.txt:2: is '" + word)) << word;
  }
}

TEST_F(LayoutTest, Euroc) {
  WriteText("mav0/cam0/data.csv",
            "#timestamp [ns],filename\r\n1403715273262142976,1403715273262142976.png\r\n"
            "1403715273312142976, b.png\r\n");
  WriteText("mav0/cam0/sensor.yaml", "x");
  for (const auto& path :
       {folder_, folder_ / "mav0", folder_ / "mav0" / "cam0", folder_ / "mav0" / "cam0" / "."}) {
    const Layout layout = FindLayout(path, At10Fps());
    EXPECT_EQ(layout.form, "EuRoC ASL");
    EXPECT_THAT(Names(layout),
                ElementsAre("mav0/cam0/data/1403715273262142976.png", "mav0/cam0/data/b.png"));
    EXPECT_THAT(Times(layout), ElementsAre(1403715273.262142976, 1403715273.312142976));
    EXPECT_EQ(layout.camera.value().file, folder_ / "mav0" / "cam0" / "sensor.yaml");
  }
  WriteText("camera.yaml", "x");  // the user's own goes first
  EXPECT_EQ(FindLayout(folder_, At10Fps()).camera.value().file, folder_ / "camera.yaml");
  WriteText("mav0/cam0/data.csv", "1.5,a.png\n");
  EXPECT_THAT(Complaint(folder_), HasSubstr("data.csv:1: is '1.5,a.png'"));
  std::filesystem::remove(folder_ / "mav0" / "cam0" / "data.csv");
  EXPECT_THAT(Complaint(folder_), HasSubstr("data.csv: is missing"));
}

TEST_F(LayoutTest, RefusesWhatIsNoSequence) {
  EXPECT_THAT(Complaint(folder_ / "nowhere"), HasSubstr("nowhere: no such file or folder"));
  EXPECT_THAT(Complaint(folder_), HasSubstr("holds no images"));
  EXPECT_THAT(Complaint(WriteText("a.png", "x")), HasSubstr("a.png: is a single image"));
  EXPECT_THAT(Complaint(WriteText("a.csv", "x")), HasSubstr("a.csv: is no video"));
}

}  // namespace
}  // namespace rotslam
