#include "apps/cli/input/input_lines.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "apps/cli/terminal/describe.h"
#include "rotodom/types/median.h"

namespace rotslam {
namespace {

// An interval this many times the usual one is a gap.
constexpr double kGapFactor = 1.7;

std::string Number(const char* format, double value) {
  std::array<char, 64> text = {};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

}  // namespace

std::string DescribeTimes(const std::vector<double>& times_s, bool with_gaps) {
  if (times_s.empty()) return {};
  std::string text = Number("%.6f", times_s.front()) + " to " + Number("%.6f s", times_s.back());
  std::vector<double> intervals_s;
  int num_equal = 0;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    const double interval_s = times_s[k] - times_s[k - 1];
    interval_s > 0.0 ? intervals_s.push_back(interval_s) : static_cast<void>(++num_equal);
  }
  if (intervals_s.empty()) return text;
  const double usual_s = Median(intervals_s);
  text += ", " + Number("%.4g", 1.0 / usual_s) + " a second";
  if (num_equal > 0) text += ", " + std::to_string(num_equal) + " there twice";
  if (!with_gaps) return text;
  int num_gaps = 0;
  std::size_t largest = 1;
  for (std::size_t k = 1; k < times_s.size(); ++k) {
    const double interval_s = times_s[k] - times_s[k - 1];
    num_gaps += interval_s > kGapFactor * usual_s ? 1 : 0;
    if (interval_s > times_s[largest] - times_s[largest - 1]) largest = k;
  }
  if (num_gaps > 0) {
    text += ", " + std::to_string(num_gaps) + (num_gaps == 1 ? " gap" : " gaps") +
            ", the longest " + Number("%.3g s", times_s[largest] - times_s[largest - 1]) +
            " after number " + std::to_string(largest - 1);
  }
  return text;
}

std::vector<std::string> DescribeSequence(const Sequence& sequence) {
  std::vector<std::string> lines = {"input:  " + sequence.Describe()};
  const std::string times = DescribeTimes(sequence.timestamps_s(), sequence.is_video());
  const bool says_all = times.empty() || sequence.times_are_made_up();
  lines.push_back("times:  " + sequence.times_source() + (says_all ? "" : ": " + times));
  for (const std::string& note : sequence.notes()) lines.push_back("note:   " + note);
  return lines;
}

std::vector<std::string> DescribeCamera(const Input& input) {
  if (input.guess) {
    return {"camera: no calibration: the lens is estimated from the images, starting from f = " +
            Number("%.1f px", input.guess->focal_px) +
            (input.guess->KnowsFocal() ? " (" + Name(input.guess->source) + ")" : std::string())};
  }
  std::vector<std::string> lines = {"camera: " + Describe(input.camera) + " (" +
                                    input.camera_source + ")"};
  for (const std::string& note : input.camera_notes) lines.push_back("note:   " + note);
  // A calibration that names no side means the top, which a phone held upright has elsewhere.
  const auto& side = input.sequence().readout_from();
  const Camera& camera = input.camera;
  if (side && *side != ReadoutStart::kTop && camera.readout_s > 0.0 &&
      camera.readout_from != *side) {
    lines.push_back(std::string("note:   the calibration reads the shutter from the ") +
                    Name(camera.readout_from) +
                    ", but the first row that the sensor stored is shown at the " + Name(*side) +
                    ": `readout_from: " + Name(*side) + "` is likely right");
  }
  return lines;
}

std::vector<std::string> DescribeMasks(const FrameMasks& masks) {
  std::vector<std::string> lines;
  if (!masks.common().IsEmpty()) {
    lines.push_back("masks:  " + PercentText(masks.common().Share()) +
                    " of the picture is ignored in all frames");
  }
  if (!masks.folder().empty()) {
    lines.push_back("masks:  one per frame, from " + masks.folder().string());
  }
  return lines;
}

}  // namespace rotslam
