#include "output/map/ply.h"

#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <system_error>

#include <pcl/PCLPointCloud2.h>
#include <pcl/io/ply_io.h>

#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

// As many digits as tell one float from the next.
constexpr int kTextDigits = 9;

// A point as it lies in memory; PCL writes colour packed into one word as three bytes.
struct PackedPoint {
  float x;
  float y;
  float z;
  std::uint32_t rgb;  // 0x00rrggbb
  float normal_x;
  float normal_y;
  float normal_z;
  std::int32_t observations;
  float error_px;
};
static_assert(sizeof(PackedPoint) == 36);

PackedPoint Pack(const CloudPoint& point) {
  const Eigen::Vector3f position = point.point_in_world.cast<float>();
  const Eigen::Vector3f normal = point.normal_in_world.cast<float>();
  const std::uint32_t rgb = (static_cast<std::uint32_t>(point.rgb[0]) << 16) |
                            (static_cast<std::uint32_t>(point.rgb[1]) << 8) | point.rgb[2];
  return {position.x(),
          position.y(),
          position.z(),
          rgb,
          normal.x(),
          normal.y(),
          normal.z(),
          point.num_observations,
          static_cast<float>(point.mean_error_px)};
}

pcl::PCLPointCloud2 PackCloud(const std::vector<CloudPoint>& cloud) {
  pcl::PCLPointCloud2 packed;
  const auto add_field = [&](const char* name, std::size_t offset, std::uint8_t datatype) {
    pcl::PCLPointField field;
    field.name = name;
    field.offset = static_cast<pcl::uindex_t>(offset);
    field.datatype = datatype;
    field.count = 1;
    packed.fields.push_back(field);
  };
  add_field("x", offsetof(PackedPoint, x), pcl::PCLPointField::FLOAT32);
  add_field("y", offsetof(PackedPoint, y), pcl::PCLPointField::FLOAT32);
  add_field("z", offsetof(PackedPoint, z), pcl::PCLPointField::FLOAT32);
  add_field("rgb", offsetof(PackedPoint, rgb), pcl::PCLPointField::FLOAT32);
  add_field("normal_x", offsetof(PackedPoint, normal_x), pcl::PCLPointField::FLOAT32);
  add_field("normal_y", offsetof(PackedPoint, normal_y), pcl::PCLPointField::FLOAT32);
  add_field("normal_z", offsetof(PackedPoint, normal_z), pcl::PCLPointField::FLOAT32);
  add_field("observations", offsetof(PackedPoint, observations), pcl::PCLPointField::INT32);
  add_field("error_px", offsetof(PackedPoint, error_px), pcl::PCLPointField::FLOAT32);
  packed.height = 1;
  packed.width = static_cast<pcl::uindex_t>(cloud.size());
  packed.point_step = sizeof(PackedPoint);
  packed.row_step = packed.point_step * packed.width;
  packed.is_dense = true;
  packed.data.resize(cloud.size() * sizeof(PackedPoint));
  for (std::size_t k = 0; k < cloud.size(); ++k) {
    const PackedPoint point = Pack(cloud[k]);
    std::memcpy(packed.data.data() + k * sizeof(PackedPoint), &point, sizeof(PackedPoint));
  }
  return packed;
}

}  // namespace

void WritePly(const std::filesystem::path& path,
              const std::vector<CloudPoint>& cloud,
              PlyForm form) {
  const pcl::PCLPointCloud2 packed = PackCloud(cloud);
  const Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  const Eigen::Quaternionf orientation = Eigen::Quaternionf::Identity();
  const bool is_text = form == PlyForm::kAscii;
  pcl::PLYWriter writer;
  if (cloud.empty()) {  // which PCL's writer refuses
    ReplaceFile(path,
                is_text ? writer.generateHeaderASCII(packed, origin, orientation, 0, false)
                        : writer.generateHeaderBinary(packed, origin, orientation, 0, false));
    return;
  }
  ReplaceFile(path, [&](const std::filesystem::path& temporary) {
    // PCL does not say why a file cannot be opened: find out first.
    ReplaceFile(temporary, std::string_view());
    const int status =
        is_text
            ? writer.writeASCII(temporary.string(), packed, origin, orientation, kTextDigits, false)
            : writer.writeBinary(
                  temporary.string(), packed, origin, orientation, /*use_camera=*/false);
    std::error_code error;
    const auto size = std::filesystem::file_size(temporary, error);
    // PCL drops one byte per point, the unused one of the colour; a full disk shows as less. Text
    // has at least a digit and a blank per number.
    const std::uintmax_t least = is_text ? 2 * 11 : sizeof(PackedPoint) - 1;
    if (status != 0 || error || size <= cloud.size() * least) {
      throw std::runtime_error(path.string() + ": cannot write the cloud: is the disk full?");
    }
  });
}

}  // namespace rotslam
