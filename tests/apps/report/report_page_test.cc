// The report in a browser: opened without a window by Chromium, where that is installed.

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/chromium.h"
#include "tests/apps/run_directory.h"
#include "tests/apps/unknown_readout.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;

// Goes through the page as a person would, and leaves what it has seen in an element.
constexpr const char* kVisitor = R"js(
<pre id="seen"></pre>
<script>
(() => {
  const seen = {};
  try {
    const report = window.report;
    const slider = document.getElementById('slider');
    seen.ready = report.ready;
    seen.slider_max = Number(slider.max);
    const first = pixelsOf(report);
    seen.lit = first.filter((value, k) => k % 4 === 3 && value > 0).length;
    seen.start = report.markerPosition();
    slider.value = slider.max;
    slider.dispatchEvent(new Event('input'));
    seen.end = report.markerPosition();
    seen.frame = report.frame();
    seen.changed = differences(first, pixelsOf(report));
    seen.clock = document.getElementById('clock').textContent;
    seen.facts = [...document.querySelectorAll('.fact')].map((fact) => fact.innerText || fact.textContent);
    seen.notes = [...document.querySelectorAll('.note')].map((note) => note.textContent);
    seen.times = [...document.querySelectorAll('td.number')].map((cell) => cell.textContent);
    seen.charts = report.charts.length;
    seen.accuracy = [...document.querySelectorAll('#accuracy td.number')].map((cell) => cell.textContent);
    report.charts.forEach((chart) => chart.draw());
    seen.blank_charts = report.charts.filter((chart) => {
      const image = chart.canvas.getContext('2d').getImageData(0, 0, chart.canvas.width, chart.canvas.height).data;
      return !image.some((value) => value > 0);
    }).length;
    seen.errors = report.errors;
  } catch (error) {
    seen.failure = String(error.stack || error);
  }
  document.getElementById('seen').textContent = JSON.stringify(seen).replaceAll('<', '\\u003c');
})();
</script>
)js";

class ReportPage : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult simulated = Rotslam({"simulate",
                                             "handheld",
                                             "--width=320",
                                             "--height=240",
                                             "--frames=30",
                                             "--quiet",
                                             "--out=" + Sequence().string()});
    ASSERT_EQ(simulated.exit_code, 0) << simulated.error;
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }
  void SetUp() override {
    if (Chromium().empty()) GTEST_SKIP() << "chromium is not installed: no page is opened";
  }

  static fs::path Sequence() { return shared_->path() / "sequence"; }

  // Runs a command on a sequence, opens its report and gives what the visitor has seen.
  static Json Visit(const std::string& command,
                    const fs::path& out,
                    const fs::path& sequence = Sequence()) {
    const CommandResult result =
        Rotslam({command, sequence.string(), "--quiet", "--out=" + out.string()});
    EXPECT_EQ(result.exit_code, 0) << result.error;
    const TemporaryFolder folder;
    const fs::path page =
        folder.Write("visited.html", ReadWholeFile(out / "report.html") + kPixelScript + kVisitor);
    const fs::path dom = folder.path() / "dom";
    const fs::path log = folder.path() / "log";
    const std::string line = ChromiumCommand("file://" + page.string(),
                                             "--window-size=1400,2400 --virtual-time-budget=3000",
                                             folder.path(),
                                             dom,
                                             log);
    EXPECT_EQ(std::system(line.c_str()), 0) << ReadWholeFile(log);
    EXPECT_THAT(ConsoleMessages(ReadWholeFile(log)), IsEmpty());
    const std::string text = ReadWholeFile(dom);
    const std::string begin = "<pre id=\"seen\">";
    const std::size_t at = text.find(begin, text.rfind("</footer>"));
    if (at == std::string::npos) {
      ADD_FAILURE() << "the page did not come to its end: " << ReadWholeFile(log);
      return {};
    }
    const std::size_t end = text.find("</pre>", at);
    return Json::parse(text.substr(at + begin.size(), end - at - begin.size()));
  }

  static void ExpectAlive(const Json& seen) {
    ASSERT_FALSE(seen.contains("failure")) << seen.at("failure");
    EXPECT_EQ(seen.at("ready"), true);
    EXPECT_EQ(seen.at("errors").dump(), "[]");
    EXPECT_EQ(seen.at("slider_max"), 29);
    EXPECT_EQ(seen.at("frame"), 29);
    EXPECT_THAT(seen.at("clock").get<std::string>(), HasSubstr("frame 29 / 29"));
    EXPECT_GT(seen.at("lit").get<int>(), 2000) << "the view is blank";
    EXPECT_GT(seen.at("changed").get<int>(), 100) << "the slider changes nothing";
    EXPECT_EQ(seen.at("blank_charts"), 0);
  }

  const TemporaryFolder folder_;

 private:
  static inline const TemporaryFolder* shared_ = nullptr;
};

TEST_F(ReportPage, ShowsARun) {
  const fs::path out = folder_.path() / "run";
  const Json seen = Visit("run", out);
  ASSERT_NO_FATAL_FAILURE(ExpectAlive(seen));
  const Trajectory poses = ReadTrajectory(out / "trajectory_tum.txt");
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(seen.at("start")[axis].get<double>(), poses.front().center_in_world[axis], 1e-5);
    EXPECT_NEAR(seen.at("end")[axis].get<double>(), poses.back().center_in_world[axis], 1e-5);
  }
  const nlohmann::ordered_json summary = ReadSummary(out);
  const std::string facts = seen.at("facts").dump();
  for (const char* key : {"frames", "keyframes", "points"}) {
    std::string number = summary.at("counts").at(key).dump();
    if (number.size() > 3) number.insert(number.size() - 3, ",");
    EXPECT_THAT(facts, HasSubstr("\"" + number));
  }
  char total[32];
  std::snprintf(total, sizeof(total), "%.2f s", summary.at("seconds").at("total").get<double>());
  EXPECT_THAT(seen.at("times").dump(), HasSubstr(total));
  const TrajectoryMetrics metrics =
      Compare(Sequence() / "groundtruth_tum.txt", out / "trajectory_tum.txt");
  char rpe1[32];
  std::snprintf(rpe1, sizeof(rpe1), "\"%.4f\"", metrics.rpe1_deg);
  EXPECT_THAT(seen.at("accuracy").dump(), HasSubstr(rpe1));
  EXPECT_GE(seen.at("charts").get<int>(), 12);
}

TEST_F(ReportPage, ShowsOrientationsAlone) {
  const Json seen = Visit("rotations", folder_.path() / "rotations");
  ASSERT_NO_FATAL_FAILURE(ExpectAlive(seen));
  EXPECT_NE(seen.at("start"), seen.at("end"));
}

TEST_F(ReportPage, TellsOfAReadoutThatTheImagesTell) {
  const fs::path sequence = folder_.path() / "rolling";
  ASSERT_NO_FATAL_FAILURE(SimulateUnknownReadout(sequence));
  const Json seen = Visit("rotations", folder_.path() / "rotations", sequence);
  ASSERT_FALSE(seen.contains("failure")) << seen.at("failure");
  EXPECT_THAT(seen.at("notes").dump(),
              testing::ContainsRegex(
                  "Rolling shutter: the readout time estimated from the images is 2[0-9.]+ .+ "
                  "[0-9.]+ ms from the top"));
}

}  // namespace
}  // namespace rotslam
