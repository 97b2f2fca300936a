#include "ba/cost/reprojection_cost.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include "ba/cost/lens_prior.h"
#include "ba/cost/rotation_prior.h"
#include "rotodom/types/rotation.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

class ReprojectionForEveryCamera : public ::testing::TestWithParam<CameraModel> {};
INSTANTIATE_TEST_SUITE_P(Models,
                         ReprojectionForEveryCamera,
                         ::testing::ValuesIn(AllCameraModels()));

TEST_P(ReprojectionForEveryCamera, JacobianOfReprojectEqualsCentralDifferences) {
  const Camera camera = BaCamera(GetParam());
  const Rotation cam_from_world = Rotation::Exp({0.3, -0.2, 0.1});
  const Eigen::Vector3d center(0.4, -0.3, 0.2);
  const Eigen::Vector3d point = cam_from_world.Inverse() * Eigen::Vector3d(1.1, -0.7, 4.0) + center;
  ReprojectionJacobian J;
  ASSERT_TRUE(Reproject(camera, cam_from_world.Matrix(), center, point, &J));
  const double step = 1e-5;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(axis);
    const auto difference = [&](const auto& at) -> Eigen::Vector2d {
      return (*at(delta) - *at(-delta)) / (2.0 * step);
    };
    const Eigen::Vector2d by_rotation = difference([&](const Eigen::Vector3d& d) {
      return Reproject(camera, (Rotation::Exp(d) * cam_from_world).Matrix(), center, point);
    });
    const Eigen::Vector2d by_center = difference([&](const Eigen::Vector3d& d) {
      return Reproject(camera, cam_from_world.Matrix(), center + d, point);
    });
    const Eigen::Vector2d by_point = difference([&](const Eigen::Vector3d& d) {
      return Reproject(camera, cam_from_world.Matrix(), center, point + d);
    });
    EXPECT_LT((J.by_rotation.col(axis) - by_rotation).norm(), 1e-6 * J.by_rotation.norm());
    EXPECT_LT((J.by_center.col(axis) - by_center).norm(), 1e-6 * J.by_center.norm());
    EXPECT_LT((J.by_point.col(axis) - by_point).norm(), 1e-6 * J.by_point.norm());
  }
}

// Ambient derivatives of a cost function against central differences.
void ExpectJacobiansAgree(const ceres::CostFunction& cost, std::vector<std::vector<double>> at) {
  const int num_residuals = cost.num_residuals();
  const auto evaluate = [&](double** jacobians) {
    std::vector<const double*> parameters;
    for (const auto& block : at) parameters.push_back(block.data());
    Eigen::VectorXd residuals(num_residuals);
    EXPECT_TRUE(cost.Evaluate(parameters.data(), residuals.data(), jacobians));
    return residuals;
  };
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  for (const auto& block : at) storage.emplace_back(num_residuals * block.size());
  for (auto& block : storage) jacobians.push_back(block.data());
  evaluate(jacobians.data());
  const double step = 1e-5;
  for (std::size_t b = 0; b < at.size(); ++b) {
    for (std::size_t k = 0; k < at[b].size(); ++k) {
      const double value = at[b][k];
      at[b][k] = value + step;
      const Eigen::VectorXd high = evaluate(nullptr);
      at[b][k] = value - step;
      const Eigen::VectorXd low = evaluate(nullptr);
      at[b][k] = value;
      for (int r = 0; r < num_residuals; ++r) {
        const double analytic = storage[b][r * at[b].size() + k];
        EXPECT_NEAR(analytic, (high[r] - low[r]) / (2.0 * step), 1e-5 * (1.0 + std::abs(analytic)))
            << "block " << b << ", column " << k << ", residual " << r;
      }
    }
  }
}

const Rotation kStart = Rotation::Exp({0.3, -0.2, 0.1});
const Eigen::Vector2d kKeypoint_px(600.0, 200.0);
// Added to the point: nothing.
const PointShift kShift;
// As certain along (0.6, -1.1) as the blur there leaves it.
const Eigen::Matrix2d kScale = Deblurring({0.6F, -1.1F}) / 0.7;

