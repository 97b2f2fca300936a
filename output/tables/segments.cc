#include "output/tables/segments.h"

#include <cstddef>

#include "output/files/atomic_file.h"
#include "rotodom/types/text_file.h"

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
    segments.push_back({IntegerAt(path, text, 0, 0),
                        IntegerAt(path, text, 1, 0),
                        text.words[2],
                        IntegerAt(path, text, 3, -1),
                        text.words[4],
                        NumberAt(path, text, 5)});
  }
  return segments;
}

}  // namespace rotslam
