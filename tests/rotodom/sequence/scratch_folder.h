#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

namespace rotslam {

/// A test with a folder of its own, gone afterwards.
class ScratchFolderTest : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path WriteText(const std::string& name, const std::string& text) const {
    const std::filesystem::path file = folder_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }

  // An image all of whose pixels have the same value.
  std::filesystem::path WriteImage(const std::string& name,
                                   const cv::Scalar& value = cv::Scalar::all(0),
                                   int type = CV_8UC1,
                                   const cv::Size& size = {16, 12}) const {
    const std::filesystem::path file = folder_ / name;
    std::filesystem::create_directories(file.parent_path());
    EXPECT_TRUE(cv::imwrite(file.string(), cv::Mat(size, type, value)));
    return file;
  }

  const std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) / ("rotslam_sequence_" + std::to_string(getpid()));
};

}  // namespace rotslam
