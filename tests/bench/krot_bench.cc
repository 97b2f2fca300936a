// The known-rotation solver by size: bracket, programs, CPU time and peak memory of our own search,
// beside bisection with CLP over all points and one GLPK program, where those end within minutes.
// Prints a table. Sizes of the street as arguments "views points", repeated; without arguments 10 x
// 200 to 1,000 x 100,000 and the dense orbit.

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "krot/bracket/bisection.h"
#include "krot/lp/lp.h"
#include "krot/structure/minimax_lp.h"
#include "tests/krot/problem_from_scene.h"

namespace rotslam {
namespace {

// Time of this process, which other programs on the machine hardly change.
double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

// Runs `measure` in a process of its own, so that peaks of memory do not add up.
template <class Measure>
void Apart(const Measure& measure) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    measure();
    std::fflush(stdout);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
}

void PrintHeader() {
  std::printf("%-28s %9s %9s %9s %8s %8s %8s %9s %9s\n",
              "scene, method",
              "obs",
              "low px",
              "high px",
              "gap",
              "LPs",
              "points",
              "CPU s",
              "peak MB");
}

void PrintBracket(const std::string& name,
                  const MinimaxProblem& problem,
                  const BisectionOptions& options) {
  constexpr double kFocalPx = 700.0;
  const double start_s = CpuSeconds();
  const BisectionResult result = MinimiseMaxResidual(problem, options);
  std::printf("%-28s %9zu %9.5f %9.5f %8.1e %8d %8d %9.3f %9.0f%s\n",
              name.c_str(),
              problem.observations.size(),
              result.gamma_low * kFocalPx,
              result.gamma_high * kFocalPx,
              (result.gamma_high - result.gamma_low) / result.gamma_high,
              result.num_programs,
              result.num_points_in_programs,
              CpuSeconds() - start_s,
              PeakMegabytes(),
              result.status == BisectionStatus::kConverged ? "" : "  not converged");
}

// One program at the bound `gamma`, by GLPK's interior point.
void PrintGlpk(const std::string& name, const MinimaxProblem& problem, double gamma) {
  if (!HasLpEngine(LpEngine::kGlpk)) return;
  LpOptions options;
  options.engine = LpEngine::kGlpk;
  const double start_s = CpuSeconds();
  const MinimaxLpResult result = SolveFeasibility(problem, gamma, options);
  std::printf("%-28s %9zu %38d %8d %9.3f %9.0f%s\n",
              name.c_str(),
              problem.observations.size(),
              1,
              problem.num_points,
              CpuSeconds() - start_s,
              PeakMegabytes(),
              result.model == LpModelStatus::kOptimal ? "" : "  not solved");
}

struct Limits {
  int max_clp_points = 5000;
  int max_glpk_points = 1000;
};

void Measure(const std::string& name, const SceneOptions& scene, const Limits& limits) {
  Apart([&] {
    const MinimaxProblem problem = ProblemFromScene(MakeScene(scene));
    PrintBracket(name + " 1e-2", problem, {});
  });
  Apart([&] {
    const MinimaxProblem problem = ProblemFromScene(MakeScene(scene));
    BisectionOptions options;
    options.relative_gap = 1e-3;
    PrintBracket(name + " 1e-3", problem, options);
  });
  if (scene.num_points <= limits.max_clp_points) {
    Apart([&] {
      const MinimaxProblem problem = ProblemFromScene(MakeScene(scene));
      BisectionOptions options;
      options.method = BisectionMethod::kPrograms;
      options.max_programs = 40;
      PrintBracket(name + " CLP all", problem, options);
    });
  }
  if (scene.num_points <= limits.max_glpk_points) {
    constexpr double kGamma = 2.0 / 700.0;
    Apart([&] { PrintGlpk(name + " GLPK one", ProblemFromScene(MakeScene(scene)), kGamma); });
  }
}

int MeasureAll(const std::vector<std::pair<int, int>>& sizes, bool with_orbit) {
  PrintHeader();
  for (const auto& [num_views, num_points] : sizes) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const Limits limits = seed == 1 ? Limits{} : Limits{0, 0};
      Measure(std::to_string(num_views) + "x" + std::to_string(num_points) + " #" +
                  std::to_string(seed),
              DrivingOptions(num_views, num_points, seed),
              limits);
    }
  }
  for (std::uint64_t seed = 1; with_orbit && seed <= 10; ++seed) {
    Measure("orbit #" + std::to_string(seed), DenseOrbitOptions(seed), {});
  }
  return 0;
}

}  // namespace
}  // namespace rotslam

int main(int argc, char** argv) {
  std::vector<std::pair<int, int>> sizes;
  for (int k = 1; k + 1 < argc; k += 2) {
    sizes.emplace_back(std::atoi(argv[k]), std::atoi(argv[k + 1]));
  }
  const bool all = sizes.empty();
  if (all) {
    sizes = {
        {10, 200}, {20, 1000}, {50, 2000}, {100, 5000}, {200, 20000}, {500, 30000}, {1000, 100000}};
  }
  return rotslam::MeasureAll(sizes, all);
}
