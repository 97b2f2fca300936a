#include "krot/lp/lp.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

// max 3 x + 2 y  with  x + y <= 4,  x + 3 y <= 7,  0 <= x <= 3: optimum 11 at (3, 1).
LinearProgram SmallProgram() {
  LinearProgram program;
  program.AddRow(-kInfinity, 4.0);
  program.AddRow(-kInfinity, 7.0);
  program.AddColumn(-3.0, 0.0, 3.0, std::vector<std::pair<int, double>>{{0, 1.0}, {1, 1.0}});
  program.AddColumn(-2.0, 0.0, kInfinity, std::vector<std::pair<int, double>>{{0, 1.0}, {1, 3.0}});
  return program;
}

// Every engine of this build with every method.
std::vector<LpOptions> AllEngines() {
  std::vector<LpOptions> ways;
  for (const LpEngine engine : {LpEngine::kClp, LpEngine::kGlpk}) {
    if (!HasLpEngine(engine)) continue;
    for (const LpMethod method : {LpMethod::kInteriorPoint, LpMethod::kDualSimplex}) {
      LpOptions options;
      options.engine = engine;
      options.method = method;
      ways.push_back(options);
    }
  }
  return ways;
}

TEST(SolveLp, FindsOptimumAndPricesByAllEnginesAndMethods) {
  for (const LpOptions& options : AllEngines()) {
    const LpResult result = SolveLp(SmallProgram(), options);
    ASSERT_EQ(result.call, LpCallStatus::kCompleted);
    EXPECT_EQ(result.model, LpModelStatus::kOptimal);
    EXPECT_NEAR(result.objective, -11.0, 1e-5);
    EXPECT_NEAR(result.primal[0], 3.0, 1e-5);
    EXPECT_NEAR(result.primal[1], 1.0, 1e-5);
    EXPECT_NEAR(result.row_dual[0], -2.0, 1e-5);
    EXPECT_NEAR(result.row_dual[1], 0.0, 1e-5);
  }
}

TEST(SolveLp, RepeatsItsDigits) {
  for (const LpOptions& options : AllEngines()) {
    const LpResult a = SolveLp(SmallProgram(), options);
    const LpResult b = SolveLp(SmallProgram(), options);
    EXPECT_EQ(a.primal, b.primal);
    EXPECT_EQ(a.row_dual, b.row_dual);
  }
}

TEST(SolveLp, InfeasibleIsAModelStatusNotAFailedCall) {
  LinearProgram program = SmallProgram();
  program.AddRow(10.0, kInfinity);
  program.AddColumn(0.0, 0.0, 1.0, std::vector<std::pair<int, double>>{{2, 1.0}});
  for (const LpOptions& options : AllEngines()) {
    if (options.method != LpMethod::kDualSimplex) continue;
    const LpResult result = SolveLp(program, options);
    EXPECT_EQ(result.call, LpCallStatus::kCompleted);
    EXPECT_EQ(result.model, LpModelStatus::kInfeasible);
  }
}

TEST(SolveLp, RefusesWhatIsNoProgram) {
  EXPECT_THROW(SolveLp(LinearProgram{}), std::invalid_argument);
  LinearProgram program = SmallProgram();
  program.row_index[0] = 7;
  EXPECT_THROW(SolveLp(program), std::invalid_argument);
}

TEST(SolveLp, RefusesAnEngineThatIsNotThere) {
  if (HasLpEngine(LpEngine::kGlpk)) GTEST_SKIP() << "this build has every engine";
  LpOptions options;
  options.engine = LpEngine::kGlpk;
  EXPECT_THROW(SolveLp(SmallProgram(), options), std::invalid_argument);
}

}  // namespace
}  // namespace rotslam
