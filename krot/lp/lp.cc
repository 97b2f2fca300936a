#include "krot/lp/lp.h"

#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>

#include <ClpCholeskyBase.hpp>
#include <ClpInterior.hpp>
#include <ClpSimplex.hpp>
#include <CoinPackedMatrix.hpp>

#include "rotodom/types/stopwatch.h"

#ifdef ROTSLAM_WITH_GLPK
#include "krot/lp/lp_glpk.h"
#endif

namespace rotslam {
namespace {

double ClpBound(double bound) {
  if (bound == kInfinity) return COIN_DBL_MAX;
  if (bound == -kInfinity) return -COIN_DBL_MAX;
  return bound;
}

std::vector<double> ClpBounds(const std::vector<double>& bounds) {
  std::vector<double> result;
  result.reserve(bounds.size());
  for (const double bound : bounds) result.push_back(ClpBound(bound));
  return result;
}

void Load(const LinearProgram& program, ClpModel& model) {
  const std::vector<double> row_lower = ClpBounds(program.row_lower);
  const std::vector<double> row_upper = ClpBounds(program.row_upper);
  const std::vector<double> column_lower = ClpBounds(program.column_lower);
  const std::vector<double> column_upper = ClpBounds(program.column_upper);
  const std::vector<CoinBigIndex> start(program.column_start.begin(), program.column_start.end());
  model.loadProblem(program.num_columns(),
                    program.num_rows(),
                    start.data(),
                    program.row_index.data(),
                    program.value.data(),
                    column_lower.data(),
                    column_upper.data(),
                    program.cost.data(),
                    row_lower.data(),
                    row_upper.data());
}

void ReadBack(ClpModel& model, LpResult& result) {
  const double* primal = model.primalColumnSolution();
  const double* dual = model.dualRowSolution();
  result.primal.assign(primal, primal + model.numberColumns());
  result.row_dual.assign(dual, dual + model.numberRows());
  result.iterations = model.numberIterations();
  bool finite = true;
  for (const double x : result.primal) finite = finite && std::isfinite(x);
  for (const double y : result.row_dual) finite = finite && std::isfinite(y);
  result.call = finite ? LpCallStatus::kCompleted : LpCallStatus::kFailed;
}

LpModelStatus FromClp(int status) {
  switch (status) {
    case 0:
      return LpModelStatus::kOptimal;
    case 1:
      return LpModelStatus::kInfeasible;
    case 2:
      return LpModelStatus::kUnbounded;
    case 3:
      return LpModelStatus::kIterationLimit;
    default:
      return LpModelStatus::kUnknown;
  }
}

void SolveInterior(const LinearProgram& program, const LpOptions& options, LpResult& result) {
  ClpInterior model;
  model.setLogLevel(0);
  Load(program, model);
  model.setMaximumBarrierIterations(options.max_iterations);
  model.setCholesky(new ClpCholeskyBase());  // the model owns it
  const int status = model.primalDual();
  ReadBack(model, result);
  result.model = FromClp(status);
}

void SolveSimplex(const LinearProgram& program, const LpOptions& options, LpResult& result) {
  ClpSimplex model;
  model.setLogLevel(0);
  Load(program, model);
  model.setMaximumIterations(1000 * options.max_iterations);
  model.dual();
  ReadBack(model, result);
  result.model = FromClp(model.status());
}

}  // namespace

bool HasLpEngine(LpEngine engine) {
#ifdef ROTSLAM_WITH_GLPK
  return engine == LpEngine::kClp || engine == LpEngine::kGlpk;
#else
  return engine == LpEngine::kClp;
#endif
}

LpResult SolveLp(const LinearProgram& program, const LpOptions& options) {
  if (const std::string problem = program.Problem(); !problem.empty()) {
    throw std::invalid_argument(problem);
  }
  if (!HasLpEngine(options.engine)) {
    throw std::invalid_argument("linear program: GLPK is not part of this build");
  }
  const auto start = std::chrono::steady_clock::now();
  LpResult result;
  if (options.engine == LpEngine::kGlpk) {
#ifdef ROTSLAM_WITH_GLPK
    SolveWithGlpk(program, options, result);
#endif
  } else if (options.method == LpMethod::kInteriorPoint) {
    SolveInterior(program, options, result);
  } else {
    SolveSimplex(program, options, result);
  }
  for (std::size_t c = 0; c < result.primal.size(); ++c) {
    result.objective += program.cost[c] * result.primal[c];
  }
  result.seconds = SecondsSince(start);
  return result;
}

}  // namespace rotslam