// A reprojection cost that keeps rotation and lens as its parameters say.
class FollowingCost final : public ceres::CostFunction {
 public:
  FollowingCost(const Camera& calibrated, const ObservationForm& form)
      : calibrated_(calibrated),
        camera_(calibrated),
        rotation_(kStart),
        form_(form),
        cost_({camera_, calibrated_, rotation_, kShift}, kKeypoint_px, kScale, 0.0, form) {
    set_num_residuals(cost_.num_residuals());
    *mutable_parameter_block_sizes() = cost_.parameter_block_sizes();
  }

  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    if (form_.camera != CameraLayout::kCenter) {
      rotation_.Turn(Eigen::Vector3d::Map(parameters[0]));
    }
    if (form_.num_lens_blocks > 0) {
      LensParameters lens = LensOf(calibrated_, calibrated_);
      const std::size_t first = parameter_block_sizes().size() - form_.num_lens_blocks;
      for (int k = 0; k < form_.num_lens_blocks; ++k) {
        lens.segment<kLensBlockSize>(k * kLensBlockSize) = LensBlock::Map(parameters[first + k]);
      }
      camera_ = WithLens(calibrated_, lens);
    }
    return cost_.Evaluate(parameters, residuals, jacobians);
  }

 private:
  Camera calibrated_;
  mutable Camera camera_;
  mutable TurnedRotation rotation_;
  ObservationForm form_;
  ReprojectionCost cost_;
};

TEST_P(ReprojectionForEveryCamera, JacobiansOfCostsEqualCentralDifferences) {
  const Camera camera = BaCamera(GetParam());
  const std::vector<double> turn = {0.02, -0.15, 0.1};
  const std::vector<double> center = {0.4, -0.3, 0.2};
  std::vector<double> pose = turn;
  pose.insert(pose.end(), center.begin(), center.end());
  const std::vector<double> point = {1.1, -0.7, 4.0};
  const std::vector<double> lens = {1.02, 0.99, 0.01, -0.02, -0.05, 0.03};
  const std::vector<double> rest = {0.002, -0.003, 0.01, 0.0, 0.0, 0.0};
  using Blocks = std::vector<std::vector<double>>;
  const struct {
    CameraLayout layout;
    bool at_infinity;
    Blocks camera_blocks;
  } cases[] = {
      {CameraLayout::kPose, false, {pose}},
      {CameraLayout::kPose, true, {pose}},
      {CameraLayout::kApart, false, {turn, center}},
      {CameraLayout::kApart, true, {turn}},
      {CameraLayout::kCenter, false, {center}},
  };
  for (const int num_lens_blocks : {0, 1, 2}) {
    for (const auto& [layout, at_infinity, camera_blocks] : cases) {
      Blocks blocks = camera_blocks;
      blocks.push_back(point);
      if (num_lens_blocks > 0) blocks.push_back(lens);
      if (num_lens_blocks > 1) blocks.push_back(rest);
      ExpectJacobiansAgree(FollowingCost(camera, {layout, at_infinity, num_lens_blocks}), blocks);
    }
  }
}

// The same residual written for Ceres' automatic derivatives.
struct AutomaticReprojection {
  Camera camera;
  Eigen::Matrix3d start;
  Eigen::Vector2d keypoint_px;
  Eigen::Matrix2d scale;

