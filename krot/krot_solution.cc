#include "krot/krot_solution.h"

namespace rotslam {

std::string ToString(KrotStatus status) {
  switch (status) {
    case KrotStatus::kNotRun:
      return "not_run";
    case KrotStatus::kConverged:
      return "converged";
    case KrotStatus::kIterationLimit:
      return "iteration_limit";
    case KrotStatus::kCancelled:
      return "cancelled";
    case KrotStatus::kContradiction:
      return "contradiction";
    case KrotStatus::kInfeasible:
      return "infeasible";
    case KrotStatus::kSolverFailed:
      return "solver_failed";
  }
  return "unknown";
}

std::string ToString(RemovalReason reason) {
  switch (reason) {
    case RemovalReason::kNotFinite:
      return "not_finite";
    case RemovalReason::kDuplicate:
      return "duplicate";
    case RemovalReason::kEpipolar:
      return "epipolar";
    case RemovalReason::kReprojection:
      return "reprojection";
    case RemovalReason::kOtherComponent:
      return "other_component";
  }
  return "unknown";
}

}  // namespace rotslam
