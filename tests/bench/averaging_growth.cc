// The cost of averaging as a sequence grows: the window's newest orientations alone, or all of
// them at every frame (the paper's figure "runtime"). Writes averaging_growth.csv and .png to the
// folder given, the present one without.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <time.h>

#include "rotodom/averaging/averaging.h"
#include "tests/scenes/rotation_graph.h"

namespace rotslam {
namespace {

constexpr int kNumViews = 801;  // as KITTI 03, the figure's sequence
constexpr int kSmoothing = 9;   // frames, median

// Time of this thread, which other programs on the machine do not change.
double CpuMilliseconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

struct Growth {
  std::string name;
  std::vector<double> milliseconds;  // by frame
  double rms_deg = 0.0;
};

// Every frame starts from its edge to the frame before.
Growth Measure(const RotationGraph& scene, AveragingMode mode) {
  AveragingOptions options;
  options.mode = mode;
  Growth growth;
  growth.name = OptionWords(mode)[static_cast<std::size_t>(mode)];
  RotationMap rotations = {{FrameId{0}, Rotation()}};
  growth.milliseconds.push_back(0.0);
  for (int k = 1; k < kNumViews; ++k) {
    const FrameId view{k};
    const FrameId before{k - 1};
    rotations[view] = scene.graph.FindEdge(before, view)->j_from_i * rotations.at(before);
    const double start_ms = CpuMilliseconds();
    const std::set<FrameId> free_views = ViewsToAverage(rotations, options);
    for (const auto& [moved, rotation] :
         AverageRotations(scene.graph, rotations, free_views, options)) {
      rotations[moved] = rotation;
    }
    growth.milliseconds.push_back(CpuMilliseconds() - start_ms);
  }
  growth.rms_deg = CompareRotations(rotations, scene.true_cam_from_world).rms_deg;
  return growth;
}

std::vector<double> Smoothed(const std::vector<double>& values) {
  std::vector<double> smoothed;
  for (int k = 0; k < static_cast<int>(values.size()); ++k) {
    const int first = std::max(1, k - kSmoothing / 2);
    const int last = std::min(static_cast<int>(values.size()), k + kSmoothing / 2 + 1);
    std::vector<double> near(values.begin() + first, values.begin() + std::max(first + 1, last));
    std::nth_element(near.begin(), near.begin() + static_cast<int>(near.size()) / 2, near.end());
    smoothed.push_back(near[near.size() / 2]);
  }
  return smoothed;
}

void WriteCsv(const std::filesystem::path& path, const std::vector<Growth>& growths) {
  std::ofstream file(path);
  file << "frame";
  for (const Growth& growth : growths) file << ',' << growth.name << "_ms";
  file << '\n';
  for (int k = 1; k < kNumViews; ++k) {
    file << k;
    for (const Growth& growth : growths) file << ',' << growth.milliseconds[k];
    file << '\n';
  }
}

// Frames to the right, milliseconds upwards on a logarithmic scale.
class Plot {
 public:
  Plot() : image_(600, 960, CV_8UC3, cv::Scalar::all(255)) {
    for (int decade = kLowDecade; decade <= kHighDecade; ++decade) {
      const double value = std::pow(10.0, decade);
      const int y = At(0, value).y;
      cv::line(image_, {kLeft, y}, {kRight, y}, cv::Scalar::all(205), 1, cv::LINE_AA);
      std::array<char, 32> label{};
      std::snprintf(label.data(), label.size(), "%g", value);
      Text(label.data(), {kLeft - 12, y + 5}, cv::Scalar::all(40), 1.0);
      for (int step = 2; step < 10 && decade < kHighDecade; ++step) {
        const int minor = At(0, step * value).y;
        cv::line(image_, {kLeft, minor}, {kRight, minor}, cv::Scalar::all(238), 1, cv::LINE_AA);
      }
    }
    for (int frame = 0; frame < kNumViews; frame += 100) {
      const int x = At(frame, 1.0).x;
      cv::line(image_, {x, kTop}, {x, kBottom}, cv::Scalar::all(225), 1, cv::LINE_AA);
      Text(std::to_string(frame), {x, kBottom + 24}, cv::Scalar::all(40), 0.5);
    }
    cv::rectangle(image_, {kLeft, kTop}, {kRight, kBottom}, cv::Scalar::all(60), 1);
    Text("Rotation averaging per frame: CPU time [ms], logarithmic",
         {(kLeft + kRight) / 2, kTop - 18},
         cv::Scalar::all(0),
         0.5);
    Text("frame", {(kLeft + kRight) / 2, kBottom + 52}, cv::Scalar::all(0), 0.5);
  }

