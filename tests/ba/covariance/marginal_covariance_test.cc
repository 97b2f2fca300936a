#include "ba/covariance/marginal_covariance.h"

#include <deque>

#include <Eigen/Dense>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <gtest/gtest.h>

#include "ba/cost/reprojection_cost.h"
#include "tests/ba/ba_scene.h"

namespace rotslam {
namespace {

// A street as a Ceres problem at the truth: poses, points, the first two poses held.
class StreetProblem {
 public:
  explicit StreetProblem(int num_held = 2)
      : scene_(MakeBaScene({.num_frames = 8, .num_points = 60, .noise_px = 0.5})),
        problem_(Options()) {
    poses_.reserve(scene_.truth.cam_from_world.size());
    rotations_.reserve(scene_.truth.cam_from_world.size());
    for (const auto& [frame, rotation] : scene_.truth.cam_from_world) {
      rotations_.emplace_back(rotation);
      poses_.emplace_back() << Eigen::Vector3d::Zero(), scene_.truth.center_in_world.at(frame);
      problem_.AddParameterBlock(poses_.back().data(), 6);
      (frame.value < num_held ? held_ : cameras_).push_back(poses_.back().data());
    }
    for (double* pose : held_) problem_.SetParameterBlockConstant(pose);
    for (const Track& track : scene_.truth.tracks) {
      double* const point = scene_.truth.point_in_world.at(track.id).data();
      points_.push_back(point);
      for (const Observation& observation : track.observations) {
        costs_.emplace_back(
            ReprojectionState{
                scene_.camera, scene_.camera, rotations_[observation.frame.value], no_shift_},
            observation.keypoint_px,
            Eigen::Matrix2d::Identity() / observation.sigma_px);
        problem_.AddResidualBlock(
            &costs_.back(), &loss_, poses_[observation.frame.value].data(), point);
      }
    }
  }

  ceres::Problem& problem() { return problem_; }
  const std::vector<double*>& cameras() const { return cameras_; }
  const std::vector<double*>& points() const { return points_; }

 private:
  static ceres::Problem::Options Options() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return options;
  }

  BaScene scene_;
  ceres::HuberLoss loss_{1.0};
  const PointShift no_shift_;
  std::deque<ReprojectionCost> costs_;
  std::vector<TurnedRotation> rotations_;
  std::vector<Eigen::Matrix<double, 6, 1>> poses_;
  std::vector<double*> held_, cameras_, points_;
  ceres::Problem problem_;
};

TEST(MarginalCovariances, AreBlocksOfTheWholeInverse) {
  StreetProblem street;
  double* const first = street.cameras().front();
  double* const last = street.cameras().back();
  const auto ours = MarginalCovariances(
      street.problem(), street.points(), street.cameras(), {{last}, {first, last}, {}});
  ASSERT_TRUE(ours.has_value());
  // The whole normal matrix, inverted.
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = street.cameras();
  options.parameter_blocks.insert(
      options.parameter_blocks.end(), street.points().begin(), street.points().end());
  ceres::CRSMatrix rows;
  street.problem().Evaluate(options, nullptr, nullptr, nullptr, &rows);
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows.num_rows, rows.num_cols);
  for (int r = 0; r < rows.num_rows; ++r) {
    for (int k = rows.rows[r]; k < rows.rows[r + 1]; ++k) J(r, rows.cols[k]) = rows.values[k];
  }
  const Eigen::MatrixXd covariance =
      (J.transpose() * J).ldlt().solve(Eigen::MatrixXd::Identity(rows.num_cols, rows.num_cols));
  const Eigen::Index at_last = 6 * (static_cast<Eigen::Index>(street.cameras().size()) - 1);
  const Eigen::MatrixXd of_last = covariance.block(at_last, at_last, 6, 6);
  const Eigen::MatrixXd between = covariance.block(0, at_last, 6, 6);
  EXPECT_LT(((*ours)[0] - of_last).norm(), 1e-6 * of_last.norm());
  EXPECT_LT(((*ours)[1].topRightCorner<6, 6>() - between).norm(), 1e-6 * between.norm());
  EXPECT_LT(((*ours)[1].bottomRightCorner<6, 6>() - of_last).norm(), 1e-6 * of_last.norm());
  EXPECT_EQ((*ours)[2].size(), 0);
}

TEST(MarginalCovariances, SayNoWhereThePointsAreOpen) {
  StreetProblem street;
  // A point that nothing sees any more.
  std::vector<ceres::ResidualBlockId> seen;
  street.problem().GetResidualBlocksForParameterBlock(street.points().front(), &seen);
  for (const ceres::ResidualBlockId id : seen) street.problem().RemoveResidualBlock(id);
  EXPECT_FALSE(MarginalCovariances(
                   street.problem(), street.points(), street.cameras(), {{street.cameras().back()}})
                   .has_value());
}

}  // namespace
}  // namespace rotslam
