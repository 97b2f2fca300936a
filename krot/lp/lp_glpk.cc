#include "krot/lp/lp_glpk.h"

#include <cmath>
#include <memory>

#include <glpk.h>

namespace rotslam {
namespace {

struct DeleteProblem {
  void operator()(glp_prob* problem) const { glp_delete_prob(problem); }
};

int BoundType(double lower, double upper) {
  if (lower == -kInfinity && upper == kInfinity) return GLP_FR;
  if (lower == -kInfinity) return GLP_UP;
  if (upper == kInfinity) return GLP_LO;
  return lower == upper ? GLP_FX : GLP_DB;
}

// GLPK counts from one.
void Load(const LinearProgram& program, glp_prob* lp) {
  glp_add_rows(lp, program.num_rows());
  for (int r = 0; r < program.num_rows(); ++r) {
    const double lower = program.row_lower[r];
    const double upper = program.row_upper[r];
    glp_set_row_bnds(lp, r + 1, BoundType(lower, upper), lower, upper);
  }
  glp_add_cols(lp, program.num_columns());
  std::vector<int> rows;
  std::vector<double> values;
  for (int c = 0; c < program.num_columns(); ++c) {
    const double lower = program.column_lower[c];
    const double upper = program.column_upper[c];
    glp_set_col_bnds(lp, c + 1, BoundType(lower, upper), lower, upper);
    glp_set_obj_coef(lp, c + 1, program.cost[c]);
    rows.assign(1, 0);
    values.assign(1, 0.0);
    for (int k = program.column_start[c]; k < program.column_start[c + 1]; ++k) {
      rows.push_back(program.row_index[k] + 1);
      values.push_back(program.value[k]);
    }
    glp_set_mat_col(lp, c + 1, static_cast<int>(rows.size()) - 1, rows.data(), values.data());
  }
}

LpModelStatus FromGlpk(int status) {
  switch (status) {
    case GLP_OPT:
      return LpModelStatus::kOptimal;
    case GLP_NOFEAS:
      return LpModelStatus::kInfeasible;
    case GLP_UNBND:
      return LpModelStatus::kUnbounded;
    default:
      return LpModelStatus::kUnknown;
  }
}

template <class Value>
std::vector<double> Values(glp_prob* lp, int count, Value value) {
  std::vector<double> values;
  values.reserve(count);
  for (int k = 1; k <= count; ++k) values.push_back(value(lp, k));
  return values;
}

void ReadBack(bool interior, glp_prob* lp, LpResult& result) {
  const int num_columns = glp_get_num_cols(lp);
  const int num_rows = glp_get_num_rows(lp);
  result.primal = Values(lp, num_columns, interior ? glp_ipt_col_prim : glp_get_col_prim);
  result.row_dual = Values(lp, num_rows, interior ? glp_ipt_row_dual : glp_get_row_dual);
  bool finite = true;
  for (const double x : result.primal) finite = finite && std::isfinite(x);
  for (const double y : result.row_dual) finite = finite && std::isfinite(y);
  result.call = finite ? LpCallStatus::kCompleted : LpCallStatus::kFailed;
}

}  // namespace

void SolveWithGlpk(const LinearProgram& program, const LpOptions& options, LpResult& result) {
  glp_term_out(GLP_OFF);
  const std::unique_ptr<glp_prob, DeleteProblem> lp(glp_create_prob());
  Load(program, lp.get());
  const bool interior = options.method == LpMethod::kInteriorPoint;
  int error = 0;
  if (interior) {
    error = glp_interior(lp.get(), nullptr);
    result.model = FromGlpk(glp_ipt_status(lp.get()));
  } else {
    glp_smcp parameters;
    glp_init_smcp(&parameters);
    parameters.meth = GLP_DUALP;
    parameters.it_lim = 1000 * options.max_iterations;
    error = glp_simplex(lp.get(), &parameters);
    result.model = FromGlpk(glp_get_status(lp.get()));
    result.iterations = glp_get_it_cnt(lp.get());
  }
  if (error == GLP_EITLIM || error == GLP_ENOCVG) result.model = LpModelStatus::kIterationLimit;
  if (error != 0 && result.model != LpModelStatus::kIterationLimit) {
    result.call = LpCallStatus::kFailed;
    return;
  }
  ReadBack(interior, lp.get(), result);
}

}  // namespace rotslam