  template <typename T>
  bool operator()(const T* pose, const T* point, T* residuals) const {
    const Eigen::Map<const Eigen::Vector<T, 3>> center(pose + 3);
    const Eigen::Map<const Eigen::Vector<T, 3>> X(point);
    const Eigen::Vector<T, 3> before = start.cast<T>() * Eigen::Vector<T, 3>(X - center);
    Eigen::Vector<T, 3> p;
    ceres::AngleAxisRotatePoint(pose, before.data(), p.data());
    const auto& d = camera.distortion;
    T x = p.x() / p.z();
    T y = p.y() / p.z();
    const T r2 = x * x + y * y;
    if (camera.model == CameraModel::kEquidistant) {
      const T r = sqrt(r2);
      const T theta = atan(r);
      const T t2 = theta * theta;
      const T bent = theta * (1.0 + t2 * (d[0] + t2 * (d[1] + t2 * (d[2] + t2 * d[3]))));
      x *= bent / r;
      y *= bent / r;
    } else if (camera.model == CameraModel::kFov) {
      const T r = sqrt(r2);
      const T bent = atan(2.0 * std::tan(0.5 * d[0]) * r) / d[0];
      x *= bent / r;
      y *= bent / r;
    } else if (camera.model != CameraModel::kPinhole) {
      const T radial = (1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) /
                       (1.0 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
      const T x_bent = x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x);
      y = y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y;
      x = x_bent;
    }
    const Eigen::Vector<T, 2> offset_px(camera.fx * x + camera.cx - keypoint_px.x(),
                                        camera.fy * y + camera.cy - keypoint_px.y());
    Eigen::Vector<T, 2>::Map(residuals) = scale.cast<T>() * offset_px;
    return true;
  }
};

TEST_P(ReprojectionForEveryCamera, JacobiansEqualAutomaticDerivatives) {
  const Camera camera = BaCamera(GetParam());
  const FollowingCost ours(camera, {});
  const ceres::AutoDiffCostFunction<AutomaticReprojection, 2, 6, 3> automatic(
      new AutomaticReprojection{camera, kStart.Matrix(), kKeypoint_px, kScale});
  Eigen::Vector<double, 6> pose;
  pose << 0.02, -0.15, 0.1, 0.4, -0.3, 0.2;
  const Eigen::Vector3d point(1.1, -0.7, 4.0);
  const double* const blocks[] = {pose.data(), point.data()};
  using ByPose = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;
  using ByPoint = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  ByPose by_pose[2];
  ByPoint by_point[2];
  Eigen::Vector2d residuals[2];
  const ceres::CostFunction* const costs[] = {&ours, &automatic};
  for (int k = 0; k < 2; ++k) {
    double* jacobians[] = {by_pose[k].data(), by_point[k].data()};
    ASSERT_TRUE(costs[k]->Evaluate(blocks, residuals[k].data(), jacobians));
  }
  EXPECT_LT((residuals[0] - residuals[1]).norm(), 1e-10 * residuals[1].norm());
  EXPECT_LT((by_pose[0] - by_pose[1]).norm(), 1e-10 * by_pose[1].norm());
  EXPECT_LT((by_point[0] - by_point[1]).norm(), 1e-10 * by_point[1].norm());
}

TEST(LensPriorCost, IsZeroAtWhatIsExpectedAndItsJacobianEqualsCentralDifferences) {
  const double expected[6] = {1.0, 1.0, 0.01, -0.01, -0.1, 0.02};
  LensBlock sigmas;
  sigmas << 0.003, 0.001, 0.002, 0.002, 0.005, 0.1;
  const LensPriorCost cost(Eigen::Map<const LensBlock>(expected), sigmas);
  const double* parameters[1] = {expected};
  double residuals[6];
  ASSERT_TRUE(cost.Evaluate(parameters, residuals, nullptr));
  for (const double residual : residuals) EXPECT_EQ(residual, 0.0);
  ExpectJacobiansAgree(cost, {{1.01, 1.0, 0.0, 0.1, -0.09, 0.0}});
}

TEST_P(ReprojectionForEveryCamera, LensJacobianEqualsCentralDifferences) {
  const Camera calibrated = BaCamera(GetParam());
  const Eigen::Vector3d points[] = {
      {1.1, -0.7, 4.0}, {0.0, 0.0, 2.0}, {-3.0, 1.0, 4.0}, {1e-9, 1e-9, 1.0}};
  for (const double first : {-0.1, 0.3, 0.8}) {
    LensParameters lens = LensOf(calibrated, calibrated);
    lens.head<6>() << 1.02, 0.99, 0.01, -0.02, first, 0.03;
    const Camera camera = WithLens(calibrated, lens);
    for (const Eigen::Vector3d& point : points) {
      const auto J = LensJacobian(camera, calibrated, point, camera.Project(point).value());
      for (int k = 0; k < kLensSize; ++k) {
        const LensParameters step = 1e-6 * LensParameters::Unit(k);
        const Eigen::Vector2d difference =
            (WithLens(calibrated, lens + step).Project(point).value() -
             WithLens(calibrated, lens - step).Project(point).value()) /
            2e-6;
        EXPECT_LT((J.col(k) - difference).norm(), 1e-6 * (1.0 + difference.norm()))
            << "parameter " << k << " at " << point.transpose() << ", coefficient " << first;
      }
    }
  }
}

