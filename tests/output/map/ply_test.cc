#include "output/map/ply.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pcl/PCLPointCloud2.h>
#include <pcl/PolygonMesh.h>
#include <pcl/conversions.h>
#include <pcl/io/ply_io.h>
#include <pcl/point_types.h>

#include "tests/output/temporary_folder.h"

namespace rotslam {
namespace {

using testing::HasSubstr;

Camera SomeCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 500.0;
  camera.cx = 320.0;
  camera.cy = 240.0;
  return camera;
}

// Two cameras side by side see one point 4 m ahead with errors of 1 and 2 px; a third sees nothing.
Reconstruction TwoCamerasOnePoint() {
  Reconstruction reconstruction;
  reconstruction.cam_from_world = {{FrameId{0}, {}}, {FrameId{1}, {}}};
  reconstruction.center_in_world = {{FrameId{0}, {-1.0, 0.0, 0.0}}, {FrameId{1}, {1.0, 0.0, 0.0}}};
  reconstruction.point_in_world = {{TrackId{7}, {0.0, 0.0, 4.0}}};
  Track track;
  track.id = TrackId{7};
  track.rgb = {200, 100, 50};
  track.observations = {{FrameId{0}, {320.0 + 125.0 + 1.0, 240.0}, {}},
                        {FrameId{1}, {320.0 - 125.0, 240.0 - 2.0}, {}},
                        {FrameId{2}, {0.0, 0.0}, {}}};
  Track without_point;
  without_point.id = TrackId{8};
  reconstruction.tracks = {without_point, track};
  return reconstruction;
}

TEST(MakeCloud, MeasuresErrorDirectionAndSightings) {
  const std::vector<CloudPoint> cloud = MakeCloud(TwoCamerasOnePoint(), SomeCamera());
  ASSERT_EQ(cloud.size(), 1u);
  EXPECT_EQ(cloud[0].num_observations, 2);
  EXPECT_NEAR(cloud[0].mean_error_px, 1.5, 1e-9);
  EXPECT_LT((cloud[0].normal_in_world - Eigen::Vector3d(0.0, 0.0, -1.0)).norm(), 1e-12);
  EXPECT_EQ(cloud[0].rgb, (std::array<std::uint8_t, 3>{200, 100, 50}));
}

TEST(MakeCloud, LeavesOutWhatNoCameraCanSee) {
  Reconstruction reconstruction = TwoCamerasOnePoint();
  reconstruction.point_in_world[TrackId{7}].z() = -4.0;
  EXPECT_TRUE(MakeCloud(reconstruction, SomeCamera()).empty());
}

class PlyForms : public testing::TestWithParam<PlyForm> {};
INSTANTIATE_TEST_SUITE_P(WritePly, PlyForms, testing::Values(PlyForm::kBinary, PlyForm::kAscii));

TEST_P(PlyForms, AreReadBackByPcl) {
  const TemporaryFolder folder;
  std::vector<CloudPoint> cloud;
  for (int k = 0; k < 1000; ++k) {
    CloudPoint point;
    point.point_in_world = Eigen::Vector3d(0.5 * k, -k, 100.0 + k);
    point.rgb = {static_cast<std::uint8_t>(k % 256), 20, 255};
    point.normal_in_world = Eigen::Vector3d(0.0, 0.6, -0.8);
    point.num_observations = k + 2;
    point.mean_error_px = 0.25 * k;
    cloud.push_back(point);
  }
  WritePly(folder.path() / "c.ply", cloud, GetParam());

  pcl::PCLPointCloud2 blob;
  ASSERT_EQ(pcl::PLYReader().read((folder.path() / "c.ply").string(), blob), 0);
  pcl::PointCloud<pcl::PointXYZRGBNormal> read;  // its curvature finds no field
  pcl::fromPCLPointCloud2(blob, read);
  ASSERT_EQ(read.size(), cloud.size());
  const auto& point = read[517];
  EXPECT_EQ(point.getVector3fMap(), Eigen::Vector3f(258.5f, -517.f, 617.f));
  EXPECT_EQ(point.r, 517 % 256);
  EXPECT_EQ(point.g, 20);
  EXPECT_EQ(point.b, 255);
  EXPECT_EQ(point.getNormalVector3fMap(), Eigen::Vector3f(0.f, 0.6f, -0.8f));

  std::vector<std::string> names;
  for (const pcl::PCLPointField& field : blob.fields) names.push_back(field.name);
  EXPECT_THAT(names, testing::IsSupersetOf({"observations", "error_px"}));
  for (const pcl::PCLPointField& field : blob.fields) {
    const std::uint8_t* place = blob.data.data() + 517 * blob.point_step + field.offset;
    if (field.name == "observations") {
      EXPECT_EQ(*reinterpret_cast<const std::int32_t*>(place), 519);
    }
    if (field.name == "error_px") {
      EXPECT_EQ(*reinterpret_cast<const float*>(place), 129.25f);
    }
  }
}

TEST(WritePly, HasThePropertiesEveryViewerKnows) {
  const TemporaryFolder folder;
  WritePly(folder.path() / "c.ply", {CloudPoint{}});
  const std::string text = ReadWholeFile(folder.path() / "c.ply");
  for (const char* line : {"format binary_little_endian 1.0",
                           "element vertex 1\n",
                           "property float x\n",
                           "property uchar red\n",
                           "property uchar green\n",
                           "property uchar blue\n",
                           "property float nx\n"}) {
    EXPECT_THAT(text, HasSubstr(line));
  }
  EXPECT_THAT(text, testing::Not(HasSubstr("alpha")));
}

TEST(WritePly, AsciiIsText) {
  const TemporaryFolder folder;
  WritePly(folder.path() / "c.ply", {CloudPoint{}}, PlyForm::kAscii);
  const std::string text = ReadWholeFile(folder.path() / "c.ply");
  EXPECT_THAT(text, HasSubstr("format ascii 1.0\n"));
  EXPECT_THAT(text, HasSubstr("end_header\n0 0 0 128 128 128 0 0 0 0 0\n"));
  WritePly(folder.path() / "c.ply", {}, PlyForm::kAscii);
  EXPECT_THAT(ReadWholeFile(folder.path() / "c.ply"), HasSubstr("element vertex 0"));
}

TEST(WritePly, TakesAnEmptyCloudAndRefusesAMissingFolder) {
  const TemporaryFolder folder;
  WritePly(folder.path() / "c.ply", {});
  EXPECT_THAT(ReadWholeFile(folder.path() / "c.ply"), HasSubstr("element vertex 0"));
  EXPECT_THAT(RuntimeErrorOf([&] { WritePly(folder.path() / "no" / "c.ply", {}); }),
              HasSubstr("No such file or directory"));
}

TEST_P(PlyForms, FrustaAreReadBackByPcl) {
  const TemporaryFolder folder;
  const Rotation cam_from_world = Rotation::Exp({0.1, -0.7, 0.3});
  const Eigen::Vector3d center(4.0, -5.0, 6.0);
  WriteFrustaPly(folder.path() / "cameras.ply",
                 {{cam_from_world, center, 0.25}, {Rotation(), Eigen::Vector3d::Zero(), 1.0}},
                 SomeCamera(),
                 GetParam());
  pcl::PolygonMesh mesh;
  ASSERT_EQ(pcl::PLYReader().read((folder.path() / "cameras.ply").string(), mesh), 0);
  pcl::PointCloud<pcl::PointXYZRGB> vertices;
  pcl::fromPCLPointCloud2(mesh.cloud, vertices);
  ASSERT_EQ(vertices.size(), 10u);
  ASSERT_EQ(mesh.polygons.size(), 8u);
  EXPECT_EQ(vertices[0].getVector3fMap(), center.cast<float>());
  for (int corner = 1; corner < 5; ++corner) {
    const Eigen::Vector3d ray =
        cam_from_world * (vertices[corner].getVector3fMap().cast<double>() - center);
    EXPECT_NEAR(ray.norm(), 0.25, 1e-6);
    const Eigen::Vector2d pixel = SomeCamera().Project(ray).value();
    EXPECT_NEAR(pixel.x(), corner == 2 || corner == 3 ? 639.5 : -0.5, 1e-2);
    EXPECT_NEAR(pixel.y(), corner >= 3 ? 479.5 : -0.5, 1e-2);
  }
  for (std::size_t face = 0; face < mesh.polygons.size(); ++face) {
    ASSERT_EQ(mesh.polygons[face].vertices.size(), 3u);
    EXPECT_EQ(mesh.polygons[face].vertices[0], face < 4 ? 0u : 5u);
  }
  EXPECT_EQ(vertices[0].b, 255);
  EXPECT_EQ(vertices[5].r, 255);
}

TEST(WriteFrustaPly, TakesNoCamerasAndRefusesBrokenOnes) {
  const TemporaryFolder folder;
  WriteFrustaPly(folder.path() / "cameras.ply", {}, SomeCamera());
  EXPECT_THAT(ReadWholeFile(folder.path() / "cameras.ply"), HasSubstr("element face 0"));
  EXPECT_THROW(WriteFrustaPly(folder.path() / "cameras.ply", {}, Camera{}), std::invalid_argument);
}

TEST(FrustumSize, IsHalfAStepAndForgetsWhereTheCameraStands) {
  EXPECT_EQ(FrustumSize({}), 1.0);
  CenterMap centers;
  for (int k = 0; k < 20; ++k) centers[FrameId{k}] = Eigen::Vector3d(3.0 * std::min(k, 7), 0, 0);
  EXPECT_EQ(FrustumSize(centers), 1.5);
}

}  // namespace
}  // namespace rotslam
