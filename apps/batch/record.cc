#include "apps/batch/record.h"

#include <cstring>
#include <fstream>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "apps/cli/input/evaluation.h"
#include "apps/report/run_summary.h"
#include "output/files/atomic_file.h"
#include "output/files/option_list.h"
#include "output/tables/summary.h"
#include "output/trajectory/trajectory.h"
#include "rotodom/sequence/sequence_form.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kRecordFile = "batch.json";
constexpr const char* kReportFile = "report.html";
constexpr const char* kLogFile = "log.txt";

// The place of a dotted key, made on the way where it does not exist.
Json& At(Json& object, const std::string& key) {
  const std::size_t dot = key.find('.');
  if (dot == std::string::npos) return object[key];
  return At(object[key.substr(0, dot)], key.substr(dot + 1));
}

Json OptionsOf(const BatchEntry& entry) {
  Json options = Json::object();
  for (const OptionEntry& option : DescribeOptions(entry.options)) {
    At(options, option.key) =
        std::visit([](const auto& value) { return Json(value); }, option.value);
  }
  return options;
}

// The JSON library would cast a float that no integer can hold.
std::optional<std::int64_t> Integer(const Json& json) {
  return json.is_number_integer() ? std::optional(json.get<std::int64_t>()) : std::nullopt;
}

std::optional<std::int64_t> Count(const Json& summary, const char* name) {
  const Json counts = summary.value("counts", Json::object());
  const auto found = counts.find(name);
  return found == counts.end() ? std::nullopt : Integer(*found);
}

fs::path EstimateOf(const BatchEntry& entry, const fs::path& directory) {
  return directory / (entry.command == "run" ? "trajectory_tum.txt" : "rotations_tum.txt");
}

void AddMetrics(const BatchEntry& entry,
                const fs::path& directory,
                int num_threads,
                BatchResult& result) {
  MatchOptions options;
  options.metrics.num_threads = num_threads;
  options.is_estimate_known = true;
  try {
    const std::optional<fs::path> truth =
        entry.ground_truth.empty()
            ? FindLayout(entry.path, entry.options.sequence).ground_truth_file
            : std::optional<fs::path>(entry.ground_truth);
    if (!truth) return;
    const std::optional<fs::path> times =
        entry.times.empty() ? TimesBeside(*truth) : std::optional<fs::path>(entry.times);
    const Comparison comparison =
        CompareTrajectoryFiles(*truth, EstimateOf(entry, directory), times, options);
    const TrajectoryMetrics& metrics = comparison.metrics;
    if (result.note.empty() && !comparison.notes.empty()) result.note = comparison.notes.back();
    result.coverage = Coverage(metrics, static_cast<int>(result.frames.value_or(0)));
    result.rpe1_deg = metrics.rpe1_deg;
    result.rpen_deg = metrics.rpen_deg;
    result.ate = metrics.ate_m;
  } catch (const std::runtime_error& error) {
    if (result.note.empty()) result.note = error.what();
  }
}

}  // namespace

std::string RequestOf(const BatchEntry& entry, std::uint64_t seed) {
  return Json({{"version", Version()},
               {"command", entry.command},
               {"path", entry.path},
               {"camera", entry.camera},
               {"rotations", entry.rotations},
               {"align", entry.align},
               {"vocabulary", entry.vocabulary},
               {"seed", seed},
               {"options", OptionsOf(entry)}})
      .dump(-1, ' ', false, Json::error_handler_t::replace);  // paths may be no UTF-8
}

