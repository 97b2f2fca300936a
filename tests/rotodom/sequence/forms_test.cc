// Each form of input with a small folder of its own.

#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rotodom/sequence/sequence_form.h"
#include "tests/rotodom/sequence/scratch_folder.h"

namespace rotslam {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class FormsTest : public ScratchFolderTest {
 protected:
  void Touch(std::initializer_list<const char*> names) const {
    for (const char* name : names) WriteText(name, "x");
  }

  Layout Find(const std::string& path = "") const {
    return FindLayout(path.empty() ? folder_ : folder_ / path, {});
  }

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

  std::string Complaint(const std::string& path = "") const {
    try {
      Find(path);
      return "no complaint";
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
      return error.what();
    }
  }
};

TEST_F(FormsTest, AreAllInTheTable) {
  std::vector<std::string> names;
  for (const SequenceForm& form : SequenceForms()) {
    names.push_back(form.name);
    EXPECT_FALSE(form.description.empty()) << form.name;
    EXPECT_THAT(form.description, testing::Not(HasSubstr("\n")));
    EXPECT_NE(form.recognises, nullptr) << form.name;
    EXPECT_NE(form.list, nullptr) << form.name;
  }
  for (const char* name : {"EuRoC ASL",
                           "KITTI odometry",
                           "KITTI raw",
                           "TUM RGB-D",
                           "DSO / TUM-mono",
                           "7-Scenes",
                           "ScanNet",
                           "TartanAir",
                           "image folder",
                           "video"}) {
    EXPECT_THAT(names, Contains(name));
  }
}

TEST_F(FormsTest, EurocSecondCamera) {
  for (const char* camera : {"mav0/cam0/", "mav0/cam1/"}) {
    WriteText(std::string(camera) + "data.csv",
              "timestamp [ns],filename\n1403715273262142976,a.png\n");
    WriteText(std::string(camera) + "data/a.png", "x");
    WriteText(std::string(camera) + "sensor.yaml", "x");
  }
  WriteText("mav0/imu0/data.csv", "1403715273262142976,0.1\n");
  WriteText("mav0/state_groundtruth_estimate0/data.csv", "x");
  WriteText("groundtruth_cam0_tum.txt", "x");
  for (const char* path : {"mav0/cam1", "mav0/cam1/data"}) {
    const Layout layout = Find(path);
    EXPECT_EQ(layout.form, "EuRoC ASL");
    EXPECT_THAT(Names(layout), ElementsAre("mav0/cam1/data/a.png"));
    EXPECT_EQ(layout.camera.value().file, folder_ / "mav0" / "cam1" / "sensor.yaml");
    EXPECT_EQ(layout.ground_truth_file,
              folder_ / "mav0" / "state_groundtruth_estimate0" / "data.csv");
  }
  EXPECT_EQ(Find("mav0").ground_truth_file, folder_ / "groundtruth_cam0_tum.txt");
  EXPECT_THAT(Complaint("mav0/imu0"), HasSubstr("holds no images"));
}

TEST_F(FormsTest, TumVi) {
  WriteText("mav0/cam1/data.csv", "#timestamp [ns],filename\n1520530308199447626,a.png\n");
  Touch({"mav0/cam1/data/a.png", "dso/camchain.yaml", "mav0/mocap0/data.csv"});
  const Layout layout = Find("mav0/cam1");
  EXPECT_EQ(layout.camera.value().file, folder_ / "dso" / "camchain.yaml");
  EXPECT_EQ(layout.ground_truth_file, folder_ / "mav0" / "mocap0" / "data.csv");
}

TEST_F(FormsTest, KittiOdometryTakesTheProjectionOfTheImages) {
  Touch({"00/image_0/000000.png", "00/image_2/000000.png", "poses/00.txt"});
  WriteText("00/times.txt", "0.0\n");
  WriteText("00/calib.txt", "P0: 1 0 0 0\nP2: 1 0 0 0\n");
  EXPECT_EQ(Find("00").camera.value().name, "P0");
  EXPECT_EQ(Find("00/image_2").camera.value().name, "P2");
  EXPECT_EQ(Find("00/image_2").camera.value().file, folder_ / "00" / "calib.txt");
  WriteText("00/calib.txt", "P0: 1 0 0 0\n");
  EXPECT_EQ(Find("00/image_2").camera.value().name, "");
}

TEST_F(FormsTest, KittiRaw) {
  const std::string drive = "2011_09_26/2011_09_26_drive_0001_sync/";
  for (const std::string& camera : {std::string("image_00/"), std::string("image_02/")}) {
    WriteText(drive + camera + "timestamps.txt",
              "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:26.074343744\n");
    WriteText(drive + camera + "data/0000000000.png", "x");
    WriteText(drive + camera + "data/0000000001.png", "x");
  }
  WriteText("2011_09_26/calib_cam_to_cam.txt", "x");
  WriteText(drive + "oxts/data/0000000000.txt", "x");
  for (const std::string& path : {drive, drive + "image_00", drive + "image_00/data"}) {
    const Layout layout = Find(path);
    EXPECT_EQ(layout.form, "KITTI raw") << path;
    EXPECT_EQ(layout.folder, (folder_ / (drive + "image_00/data")).lexically_normal());
    EXPECT_EQ(layout.camera.value().file, folder_ / "2011_09_26" / "calib_cam_to_cam.txt");
    EXPECT_EQ(layout.times_source, "timestamps.txt (dates)");
    ASSERT_EQ(layout.entries.size(), 2u);
    EXPECT_NEAR(layout.entries[0].timestamp_s, 1317042145.964389445, 1e-6);
    EXPECT_NEAR(layout.entries[1].timestamp_s - layout.entries[0].timestamp_s, 0.109954299, 1e-6);
    EXPECT_THAT(layout.notes, ElementsAre(HasSubstr("oxts/")));
  }
  EXPECT_EQ(Find(drive + "image_02").folder.parent_path().filename(), "image_02");
  WriteText(drive + "image_00/timestamps.txt", "2011-09-26 13:02:25.964389445\n");
  EXPECT_THAT(Complaint(drive), HasSubstr("timestamps.txt: has 1 times, none for"));
  std::filesystem::remove(folder_ / (drive + "image_00/timestamps.txt"));
  EXPECT_TRUE(Find(drive).times_are_made_up);
  EXPECT_THAT(Find(drive).notes, Contains(HasSubstr("timestamps.txt is missing")));
}

TEST_F(FormsTest, TumRgbdReadsListsOfOtherSystems) {
  Touch({"rgb/1.25.png", "rgb/1.5.png", "rgb/a b.png"});
  WriteText("rgb.txt",
            "\xef\xbb\xbf# t name\r\n1.25 rgb\\1.25.PNG \r\n1.5\tC:\\data\\rgb\\1.5.png\r\n"
            "1,75 rgb/a b.png\r\n2.0 rgb/gone.png\r\n");
  const Layout layout = Find();
  EXPECT_EQ(layout.form, "TUM RGB-D");
  EXPECT_THAT(Names(layout),
              ElementsAre("rgb/1.25.png", "rgb/1.5.png", "rgb/a b.png", "rgb/gone.png"));
  EXPECT_THAT(Times(layout), ElementsAre(1.25, 1.5, 1.75, 2.0));
  EXPECT_THAT(layout.notes,
              ElementsAre(HasSubstr("names files in other folders (C:\\data\\rgb\\1.5.png)"),
                          HasSubstr("spells 1 names another way"),
                          HasSubstr("lists 1 of 4 files that are not there (rgb/gone.png)")));
}

TEST_F(FormsTest, AssociationsInEitherOrder) {
  Touch({"rgb/1.5.png", "rgb/1.75.png", "depth/1.51.png", "depth/1.76.png"});
  WriteText("associations.txt",
            "1.51 depth/1.51.png 1.5 rgb/1.5.png\n1.76 depth/1.76.png 1.75 rgb/1.75.png\n");
  EXPECT_THAT(Names(Find()), ElementsAre("rgb/1.5.png", "rgb/1.75.png"));
  EXPECT_THAT(Times(Find()), ElementsAre(1.5, 1.75));
  WriteText("associated.txt", "");
  WriteText("rgb.txt",
            "1.5 rgb/1.5.png 1.51 depth/1.51.png\n1.75 rgb/1.75.png 1.76 depth/1.76.png\n");
  EXPECT_THAT(Times(Find()), ElementsAre(1.5, 1.75));
  WriteText("rgb.txt", "1.5 rgb/1.5.png 1.51 depth/1.51.png\n1.75 rgb/1.75.png\n");
  EXPECT_THAT(Complaint(), HasSubstr("rgb.txt:2: is '1.75 rgb/1.75.png', expected 'time name"));
}

TEST_F(FormsTest, IclNuimNumbersItsFrames) {
  Touch({"rgb/0.png", "rgb/1.png", "depth/0.png", "depth/1.png", "livingRoom2.gt.freiburg"});
  WriteText("associations.txt", "0 depth/0.png 0 rgb/0.png\n1 depth/1.png 1 rgb/1.png\n");
  const Layout layout = Find();
  EXPECT_TRUE(layout.times_are_made_up);
  EXPECT_THAT(Times(layout), ElementsAre(0.0, 1.0 / 30.0));
  EXPECT_EQ(layout.own_camera.value().fx, 481.2);
  EXPECT_EQ(layout.ground_truth_file, folder_ / "livingRoom2.gt.freiburg");
  EXPECT_THAT(layout.times_source, HasSubstr("made up at 30 frames a second"));
}

TEST_F(FormsTest, TumMono) {
  Touch({"images/00000.jpg", "images/00001.jpg", "camera.txt", "pcalib.txt", "vignette.png"});
  WriteText("times.txt", "00000 1444223221.4503 0.5\n00001 1444223221.4953 0.5\n");
  for (const char* path : {"", "images"}) {
    const Layout layout = Find(path);
    EXPECT_EQ(layout.form, "DSO / TUM-mono");
    EXPECT_THAT(Names(layout), ElementsAre("images/00000.jpg", "images/00001.jpg"));
    EXPECT_THAT(Times(layout), ElementsAre(1444223221.4503, 1444223221.4953));
    EXPECT_EQ(layout.times_source, "times.txt");
    EXPECT_EQ(layout.camera.value().file, folder_ / "camera.txt");
    EXPECT_THAT(layout.notes, ElementsAre(HasSubstr("vignette.png and pcalib.txt")));
    EXPECT_TRUE(layout.photometric.has_value());
  }
  std::filesystem::remove_all(folder_ / "images");
  WriteText("images.zip", "x");
  EXPECT_THAT(Complaint(), HasSubstr("images.zip: is packed; unpack it: unzip "));
}

TEST_F(FormsTest, SevenScenes) {
  for (const char* frame : {"frame-000000", "frame-000001"}) {
    for (const char* end : {".color.png", ".depth.png", ".pose.txt"}) {
      WriteText(std::string("seq-01/") + frame + end, "x");
    }
  }
  const Layout layout = Find("seq-01");
  EXPECT_EQ(layout.form, "7-Scenes");
  EXPECT_THAT(Names(layout),
              ElementsAre("seq-01/frame-000000.color.png", "seq-01/frame-000001.color.png"));
  EXPECT_EQ(layout.ground_truth_file, folder_ / "seq-01");
  EXPECT_TRUE(layout.times_are_made_up);
  EXPECT_THAT(Complaint(), HasSubstr("but seq-01 in it does: give "));
}

TEST_F(FormsTest, Scannet) {
  Touch({"color/0.jpg", "color/10.jpg", "color/9.jpg", "pose/0.txt", "depth/0.png"});
  WriteText("intrinsic/intrinsic_color.txt",
            "1169.62 0.0 646.295 0.0\n0.0 1167.105 489.927 0.0\n0.0 0.0 1.0 0.0\n0 0 0 1\n");
  for (const char* path : {"", "color"}) {
    const Layout layout = Find(path);
    EXPECT_EQ(layout.form, "ScanNet");
    EXPECT_THAT(Names(layout), ElementsAre("color/0.jpg", "color/9.jpg", "color/10.jpg"));
    EXPECT_EQ(layout.own_camera.value().fx, 1169.62);
    EXPECT_EQ(layout.own_camera.value().fy, 1167.105);
    EXPECT_EQ(layout.own_camera.value().cx, 646.295);
    EXPECT_EQ(layout.own_camera.value().cy, 489.927);
    EXPECT_EQ(layout.ground_truth_file, folder_ / "pose");
  }
  WriteText("intrinsic/intrinsic_color.txt", "1169 0.5 646 0\n0 1167 489 0\n0 0 1 0\n");
  EXPECT_THAT(Complaint(), HasSubstr("intrinsic_color.txt:1: found 0.5, expected"));
  WriteText("intrinsic/intrinsic_color.txt", "1169 0 646 0\n0 -1167 489 0\n0 0 1 0\n");
  EXPECT_THAT(Complaint(), HasSubstr("intrinsic_color.txt: "));
  WriteText("camera.yaml", "x");
  EXPECT_EQ(Find().camera.value().file, folder_ / "camera.yaml");
  EXPECT_FALSE(Find().own_camera);
}

TEST_F(FormsTest, TartanAir) {
  Touch({"image_left/000000_left.png",
         "image_left/000001_left.png",
         "pose_left.txt",
         "image_right/000000_right.png",
         "pose_right.txt"});
  const Layout layout = Find();
  EXPECT_EQ(layout.form, "TartanAir");
  EXPECT_THAT(Names(layout),
              ElementsAre("image_left/000000_left.png", "image_left/000001_left.png"));
  EXPECT_EQ(layout.ground_truth_file, folder_ / "pose_left.txt");
  EXPECT_EQ(layout.own_camera.value().fx, 320.0);
  EXPECT_EQ(layout.own_camera.value().height, 480);
  EXPECT_EQ(Find("image_right").ground_truth_file, folder_ / "pose_right.txt");
}

TEST_F(FormsTest, CalibrationBesideTheImages) {
  Touch({"images/a.png", "transforms.json"});
  EXPECT_EQ(Find().camera.value().file, folder_ / "transforms.json");
  EXPECT_EQ(Find("images").camera.value().file, folder_ / "transforms.json");
  Touch({"ost.yaml"});
  EXPECT_EQ(Find().camera.value().file, folder_ / "ost.yaml");
  EXPECT_THAT(Find().notes,
              Contains(HasSubstr("not used: " + (folder_ / "transforms.json").string())));
  Touch({"camera.yaml"});
  EXPECT_EQ(Find().camera.value().file, folder_ / "camera.yaml");
}

TEST_F(FormsTest, SaysWhatToGiveInstead) {
  Touch({"a.CR2", "b.cr2"});
  EXPECT_THAT(Complaint(), HasSubstr("holds 2 files .cr2, which are not read; convert them: "));
  Touch({"gif/a.gif"});
  EXPECT_THAT(Complaint("gif"), HasSubstr("ffmpeg -i"));
  Touch({"film/a.mp4"});
  EXPECT_THAT(Complaint("film"), HasSubstr("for the video give "));
  Touch({"zip/a.zip"});
  EXPECT_THAT(Complaint("zip"), HasSubstr("but a.zip: unpack it"));
}

}  // namespace
}  // namespace rotslam
