#include "ba/types/bundle_result.h"

namespace rotslam {

const char* Name(BundleStatus status) {
  switch (status) {
    case BundleStatus::kNotRun:
      return "not run";
    case BundleStatus::kConverged:
      return "converged";
    case BundleStatus::kIterationLimit:
      return "iteration limit";
    case BundleStatus::kTooLittleData:
      return "too little data";
    case BundleStatus::kSolverFailed:
      return "solver failed";
  }
  return "unknown";
}

}  // namespace rotslam
