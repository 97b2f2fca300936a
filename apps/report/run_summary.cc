#include "apps/report/run_summary.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

bool IsSummary(const Json& json) {
  return json.contains("sequence") && json["sequence"].is_object() &&
         json["sequence"].value("path", Json("")).is_string() && json.contains("camera") &&
         json.value("command", Json("")).is_string() &&
         json.value("interrupted", Json(false)).is_boolean();
}

// Of `options.sequence`.
template <class Number>
Number OptionOf(const Json& summary, const char* name) {
  const auto path = Json::json_pointer(std::string("/options/sequence/") + name);
  const Json value = summary.contains(path) ? summary.at(path) : Json();
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!(std::abs(number) <= std::numeric_limits<int>::max())) {
    throw std::runtime_error(std::string("summary.json: options.sequence.") + name +
                             " is missing or out of range; run the sequence again");
  }
  return static_cast<Number>(number);
}

}  // namespace

std::optional<Json> ReadJsonObject(const std::filesystem::path& path) {
  constexpr int kMaxDepth = 16;
  bool is_deep = false;
  const auto keep = [&](int depth, Json::parse_event_t, const Json&) {
    is_deep = is_deep || depth > kMaxDepth;
    return !is_deep;
  };
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  Json json = Json::parse(file, keep, false);
  if (is_deep || !json.is_object()) return std::nullopt;
  return std::make_optional<Json>(std::move(json));
}

Json ReadSummaryOf(const std::filesystem::path& run) {
  const std::filesystem::path path = run / "summary.json";
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) {
    throw std::runtime_error(path.string() +
                             ": cannot be read; give the folder that `rotslam run` or `rotslam "
                             "rotations` has written to");
  }
  std::optional<Json> summary = ReadJsonObject(path);
  if (!summary || !IsSummary(*summary)) {
    throw std::runtime_error(path.string() + ": is no summary of a run; run the sequence again");
  }
  return *std::move(summary);
}

double SummaryNumber(const Json& summary, const std::string& group, const std::string& key) {
  if (!summary.contains(group) || !summary.at(group).is_object()) return 0.0;
  const Json& values = summary.at(group);
  return values.contains(key) && values.at(key).is_number() ? values.at(key).get<double>() : 0.0;
}

SequenceOptions SequenceOptionsOf(const Json& summary) {
  SequenceOptions options;
  options.first = OptionOf<int>(summary, "first");
  options.last = OptionOf<int>(summary, "last");
  options.stride = OptionOf<int>(summary, "stride");
  options.fps = OptionOf<double>(summary, "fps");
  return options;
}

}  // namespace rotslam
