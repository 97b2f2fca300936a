#include "output/segments.h"

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

}  // namespace rotslam
