#include "output/segments.h"

#include <cstddef>

#include "output/atomic_file.h"
#include "output/text_file.h"

namespace rotslam {

void WriteSegments(const std::filesystem::path& path, const std::vector<Segment>& segments) {
  std::string text = "first_frame,last_frame,kind,component,scale,evidence\n";
  for (const Segment& segment : segments) {
    text += std::to_string(segment.first_frame) + ',' + std::to_string(segment.last_frame) + ',' +
            segment.kind + ',' + std::to_string(segment.component) + ',' + segment.scale + ',' +
            FormatNumber("%.4f", segment.evidence) + '\n';
  }
  ReplaceFile(path, text);
}

std::vector<Segment> ReadSegmentsCsv(const std::filesystem::path& path) {
  constexpr std::size_t kNumColumns = 6;
  const std::vector<TextRow> texts = ReadCsvRows(path, kNumColumns);
  std::vector<Segment> segments;
  segments.reserve(texts.size());
  for (const TextRow& text : texts) {
    const auto number = [&](std::size_t column) { return NumberAt(path, text, column); };
    segments.push_back({static_cast<int>(number(0)),
                        static_cast<int>(number(1)),
                        text.words[2],
                        static_cast<int>(number(3)),
                        text.words[4],
                        number(5)});
  }
  return segments;
}

}  // namespace rotslam
