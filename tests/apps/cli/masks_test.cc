// What `rotslam run` is told to ignore, and where that goes.

#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/run_directory.h"
#include "tests/apps/small_sequence.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Masks : public SmallSequenceTest {
 protected:
  fs::path Write(const std::string& name, const cv::Mat& image) const {
    const fs::path file = folder_.path() / name;
    fs::create_directories(file.parent_path());
    EXPECT_TRUE(cv::imwrite(file.string(), image));
    return file;
  }

  // White, with black in the lowest 40 rows.
  static cv::Mat Bonnet() {
    cv::Mat image(240, 320, CV_8U, cv::Scalar(255));
    image(cv::Rect(0, 200, 320, 40)) = 0;
    return image;
  }
};

TEST_F(Masks, AreRefusedInOneLine) {
  const fs::path small = Write("small.png", cv::Mat(24, 32, CV_8U, cv::Scalar(255)));
  EXPECT_THAT(Refusal(Run(Good(), {"--mask", small.string()})),
              HasSubstr("small.png: the mask is 32x24, the images are 320x240"));
  EXPECT_THAT(Refusal(Run(Good(), {"--mask", "nowhere.png"})), HasSubstr("nowhere.png: "));
  EXPECT_THAT(Refusal(Run(Good(), {"--masks", "nowhere"})),
              HasSubstr("nowhere: is no folder of masks"));
  const fs::path one = Write("masks/" + Images(Good()).front().filename().string(), Bonnet());
  EXPECT_THAT(Refusal(Run(Good(), {"--masks", one.parent_path().string()})),
              HasSubstr("holds no mask for frame " + Images(Good())[1].filename().string()));
}

TEST_F(Masks, TravelIntoTheExports) {
  const fs::path mask = Write("bonnet.png", Bonnet());
  const CommandResult result = Run(Good(), {"--mask", mask.string()});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const auto summary = ReadSummary(Out());
  EXPECT_NEAR(summary.at("masks").at("share").get<double>(), 1.0 / 6.0, 1e-6);
  EXPECT_EQ(summary.at("masks").at("static_content"), "none");
  const cv::Mat written = cv::imread((Out() / "mask.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(cv::norm(written, Bonnet(), cv::NORM_INF), 0.0);

  const fs::path folder = folder_.path() / "export";
  const CommandResult to_nerf = Rotslam({"export",
                                         Out().string(),
                                         "--to",
                                         "nerf",
                                         "--quiet",
                                         "--out",
                                         (folder / "transforms.json").string()});
  ASSERT_EQ(to_nerf.exit_code, 0) << to_nerf.error;
  const auto json = nlohmann::ordered_json::parse(ReadWholeFile(folder / "transforms.json"));
  ASSERT_FALSE(json.at("frames").empty());
  for (const auto& frame : json.at("frames")) {
    const fs::path file = folder / frame.at("mask_path").get<std::string>();
    EXPECT_EQ(file.filename().string(),
              fs::path(frame.at("file_path").get<std::string>()).filename().string() + ".png");
    const cv::Mat image = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
    ASSERT_FALSE(image.empty()) << file;
    EXPECT_EQ(cv::norm(image, Bonnet(), cv::NORM_INF), 0.0);
  }
}

TEST_F(Masks, AreNoneByDefault) {
  const CommandResult result = Run(Good());
  ASSERT_EQ(result.exit_code, 0) << result.error;
  EXPECT_FALSE(ReadSummary(Out()).contains("masks"));
  EXPECT_FALSE(fs::exists(Out() / "mask.png"));
}

}  // namespace
}  // namespace rotslam