std::string OptionsFileOf(const BatchEntry& entry) {
  return OptionsOf(entry).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::optional<BatchRecord> ReadRecord(const fs::path& directory) {
  const std::optional<Json> json = ReadJsonObject(directory / kRecordFile);
  if (!json) return std::nullopt;
  try {
    BatchRecord record;
    record.request = json->at("request").dump();
    record.earlier = {json->value("earlier_cpu_s", 0.0), json->value("earlier_wall_s", 0.0)};
    record.running = {json->value("running_cpu_s", 0.0), json->value("running_wall_s", 0.0)};
    if (json->at("exit_code").is_null()) return record;
    const auto exit_code = Integer(json->at("exit_code"));
    const auto max_memory_kb = Integer(json->at("max_memory_kb"));
    if (!exit_code || !max_memory_kb) return std::nullopt;
    record.end = ChildEnd{static_cast<int>(*exit_code),
                          json->at("cpu_s").get<double>(),
                          json->at("wall_s").get<double>(),
                          *max_memory_kb};
    record.error = json->at("error").get<std::string>();
    return record;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

void WriteRecord(const fs::path& directory, const BatchRecord& record) {
  Json json = {{"exit_code", nullptr}};
  if (record.end) {
    json = {{"exit_code", record.end->exit_code},
            {"error", record.error},
            {"cpu_s", record.end->cpu_s},
            {"wall_s", record.end->wall_s},
            {"max_memory_kb", record.end->max_memory_kb}};
  }
  if (record.earlier.wall_s > 0.0) {
    json["earlier_cpu_s"] = record.earlier.cpu_s;
    json["earlier_wall_s"] = record.earlier.wall_s;
  }
  if (!record.end && record.running.wall_s > 0.0) {
    json["running_cpu_s"] = record.running.cpu_s;
    json["running_wall_s"] = record.running.wall_s;
  }
  json["request"] = Json::parse(record.request);
  // A child may print any bytes.
  ReplaceFile(directory / kRecordFile,
              json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

bool IsFinished(const fs::path& directory, const std::string& request) {
  const std::optional<BatchRecord> record = ReadRecord(directory);
  return record && record->end && record->end->exit_code == 0 && record->request == request &&
         ReadJsonObject(directory / "summary.json").has_value();
}

bool WasInterrupted(const fs::path& directory, const std::string& request) {
  const std::optional<BatchRecord> record = ReadRecord(directory);
  // From 128 on a signal has ended it; Interruption::kExitCode is one of these.
  return record && record->request == request && (!record->end || record->end->exit_code > 128);
}

std::string LastErrorLine(const fs::path& log) {
  const std::string kProgram = "rotslam: ";
  const std::string kWarning = "rotslam: warning: ";
  std::string last;
  std::string error;
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    if (line.empty()) continue;
    if (line.starts_with(kProgram) && !line.starts_with(kWarning)) {
      error = line.substr(kProgram.size());
    }
    last = line;
  }
  return error.empty() ? last : error;
}

std::string ReasonOf(const BatchRecord& record) {
  if (!record.end) return "started, the end is not known";
  const int code = record.end->exit_code;
  if (code == 0) return "";
  const std::string how =
      code > 128 ? "signal " + std::to_string(code - 128) : "exit code " + std::to_string(code);
  return record.error.empty() ? how : how + ": " + record.error;
}

BatchResult ResultOf(const BatchEntry& entry,
                     const fs::path& directory,
                     const std::string& request,
                     int num_threads) {
  BatchResult result;
  result.name = entry.name;
  if (fs::exists(directory / kLogFile)) result.log = entry.name + "/" + kLogFile;
  const std::optional<BatchRecord> record = ReadRecord(directory);
  if (!record) {
    result.status = "not run";
    return result;
  }
  if (record->request != request) {
    result.status = "outdated";
    result.note = "ran with other options, paths or another version";
    return result;
  }
  result.note = ReasonOf(*record);
  if (!record->end) {
    result.status = "unfinished";
    return result;
  }
  result.cpu_s = record->end->cpu_s;
  const std::optional<Json> summary = ReadJsonObject(directory / "summary.json");
  result.status = record->end->exit_code == 0 && summary ? "done" : "failed";
  if (!summary) {
    if (result.note.empty()) result.note = "summary.json is missing or not whole";
    return result;
  }
  if (fs::exists(directory / kReportFile)) result.report = entry.name + "/" + kReportFile;
  result.frames = Count(*summary, "frames");
  result.points = Count(*summary, "points");
  AddMetrics(entry, directory, num_threads, result);
  return result;
}

}  // namespace rotslam
