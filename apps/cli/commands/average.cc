#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "apps/cli/command.h"
#include "apps/cli/input/config.h"
#include "apps/cli/terminal/progress.h"
#include "output/files/atomic_file.h"
#include "output/graph/rotation_list_file.h"
#include "rotodom/averaging/certificate.h"
#include "rotodom/averaging/global_averaging.h"
#include "rotodom/averaging/support/edge_positions.h"
#include "rotodom/averaging/support/orientation_deviations.h"
#include "rotodom/averaging/support/view_support.h"
#include "rotodom/types/stopwatch.h"

namespace rotslam {
namespace {

// Views with less hang on one edge that nothing confirms, or on none.
constexpr int kConfirmedSupport = 2;

struct AverageFlags {
  CommonFlags common;
  std::string graph;
  std::string out;
  std::string edges;
  std::string nodes;
  std::string start_from;
  double sigma_deg = 1.0;
  int min_support = 0;
  bool use_start = false;
  bool certify = false;
};

std::string Text(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

// The table on standard output, which the log repeats.
class Table {
 public:
  Table(const CommonFlags& flags, Progress& progress)
      : is_shown_(!flags.quiet), is_logged_(!flags.log.empty()), progress_(progress) {}

  void Line(const std::string& line) {
    if (is_shown_) std::printf("%s\n", line.c_str());
    if (is_logged_) progress_.Detail(line);
  }
  void Row(const char* name, const std::string& value, const std::string& meaning) {
    char line[256];
    std::snprintf(line, sizeof(line), "%-14s %14s  %s", name, value.c_str(), meaning.c_str());
    Line(line);
  }

 private:
  bool is_shown_;
  bool is_logged_;
  Progress& progress_;
};

void PrintAngles(std::vector<double> angle_rad, Table& table) {
  std::sort(angle_rad.begin(), angle_rad.end());
  const double last = static_cast<double>(angle_rad.size() - 1);
  const auto at = [&](double share) {
    return Text("%.4f", kDegFromRad * angle_rad[static_cast<std::size_t>(share * last)]);
  };
  table.Row("angle", at(0.5), "deg between edges and result, median");
  table.Row("  90 percent", at(0.9), "deg");
  table.Row("  95 percent", at(0.95), "deg");
  table.Row("  99 percent", at(0.99), "deg");
  table.Row("  largest", at(1.0), "deg");
}

void PrintResult(const GlobalAveragingResult& result,
                 double read_s,
                 double average_s,
                 Table& table) {
  const std::size_t num_edges = result.angle_rad.size();
  table.Row("views", std::to_string(result.cam_from_world.size()), "with an edge");
  table.Row("edges", std::to_string(num_edges), "");
  const int largest =
      *std::max_element(result.component_sizes.begin(), result.component_sizes.end());
  table.Row("components",
            std::to_string(result.component_sizes.size()),
            "the largest has " + std::to_string(largest) + " views");
  PrintAngles(result.angle_rad, table);
  table.Row("inliers",
            Text("%.2f", 100.0 * result.num_inliers / static_cast<double>(num_edges)),
            "% of the edges");
  table.Row("cost", Text("%.8g", result.cost), "robust, in squared standard deviations");
  table.Row("iterations",
            std::to_string(result.iterations),
            result.has_converged ? "converged" : "not converged");
  table.Row("seconds", Text("%.3f", average_s), Text("and %.3f to read", read_s));
}

void PrintCertificate(const AveragingCertificate& certificate, double seconds, Table& table) {
  table.Row("chordal cost",
            Text("%.10g", certificate.cost),
            "of the inliers, least squares, isotropic weights; of what is written");
  table.Row("  bound", Text("%.10g", certificate.cost_bound), "no orientations cost less");
  table.Row("  gap", Text("%.3g", certificate.RelativeGap()), "relative");
  table.Row("  eigenvalue",
            Text("%.3g", certificate.smallest_eigenvalue),
            "the dual matrix' smallest is at least this");
  table.Row("  seconds", Text("%.3f", seconds), "");
}

// Several fixed views of one component hold its orientations where the chordal cost's minimum,
// which is free, need not be.
void CheckCertifiable(const RotationList& list, const GlobalAveragingResult& result) {
  std::vector<int> num_fixed(result.component_sizes.size(), 0);
  for (const FrameId view : list.fixed) {
    const auto component = result.component.find(view);
    if (component == result.component.end()) continue;
    if (++num_fixed[component->second] > 1) {
      throw std::runtime_error(
          "--certify: the graph fixes several views of one component (FIX); the bound is that of a "
          "graph with at most one");
    }
  }
}

// Says what a factorisation costs before the first one.
void ShowCertificate(const CertificateProgress& done, Progress& progress) {
  constexpr double kProductsPerSecond = 5e8;
  constexpr double kBytesPerEntry = 16.0;  // number and row of the factor, and the matrix
  constexpr double kSecondsToSay = 10.0;
  if (done.factorisations > 0) {
    progress.Step(done.factorisations);
    return;
  }
  const double once_s = done.products / kProductsPerSecond;
  if (2.0 * once_s < kSecondsToSay) return;
  progress.Say("certificate: 1 to " + std::to_string(kMaxCertificateFactorisations) +
               " factorisations of about " + Text("%.0f s each", once_s) + " and " +
               Text("%.1f GB", kBytesPerEntry * done.entries / 1e9));
}

// Replaces the orientations by those that are certified. Weights of the inliers are one by their
// mean variance.
AveragingCertificate Certify(const RotationList& list,
                             const GlobalAveragingOptions& options,
                             Progress& progress,
                             GlobalAveragingResult& result) {
  CheckCertifiable(list, result);
  progress.StartStage("certificate", kMaxCertificateFactorisations);
  std::vector<double> weights(list.edges.size(), 0.0);
  for (std::size_t k = 0; k < weights.size(); ++k) {
    if (result.sigmas[k] > options.loss_sigmas) continue;
    weights[k] = 3.0 / list.edges[k].covariance.trace();
  }
  AveragingCertificate certificate = CertifyAveraging(
      list.edges, weights, result.cam_from_world, [&](const CertificateProgress& done) {
        ShowCertificate(done, progress);
      });
  // The fixed view, or the first one, of every component stays.
  std::vector<FrameId> reference(result.component_sizes.size());
  for (const auto& [view, component] : result.component) {
    if (reference[component].value < 0) reference[component] = view;
  }
  for (const FrameId view : list.fixed) {
    const auto component = result.component.find(view);
    if (component != result.component.end()) reference[component->second] = view;
  }
  std::vector<Rotation> world_from_before;
  world_from_before.reserve(reference.size());
  for (const FrameId view : reference) {
    world_from_before.push_back(certificate.cam_from_world.at(view).Inverse() *
                                result.cam_from_world.at(view));
  }
  for (auto& [view, cam_from_world] : result.cam_from_world) {
    cam_from_world =
        certificate.cam_from_world.at(view) * world_from_before[result.component.at(view)];
  }
  ReportEdges(list.edges, options, result);
  progress.EndStage("gap " + Text("%.3g", certificate.RelativeGap()));
  return certificate;
}

// How well the edges support each view.
struct Nodes {
  std::map<FrameId, int> support;
  std::map<FrameId, Eigen::Vector3d> sigma_deg;
  bool is_complete = true;
};

Nodes JudgeNodes(const RotationList& list,
                 const GlobalAveragingOptions& options,
                 const std::set<FrameId>& held_views,
                 const GlobalAveragingResult& result) {
  std::vector<RelativeRotation> edges = list.edges;
  std::vector<char> is_inlier(edges.size(), 0);
  std::vector<double> weights(edges.size(), 0.0);
  for (std::size_t k = 0; k < edges.size(); ++k) {
    edges[k].covariance = ErrorCovariance(edges[k], options);
    is_inlier[k] = result.sigmas[k] <= options.loss_sigmas ? 1 : 0;
    weights[k] = is_inlier[k];
  }
  Nodes nodes;
  nodes.support = SupportOfViews(edges, is_inlier, held_views);
  const OrientationDeviations deviations =
      DeviationsOfViews(edges, weights, result.cam_from_world, held_views);
  nodes.is_complete = deviations.is_complete;
  for (const auto& [view, covariance] : deviations.covariance) {
    nodes.sigma_deg[view] = kDegFromRad * covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  }
  return nodes;
}

void WarnOfWeak(const RotationList& list, const Nodes& nodes, int min_support, Progress& progress) {
  constexpr std::size_t kMaxNamed = 8;
  const int limit = std::max(kConfirmedSupport, min_support);
  std::vector<FrameId> weak;
  for (const auto& [view, support] : nodes.support) {
    if (support < limit) weak.push_back(view);
  }
  if (weak.empty()) return;
  std::string names;
  for (std::size_t k = 0; k < std::min(weak.size(), kMaxNamed); ++k) {
    names += (k == 0 ? "" : ", ") + list.ids[weak[k].value];
  }
  if (weak.size() > kMaxNamed) names += " ...";
  const std::string count = weak.size() == 1
                                ? "view "
                                : std::to_string(weak.size()) + " of the " +
                                      std::to_string(nodes.support.size()) + " views (";
  const std::string end = weak.size() == 1 ? "" : ")";
  if (min_support > 0) {
    progress.Warn(count + names + end + " held by fewer than " + std::to_string(limit) + " edges" +
                  (min_support >= limit ? ": left out" : ""));
    return;
  }
  progress.Warn(count + names + end + (weak.size() == 1 ? " hangs" : " hang") +
                " on at most one edge that no other one confirms: an orientation may be wrong by "
                "any angle; --min-support 2 leaves them out");
}

void WriteEdges(const std::filesystem::path& path,
                const RotationList& list,
                const GlobalAveragingOptions& options,
                const GlobalAveragingResult& result) {
  std::string text = "i,j,residual_deg,residual_sigmas,weight,inlier,component\n";
  const double squared_loss = options.loss_sigmas * options.loss_sigmas;
  for (std::size_t k = 0; k < list.edges.size(); ++k) {
    const double root = squared_loss / (squared_loss + result.sigmas[k] * result.sigmas[k]);
    text += list.ids[list.edges[k].i.value] + "," + list.ids[list.edges[k].j.value] + "," +
            Text("%.9g", kDegFromRad * result.angle_rad[k]) + "," + Text("%.9g", result.sigmas[k]) +
            "," + Text("%.6g", root * root) + "," +
            (result.sigmas[k] <= options.loss_sigmas ? "1" : "0") + "," +
            std::to_string(result.component.at(list.edges[k].i)) + "\n";
  }
  ReplaceFile(path, text);
}

void WriteNodes(const std::filesystem::path& path,
                const RotationList& list,
                const Nodes& nodes,
                const GlobalAveragingResult& result) {
  std::string text = "id,component,support,sigma_x_deg,sigma_y_deg,sigma_z_deg\n";
  for (const auto& [view, support] : nodes.support) {
    text += list.ids[view.value] + "," + std::to_string(result.component.at(view)) + "," +
            std::to_string(support);
    const auto sigma = nodes.sigma_deg.find(view);
    for (int axis = 0; axis < 3; ++axis) {
      text += "," + (sigma == nodes.sigma_deg.end() ? "" : Text("%.6g", sigma->second[axis]));
    }
    text += "\n";
  }
  ReplaceFile(path, text);
}

// Positions that fit the orientations; those of vertices without an edge stay.
CenterMap PositionsFor(const RotationList& list,
                       const GlobalAveragingOptions& options,
                       const std::set<FrameId>& held_views,
                       const GlobalAveragingResult& result) {
  std::vector<Eigen::Vector3d> j_in_i;
  std::vector<double> weights;
  for (std::size_t k = 0; k < list.edges.size(); ++k) {
    const EdgeTranslation& translation = list.translations[k];
    j_in_i.push_back(translation.j_in_i);
    const double weight = translation.information.topLeftCorner<3, 3>().trace() / 3.0;
    const bool is_inlier = result.sigmas[k] <= options.loss_sigmas;
    weights.push_back(is_inlier && std::isfinite(weight) ? std::max(0.0, weight) : 0.0);
  }
  CenterMap centers = FitCenters(
      list.edges, j_in_i, weights, result.cam_from_world, list.center_in_world, held_views);
  centers.insert(list.center_in_world.begin(), list.center_in_world.end());
  return centers;
}

// Seven parameters: every result of the command, once it has all of them.
AveragedGraph ToWrite(const AverageFlags& flags,
                      const RotationList& list,
                      const GlobalAveragingOptions& options,
                      const std::set<FrameId>& held_views,
                      const GlobalAveragingResult& result,
                      const Nodes& nodes,
                      Table& table) {
  AveragedGraph averaged;
  averaged.cam_from_world = result.cam_from_world;
  for (const auto& [view, support] : nodes.support) {
    if (support < flags.min_support) averaged.cam_from_world.erase(view);
  }
  // Vertices without an edge stay as they were.
  if (flags.min_support == 0) {
    averaged.cam_from_world.insert(list.cam_from_world.begin(), list.cam_from_world.end());
  }
  averaged.sigma_deg = nodes.sigma_deg;
  if (std::filesystem::path(flags.out).extension() != ".g2o") return averaged;
  if (list.translations.empty()) {
    table.Line("note: the graph's edges have no translations: all positions in " + flags.out +
               " are zero");
    return averaged;
  }
  averaged.center_in_world = PositionsFor(list, options, held_views, result);
  table.Line("note: positions in " + flags.out +
             " are the least squares of the inliers' translations, with these orientations");
  return averaged;
}

GlobalAveragingProblem ProblemOf(const AverageFlags& flags, const RotationList& list) {
  GlobalAveragingProblem problem;
  problem.edges = list.edges;
  problem.cam_from_world = list.cam_from_world;
  problem.held_views.insert(list.fixed.begin(), list.fixed.end());
  problem.use_start = flags.use_start;
  if (!flags.start_from.empty()) {
    // Fixed views stay as the graph has them.
    RotationMap start = ReadStartOrientations(flags.start_from, list);
    for (const FrameId view : list.fixed) start[view] = list.cam_from_world.at(view);
    problem.cam_from_world = std::move(start);
    problem.use_start = true;
  } else if (flags.use_start && list.cam_from_world.size() < list.ids.size()) {
    throw std::runtime_error(flags.graph +
                             ": --start: not every view has a vertex there; --start-from names a "
                             "file with orientations");
  }
  return problem;
}

int Average(const AverageFlags& flags) {
  Progress progress(flags.common);
  Table table(flags.common, progress);
  GlobalAveragingOptions options;
  if (!flags.common.config.empty()) LoadOptionsYaml(flags.common.config, options);
  options.seed = flags.common.seed;
  const auto start = std::chrono::steady_clock::now();
  const RotationList list = ReadRotationList(flags.graph, flags.sigma_deg * kRadFromDeg);
  const double read_s = SecondsSince(start);
  if (!list.unread.empty()) progress.Warn(flags.graph + ": not read: " + list.unread);

  const GlobalAveragingProblem problem = ProblemOf(flags, list);
  const auto averaging_start = std::chrono::steady_clock::now();
  GlobalAveragingResult result = AverageGlobally(problem, options, flags.common.NumThreads());
  const double average_s = SecondsSince(averaging_start);
  table.Row("form", list.form, "");
  for (const std::string& note : list.notes) table.Line("note: " + note);
  PrintResult(result, read_s, average_s, table);
  if (flags.certify) {
    const auto certificate_start = std::chrono::steady_clock::now();
    const AveragingCertificate certificate = Certify(list, options, progress, result);
    PrintCertificate(certificate, SecondsSince(certificate_start), table);
  }

  const Nodes nodes = JudgeNodes(list, options, problem.held_views, result);
  const AveragedGraph averaged =
      ToWrite(flags, list, options, problem.held_views, result, nodes, table);
  WriteRotationList(flags.out, list, averaged);
  if (!flags.edges.empty()) WriteEdges(flags.edges, list, options, result);
  if (!flags.nodes.empty()) WriteNodes(flags.nodes, list, nodes, result);
  if (!nodes.is_complete) {
    table.Line(
        "note: the graph is too large for its covariance: deviations are those from a view's own "
        "edges, the true ones are larger");
  }
  WarnOfWeak(list, nodes, flags.min_support, progress);
  return 0;
}

}  // namespace

void AddAverageCommand(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<AverageFlags>();
  CLI::App* command = app.add_subcommand(
      "average", "Orientations that agree best with a graph of relative rotations, wrong ones too");
  command
      ->add_option("graph",
                   flags->graph,
                   "g2o (EDGE_SE3:QUAT, FIX) or TORO (EDGE3) pose graph, or lines "
                   "'i j qx qy qz qw [sigma_deg]' or 'i j' and a 3x3 matrix by rows: x_j = R x_i")
      ->required();
  command
      ->add_option("--out",
                   flags->out,
                   "Result: a pose graph (.g2o) or lines 'id qx qy qz qw' and three deviations in "
                   "deg, camera from world")
      ->required();
  command
      ->add_option("--sigma",
                   flags->sigma_deg,
                   "Standard deviation of edges whose lines say none, deg (default: 1)")
      ->check(AboveZero());
  command->add_flag("--start", flags->use_start, "Start from the graph's vertices");
  command->add_option(
      "--start-from",
      flags->start_from,
      "Start from the orientations of another file: a pose graph's, or lines 'id qx qy qz qw'");
  command->add_option(
      "--edges", flags->edges, "CSV of all edges: residual, weight, inlier, component");
  command->add_option("--nodes", flags->nodes, "CSV of all views: component, support, deviations");
  command
      ->add_option("--min-support",
                   flags->min_support,
                   "Leave out views that fewer agreeing edges hold (2: those on a single one)")
      ->check(AtLeastZero());
  command->add_flag("--certify",
                    flags->certify,
                    "Write the least squares of the inliers, and bound the distance of its cost "
                    "from its minimum");
  AddCommonFlags(*command, flags->common);
  command->footer("Example: rotslam average sphere2500.g2o --out averaged.g2o --certify");
  command->callback([flags, &action] { action = [flags] { return Average(*flags); }; });
}

}  // namespace rotslam
