#pragma once

#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace rotslam {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// min cost^T x  subject to  row_lower <= A x <= row_upper,  column_lower <= x <= column_upper.
/// A is sparse and kept by columns; +-kInfinity marks a missing bound.
struct LinearProgram {
  std::vector<double> row_lower;
  std::vector<double> row_upper;
  std::vector<double> cost;
  std::vector<double> column_lower;
  std::vector<double> column_upper;
  std::vector<int> column_start = {0};  // column c has entries column_start[c] .. [c + 1]
  std::vector<int> row_index;
  std::vector<double> value;

  int num_rows() const { return static_cast<int>(row_lower.size()); }
  int num_columns() const { return static_cast<int>(cost.size()); }

  void AddRow(double lower, double upper);
  /// Entries are (row, value) pairs; rows must exist when the program is solved.
  void AddColumn(double column_cost,
                 double lower,
                 double upper,
                 std::span<const std::pair<int, double>> entries);
  /// The first thing that makes this no linear program; nullopt-like empty string when all is well.
  std::string Problem() const;
};

/// How the call went, whatever the program is like.
enum class LpCallStatus { kNotRun, kCompleted, kFailed };
/// The engine's verdict on the program. It is a claim: whoever needs a proof checks it.
enum class LpModelStatus { kUnknown, kOptimal, kInfeasible, kUnbounded, kIterationLimit };

enum class LpMethod { kInteriorPoint, kDualSimplex };
// CLP is always there. GLPK is the independent second opinion, some 5 to 50 times slower; it is
// GPL, and a build may leave it out.
enum class LpEngine { kClp, kGlpk };

/// The engine for a linear program, its method and its limits.
struct LpOptions {
  LpEngine engine = LpEngine::kClp;
  // Interior point: ends with a point inside the optimal face, without clean-up by simplex. Made
  // for programs whose A D A^T is sparse. Dual simplex: exact vertices, for small programs.
  LpMethod method = LpMethod::kInteriorPoint;
  // Interior-point steps, or thousands of simplex pivots. Programs take 15 to 60 steps; those that
  // take more stall. GLPK's interior point stops when it likes.
  int max_iterations = 80;
};

struct LpResult {
  LpCallStatus call = LpCallStatus::kNotRun;
  LpModelStatus model = LpModelStatus::kUnknown;
  double objective = 0.0;
  std::vector<double> primal;    // x
  std::vector<double> row_dual;  // d objective / d right-hand side of each row
  int iterations = 0;
  double seconds = 0.0;
};

}  // namespace rotslam