  void Draw(const std::vector<double>& values, const cv::Scalar& colour, const std::string& label) {
    std::vector<cv::Point> line;
    for (int k = 1; k < static_cast<int>(values.size()); ++k) line.push_back(At(k, values[k]));
    cv::polylines(image_, line, false, colour, 2, cv::LINE_AA);
    const int y = kTop + 28 + 26 * num_labels_++;
    cv::line(image_, {kLeft + 16, y - 5}, {kLeft + 50, y - 5}, colour, 3, cv::LINE_AA);
    Text(label, {kLeft + 60, y}, cv::Scalar::all(0), 0.0);
  }

  const cv::Mat& image() const { return image_; }

 private:
  static constexpr int kLeft = 80;
  static constexpr int kRight = 930;
  static constexpr int kTop = 50;
  static constexpr int kBottom = 530;
  static constexpr int kLowDecade = -3;
  static constexpr int kHighDecade = 2;

  static cv::Point At(int frame, double value) {
    const double up = (std::log10(std::max(value, 1e-3)) - kLowDecade) / (kHighDecade - kLowDecade);
    const double right = static_cast<double>(frame) / (kNumViews - 1);
    return {kLeft + static_cast<int>(std::lround(right * (kRight - kLeft))),
            kBottom - static_cast<int>(std::lround(up * (kBottom - kTop)))};
  }

  // `anchor` is the part of the text's width to the left of `where`.
  void Text(const std::string& text, cv::Point where, const cv::Scalar& colour, double anchor) {
    int baseline = 0;
    const cv::Size size = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.55, 1, &baseline);
    where.x -= static_cast<int>(anchor * size.width);
    cv::putText(image_, text, where, cv::FONT_HERSHEY_SIMPLEX, 0.55, colour, 1, cv::LINE_AA);
  }

  cv::Mat image_;
  int num_labels_ = 0;
};

int WriteGrowth(const std::filesystem::path& folder) {
  const RotationGraph scene =
      MakeRotationGraph({.num_views = kNumViews, .keyframe_every = 8, .wrong_ratio = 0.05});
  const std::vector<Growth> growths = {Measure(scene, AveragingMode::kWindow),
                                       Measure(scene, AveragingMode::kGlobal)};
  WriteCsv(folder / "averaging_growth.csv", growths);
  Plot plot;
  const std::array<cv::Scalar, 2> colours = {cv::Scalar(180, 90, 20), cv::Scalar(40, 60, 200)};
  for (std::size_t k = 0; k < growths.size(); ++k) {
    const Growth& growth = growths[k];
    const std::vector<double> smoothed = Smoothed(growth.milliseconds);
    double sum = 0.0;
    for (const double milliseconds : growth.milliseconds) sum += milliseconds;
    std::array<char, 160> label{};
    std::snprintf(label.data(),
                  label.size(),
                  "%s: mean %.3f ms, last frame %.3f ms, error %.3f deg",
                  growth.name.c_str(),
                  sum / (kNumViews - 1),
                  smoothed.back(),
                  growth.rms_deg);
    std::printf("%s\n", label.data());
    plot.Draw(smoothed, colours[k], label.data());
  }
  return cv::imwrite((folder / "averaging_growth.png").string(), plot.image()) ? 0 : 1;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) { return rotslam::WriteGrowth(argc > 1 ? argv[1] : "."); }
