#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

#include "rotodom/camera/camera_form.h"
#include "rotodom/camera/colmap_camera.h"

namespace rotslam {
namespace {

bool HasOnly(const std::string& text, const char* characters) {
  return !text.empty() && text.find_first_not_of(characters) == std::string::npos;
}

bool IsColmapRow(const TextRow& row) {
  return row.words.size() >= 4 && HasOnly(row.words[0], "0123456789") &&
         HasOnly(row.words[1], "ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789") &&
         row.words[1].find_first_not_of("0123456789") != std::string::npos &&
         HasOnly(row.words[2], "0123456789");
}

template <class Number>
Number LittleEndian(const std::string& bytes, std::size_t at) {
  Number number = 0;
  std::memcpy(&number, bytes.data() + at, sizeof(number));
  return number;
}

// The shortest text that gives back the very number.
std::string ExactText(double value) {
  char buffer[40];
  const auto result = std::to_chars(std::begin(buffer), std::end(buffer), value);
  return {buffer, result.ptr};
}

// What a cameras.bin says, one camera after the other, as words of a line of cameras.txt.
class ColmapCameras {
 public:
  explicit ColmapCameras(const CameraDocument& document)
      : file_(document.file()), bytes_(document.binary()) {}

  // A count of cameras that the file's size allows for, and a first model of a number in use.
  bool IsLikely() const {
    if (bytes_.size() < kHead + kCamera) return false;
    const auto count = LittleEndian<std::uint64_t>(bytes_, 0);
    const auto model = LittleEndian<std::int32_t>(bytes_, kHead + 4);
    return count > 0 && count <= (bytes_.size() - kHead) / kCamera && model >= 0 && model < 64;
  }

  std::vector<std::vector<std::string>> Read() const {
    std::vector<std::vector<std::string>> cameras;
    std::size_t at = kHead;
    for (auto left = LittleEndian<std::uint64_t>(bytes_, 0); left > 0; --left) {
      Need(at, kCamera);
      const auto id = LittleEndian<std::uint32_t>(bytes_, at);
      const auto number = LittleEndian<std::int32_t>(bytes_, at + 4);
      const ColmapModelId* model = FindColmapModel(number);
      if (model == nullptr) {
        FailAt(file_,
               0,
               "camera " + std::to_string(id) + ": model number " + std::to_string(number) +
                   " is not supported; convert the model to text and see cameras.txt");
      }
      std::vector<std::string> words = {
          std::to_string(id),
          model->name,
          std::to_string(LittleEndian<std::uint64_t>(bytes_, at + 8)),
          std::to_string(LittleEndian<std::uint64_t>(bytes_, at + 16))};
      at += kCamera;
      Need(at, 8 * model->num_parameters);
      for (std::size_t k = 0; k < model->num_parameters; ++k, at += 8) {
        words.push_back(ExactText(LittleEndian<double>(bytes_, at)));
      }
      cameras.push_back(std::move(words));
    }
    if (at != bytes_.size()) {
      FailAt(file_, 0, "is no cameras.bin: bytes are left over behind the last camera");
    }
    return cameras;
  }

 private:
  static constexpr std::size_t kHead = 8;
  static constexpr std::size_t kCamera = 24;  // before its parameters

  void Need(std::size_t at, std::size_t size) const {
    if (size <= bytes_.size() - at) return;
    FailAt(file_, 0, "ends within a camera: the file is cut off or no cameras.bin");
  }

  const std::filesystem::path& file_;
  const std::string& bytes_;
};

CameraFile ReadColmap(const CameraDocument& document) {
  CameraFile file;
  for (const TextRow& row : document.rows()) {
    file.Add(row.words[0], [&] { return ReadColmapCamera(document.file(), row.words, row.line); });
  }
  if (document.binary().empty()) return file;
  for (const auto& words : ColmapCameras(document).Read()) {
    file.Add(words[0], [&] { return ReadColmapCamera(document.file(), words); });
  }
  return file;
}

}  // namespace

namespace forms {

CameraForm CameraFormColmap() {
  CameraForm form;
  form.name = "COLMAP cameras";
  form.description =
      "cameras.txt, lines `1 OPENCV 640 480 500 501 320 240 -0.1 0.02 0 0`, or cameras.bin";
  form.file_names = {"cameras.txt", "cameras.bin"};
  form.recognises = [](const CameraDocument& document) {
    if (!document.binary().empty()) return ColmapCameras(document).IsLikely();
    return !document.rows().empty() && IsColmapRow(document.rows().front());
  };
  form.read = ReadColmap;
  return form;
}

}  // namespace forms
}  // namespace rotslam