TEST_P(ReprojectionForEveryCamera, WithLensUndoesLensOfAndHoldsWhatAModelDoesNotHave) {
  const Camera camera = BaCamera(GetParam());
  const LensParameters calibrated = LensOf(camera, camera);
  EXPECT_EQ(WithLens(camera, calibrated), camera);
  LensParameters lens = LensParameters::Zero();
  lens.head<9>() << 1.01, 0.99, 0.003, -0.004, 0.7, 0.02, 0.001, -0.002, 0.01;
  const Camera moved = WithLens(camera, lens);
  EXPECT_FALSE(moved.Problem());
  const int num_coefficients = NumLensCoefficients(GetParam());
  lens.tail(kLensSize - kLensDistortion - num_coefficients).setZero();
  EXPECT_LT((LensOf(moved, camera) - lens).norm(), 1e-14);
  for (std::size_t k = NumLensCoefficients(GetParam()); k < camera.distortion.size(); ++k) {
    EXPECT_EQ(moved.distortion[k], camera.distortion[k]) << "coefficient " << k;
  }
}

TEST(LensJacobian, OfASmallFieldOfViewIsThatOfItsSeries) {
  Camera camera = BaCamera(CameraModel::kFov);
  const Eigen::Vector3d point(0.6, -0.8, 1.0);
  // d(r) = r + w^2 (r / 12 - r^3 / 3) + O(w^4); r is 1 here.
  for (const double w : {0.0, 1e-9, 5e-5, 6e-5, 9e-5, 1e-3}) {
    camera.distortion[0] = w;
    const Eigen::Matrix<double, 2, kLensSize> J =
        LensJacobian(camera, camera, point, camera.Project(point).value());
    EXPECT_NEAR(J(0, 4), -0.5 * w * 0.6 * camera.fx, 1e-5 * w * camera.fx) << w;
    EXPECT_NEAR(J(1, 4), 0.5 * w * 0.8 * camera.fy, 1e-5 * w * camera.fy) << w;
  }
}

TEST(WithLens, UndoesLensOfAndTurnsAPinholeIntoRadtanOnlyWhereItBends) {
  const Camera pinhole = BaCamera();
  EXPECT_EQ(WithLens(pinhole, LensOf(pinhole, pinhole)), pinhole);
  LensParameters lens = LensParameters::Zero();
  lens.head<9>() << 1.01, 0.99, 0.003, -0.004, 0.02, -0.01, 0.001, -0.002, 0.003;
  const Camera bent = WithLens(pinhole, lens);
  EXPECT_EQ(bent.model, CameraModel::kRadtan);
  EXPECT_FALSE(bent.Problem());
  EXPECT_LT((LensOf(bent, pinhole) - lens).norm(), 1e-14);
}

TEST(ScaleAnchorCost, IsZeroAtTheStartAndItsJacobianEqualsCentralDifferences) {
  const ScaleAnchorCost cost({1.0, 2.0, 3.0}, {4.0, 6.0, 3.5}, 100.0, CameraLayout::kApart);
  const double start[3] = {4.0, 6.0, 3.5};
  const double* parameters[1] = {start};
  double residual = 1.0;
  ASSERT_TRUE(cost.Evaluate(parameters, &residual, nullptr));
  EXPECT_NEAR(residual, 0.0, 1e-12);
  ExpectJacobiansAgree(cost, {{3.0, 5.0, 2.0}});
  ExpectJacobiansAgree(
      ScaleAnchorCost({1.0, 2.0, 3.0}, {4.0, 6.0, 3.5}, 100.0, CameraLayout::kPose),
      {{0.1, 0.2, 0.3, 3.0, 5.0, 2.0}});
}

