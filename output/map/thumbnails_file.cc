#include "output/map/thumbnails_file.h"

#include <string_view>

#include "output/files/atomic_file.h"
#include "output/files/binary_file.h"

namespace rotslam {
namespace {

constexpr std::string_view kThumbnailsMagic = "rotslam_thumbnails 1\n";
constexpr int kMaxThumbnailSide = 1024;

}  // namespace

void WriteThumbnails(const std::filesystem::path& path, const ThumbnailTable& thumbnails) {
  BinaryWriter writer;
  for (const char c : kThumbnailsMagic) writer.Put(c);
  writer.Put(static_cast<std::int32_t>(thumbnails.width));
  writer.Put(static_cast<std::int32_t>(thumbnails.height));
  writer.Put(static_cast<std::uint64_t>(thumbnails.grey.size()));
  for (const std::vector<std::uint8_t>& grey : thumbnails.grey) {
    writer.Put(static_cast<std::uint8_t>(!grey.empty()));
    for (const std::uint8_t value : grey) writer.Put(value);
  }
  ReplaceFile(path, writer.bytes());
}

ThumbnailTable ReadThumbnails(const std::filesystem::path& path) {
  BinaryReader reader(path);
  if (reader.Take(kThumbnailsMagic.size()) != kThumbnailsMagic) {
    reader.Fail("is not a list of thumbnails that this version of `rotslam run` writes");
  }
  ThumbnailTable thumbnails;
  for (int* side : {&thumbnails.width, &thumbnails.height}) {
    *side = reader.Get<std::int32_t>();
    if (*side < 1 || *side > kMaxThumbnailSide) reader.Fail("its size makes no sense");
  }
  thumbnails.grey.resize(reader.Count("thumbnails", 1));
  for (std::vector<std::uint8_t>& grey : thumbnails.grey) {
    if (reader.Get<std::uint8_t>() == 0) continue;
    const std::string_view bytes =
        reader.Take(static_cast<std::uint64_t>(thumbnails.width) * thumbnails.height);
    grey.assign(bytes.begin(), bytes.end());
  }
  reader.ExpectEnd();
  return thumbnails;
}

}  // namespace rotslam
