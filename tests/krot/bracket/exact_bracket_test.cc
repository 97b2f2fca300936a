#include <iterator>
#include <memory>
#include <set>
#include <utility>

#include <glpk.h>
#include <gtest/gtest.h>

#include "krot/bracket/bisection.h"
#include "krot/known_rotation.h"
#include "krot/structure/minimax_lp.h"
#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

struct DeleteProblem {
  void operator()(glp_prob* problem) const { glp_delete_prob(problem); }
};

// Smallest slack s >= 0 with which all half-spaces can be met at `gamma`, in rational arithmetic on
// the primal program: another formulation, another engine, no rounding.
double ExactSlack(const MinimaxProblem& problem, double gamma) {
  glp_term_out(GLP_OFF);
  const std::unique_ptr<glp_prob, DeleteProblem> lp(glp_create_prob());
  const int num_centers = 3 * (problem.num_views() - 1);
  const int slack = num_centers + 3 * problem.num_points + 1;
  glp_add_cols(lp.get(), slack);
  for (int c = 1; c < slack; ++c) glp_set_col_bnds(lp.get(), c, GLP_FR, 0.0, 0.0);
  glp_set_col_bnds(lp.get(), slack, GLP_LO, 0.0, 0.0);
  glp_set_obj_dir(lp.get(), GLP_MIN);
  glp_set_obj_coef(lp.get(), slack, 1.0);
  for (const ImageObservation& observation : problem.observations) {
    const auto normals = HalfSpaceNormals(problem.R_c_w[observation.view], observation.xy, gamma);
    for (int k = 0; k < 5; ++k) {
      const int row = glp_add_rows(lp.get(), 1);
      std::vector<int> columns = {0};
      std::vector<double> values = {0.0};
      for (int axis = 0; axis < 3; ++axis) {
        columns.push_back(num_centers + 3 * observation.point + axis + 1);
        values.push_back(normals[k][axis]);
        if (observation.view == 0) continue;
        columns.push_back(3 * (observation.view - 1) + axis + 1);
        values.push_back(-normals[k][axis]);
      }
      if (k < 4) {
        columns.push_back(slack);
        values.push_back(-1.0);
      }
      glp_set_mat_row(
          lp.get(), row, static_cast<int>(columns.size()) - 1, columns.data(), values.data());
      glp_set_row_bnds(lp.get(), row, GLP_UP, 0.0, k == 4 ? -1.0 : 0.0);
    }
  }
  // The floating-point basis is a start for the rational simplex, nothing more.
  glp_simplex(lp.get(), nullptr);
  EXPECT_EQ(glp_exact(lp.get(), nullptr), 0);
  if (glp_get_status(lp.get()) == GLP_NOFEAS) return kInfinity;
  EXPECT_EQ(glp_get_status(lp.get()), GLP_OPT);
  return glp_get_obj_val(lp.get());
}

MinimaxProblem SmallInstance(int instance, SceneRandom& random) {
  SceneOptions options;
  options.seed = static_cast<std::uint64_t>(instance) + 100;
  options.num_views = 3 + random.Index(3);
  options.num_points = 5 + random.Index(5);
  options.noise_px = random.Uniform(0.1, 3.0);
  options.rotation_noise_deg = instance % 3 == 0 ? 0.1 : 0.0;
  options.outlier_ratio = instance % 5 == 0 ? 0.05 : 0.0;
  options.path = instance % 2 == 0 ? ScenePath::kRandom : ScenePath::kRing;
  return ProblemFromScene(MakeScene(options));
}

// Brackets of the first `count` instances: none may be wrong, nearly all must be narrow.
void ExpectTrueBrackets(int count, const BisectionOptions& options) {
  SceneRandom random(11);
  int num_converged = 0;
  for (int instance = 0; instance < count; ++instance) {
    const MinimaxProblem problem = SmallInstance(instance, random);
    const BisectionResult bracket = MinimiseMaxResidual(problem, options);
    ASSERT_LT(bracket.gamma_high, kInfinity) << "instance " << instance;
    num_converged += bracket.status == BisectionStatus::kConverged;
    EXPECT_LT(ExactSlack(problem, bracket.gamma_high * (1.0 + 1e-12)), 1e-12)
        << "instance " << instance;
    if (bracket.gamma_low == 0.0) continue;
    EXPECT_GT(ExactSlack(problem, bracket.gamma_low), 0.0) << "instance " << instance;
  }
  EXPECT_GE(num_converged, 0.95 * count);
}

TEST(MinimiseMaxResidual, InteriorBracketsHoldInExactArithmetic) { ExpectTrueBrackets(500, {}); }

TEST(MinimiseMaxResidual, ClpBracketsHoldInExactArithmetic) {
  BisectionOptions options;
  options.method = BisectionMethod::kPrograms;
  ExpectTrueBrackets(500, options);
}

TEST(MinimiseMaxResidual, GlpkBracketsHoldInExactArithmetic) {
  BisectionOptions options;
  options.method = BisectionMethod::kPrograms;
  options.lp.engine = LpEngine::kGlpk;
  ExpectTrueBrackets(500, options);
}

// The whole solver: what it keeps has no smaller largest residual than it says, and its own centres
// and points attain what it says.
TEST(SolveKnownRotation, BracketOfWhatItKeepsHoldsInExactArithmetic) {
  for (int instance = 0; instance < 5; ++instance) {
    SceneOptions scene_options;
    scene_options.seed = static_cast<std::uint64_t>(instance) + 1;
    scene_options.num_views = 4;
    scene_options.num_points = 30;
    scene_options.noise_px = 1.0;
    Scene scene = MakeScene(scene_options);
    KrotOptions options;
    options.start = KrotStart::kBisection;
    const KrotSolution solution =
        SolveKnownRotation(scene.cam_from_world, scene.tracks, scene.camera, options);
    ASSERT_EQ(solution.status, KrotStatus::kConverged) << solution.message;
    std::set<std::pair<TrackId, FrameId>> removed;
    for (const RemovedObservation& one : solution.removed) removed.insert({one.track, one.frame});
    std::erase_if(scene.tracks,
                  [&](const Track& track) { return !solution.point_in_world.contains(track.id); });
    for (Track& track : scene.tracks) {
      std::erase_if(track.observations, [&](const Observation& observation) {
        return removed.contains({track.id, observation.frame});
      });
    }
    const MinimaxProblem problem = ProblemFromScene(scene);
    ASSERT_EQ(std::ssize(problem.observations), solution.num_bracket_observations);
    EXPECT_GT(ExactSlack(problem, solution.gamma_low), 0.0) << instance;
    EXPECT_LT(ExactSlack(problem, solution.gamma_high * (1.0 + 1e-9)), 1e-9) << instance;
    MinimaxStructure structure;
    for (const auto& [view, rotation] : scene.cam_from_world) {
      structure.center_in_world.push_back(solution.center_in_world.at(view));
    }
    for (const Track& track : scene.tracks) {
      structure.point_in_world.push_back(solution.point_in_world.at(track.id));
    }
    EXPECT_NEAR(MaxBoxResidual(problem, structure), solution.gamma_high, 1e-9);
  }
}

}  // namespace
}  // namespace rotslam