TEST(RotationPriorCost, IsTheAngleInSigmasAndItsJacobianEqualsCentralDifferences) {
  const Rotation given = Rotation::Exp({0.2, -0.7, 1.1});
  const Rotation start = Rotation::Exp({0.03, 0.02, -0.04}) * given;
  const double sigma_rad = 0.01;
  const RotationPriorCost cost(start, given, sigma_rad);
  const auto residual_at = [&](const Eigen::Vector3d& turn) {
    Eigen::Vector3d residual;
    const double* blocks[] = {turn.data()};
    EXPECT_TRUE(cost.Evaluate(blocks, residual.data(), nullptr));
    return residual;
  };
  EXPECT_NEAR(residual_at(Eigen::Vector3d::Zero()).norm(),
              (start * given.Inverse()).Angle() / sigma_rad,
              1e-9);
  EXPECT_LT(residual_at((given * start.Inverse()).Log()).norm(), 1e-9);
  const Eigen::Vector3d turn(0.1, -0.3, 0.2);
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> J;
  const double* blocks[] = {turn.data()};
  double* jacobians[] = {J.data()};
  ASSERT_TRUE(cost.Evaluate(blocks, residual.data(), jacobians));
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
    const Eigen::Vector3d difference =
        (residual_at(turn + step) - residual_at(turn - step)) / (2.0 * kStep);
    EXPECT_LT((J.col(k) - difference).norm(), 1e-7 * J.norm()) << k;
  }
}

TEST(LeftJacobian, EqualsCentralDifferences) {
  for (const double angle : {0.0, 1e-6, 9e-5, 1.1e-4, 0.3, 2.5}) {
    const Eigen::Vector3d at = angle * Eigen::Vector3d(2.0, -1.0, 2.0) / 3.0;
    const Eigen::Matrix3d J = LeftJacobian(at);
    const double step = 1e-4;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d delta = step * Eigen::Vector3d::Unit(axis);
      const Rotation there = Rotation::Exp(at).Inverse();
      const Eigen::Vector3d difference =
          (Rotation::Exp(at + delta) * there).Log() - (Rotation::Exp(at - delta) * there).Log();
      EXPECT_LT((J.col(axis) - difference / (2.0 * step)).norm(), 1e-8) << angle;
    }
  }
}

TEST(TurnedRotation, IsComposedOnTheLeft) {
  TurnedRotation rotation(kStart);
  EXPECT_EQ(rotation.Matrix(), kStart.Matrix());
  const Eigen::Vector3d turn(0.1, -0.05, 0.2);
  rotation.Turn(turn);
  EXPECT_EQ(rotation.Matrix(), (Rotation::Exp(turn) * kStart).Matrix());
  EXPECT_EQ(rotation.Matrix(), rotation.At(turn).Matrix());
}

TEST(ReprojectionCost, PointBehindTheCameraOrLostCostsButDoesNotPull) {
  const Camera camera = BaCamera();
  const TurnedRotation rotation{Rotation()};
  for (const bool lost : {false, true}) {
    const PointShift shift = {Eigen::Vector3d::Zero(), lost};
    const ReprojectionCost cost({camera, camera, rotation, shift},
                                {600.0, 200.0},
                                0.5 * Eigen::Matrix2d::Identity(),
                                0.0,
                                {.camera = CameraLayout::kApart});
    const double turn[3] = {0.0, 0.0, 0.0};
    const double center[3] = {0.0, 0.0, 0.0};
    const double point[3] = {0.1, 0.2, lost ? 3.0 : -3.0};
    const double* parameters[3] = {turn, center, point};
    double residuals[2];
    double J_point[6];
    double* jacobians[3] = {nullptr, nullptr, J_point};
    ASSERT_TRUE(cost.Evaluate(parameters, residuals, jacobians));
    EXPECT_EQ(residuals[0], kUnseenResidual_px / 2.0);
    for (const double value : J_point) EXPECT_EQ(value, 0.0);
  }
}

}  // namespace
}  // namespace rotslam
