#include "output/tables/summary.h"

#include <vector>

#include <nlohmann/json.hpp>

#include "output/files/atomic_file.h"

namespace rotslam {
namespace {

using Json = nlohmann::ordered_json;

// The place of a dotted key, made on the way where it does not exist.
Json& At(Json& object, const std::string& key) {
  const std::size_t dot = key.find('.');
  if (dot == std::string::npos) return object[key];
  return At(object[key.substr(0, dot)], key.substr(dot + 1));
}

template <class Variant>
Json ValueToJson(const Variant& value) {
  return std::visit([](const auto& held) { return Json(held); }, value);
}

Json TableToJson(const SummaryTable& table) {
  Json object = Json::object();
  for (const auto& [key, value] : table) At(object, key) = ValueToJson(value);
  return object;
}

Json OptionsToJson(const std::vector<OptionEntry>& options) {
  Json object = Json::object();
  for (const OptionEntry& option : options) At(object, option.key) = ValueToJson(option.value);
  return object;
}

Json CameraToJson(const Camera& camera) {
  Json object = {{"model", Name(camera.model)},
                 {"width", camera.width},
                 {"height", camera.height},
                 {"fx", camera.fx},
                 {"fy", camera.fy},
                 {"cx", camera.cx},
                 {"cy", camera.cy}};
  // Five coefficients for kRadtan and kEquidistant, as in version 0.1.0.
  const std::size_t count =
      camera.model == CameraModel::kEquidistant ? 5 : DistortionNames(camera.model).size();
  if (count > 0) {
    object["distortion"] =
        std::vector<double>(camera.distortion.begin(), camera.distortion.begin() + count);
  }
  if (camera.readout_s != 0.0) {
    object["readout_s"] = camera.readout_s;
    object["readout_from"] = Name(camera.readout_from);
  }
  return object;
}

Json KrotToJson(const SummaryKrot& krot) {
  Json object = {{"status", krot.status},
                 {"gamma_low", krot.gamma_low},
                 {"gamma_high", krot.gamma_high},
                 {"gamma_low_px", krot.gamma_low_px},
                 {"gamma_high_px", krot.gamma_high_px},
                 {"removed", krot.removed}};
  object.update(TableToJson(krot.more));
  return object;
}

Json SegmentsToJson(const std::vector<Segment>& segments) {
  Json list = Json::array();
  for (const Segment& segment : segments) {
    list.push_back({{"first_frame", segment.first_frame},
                    {"last_frame", segment.last_frame},
                    {"kind", segment.kind},
                    {"component", segment.component},
                    {"scale", segment.scale},
                    {"evidence", segment.evidence}});
  }
  return list;
}

}  // namespace

std::string Version() { return ROTSLAM_VERSION; }

std::string SummaryJson(const RunSummary& summary) {
  Json json = {{"version", Version()}};
  json["command"] = summary.command;
  if (summary.interrupted) json["interrupted"] = true;
  json["options"] = OptionsToJson(summary.options);
  json["sequence"] = TableToJson(summary.sequence);
  if (summary.camera) json["camera"] = CameraToJson(*summary.camera);
  if (summary.calibration) json["calibration"] = TableToJson(*summary.calibration);
  if (summary.readout) json["readout"] = TableToJson(*summary.readout);
  if (summary.masks) json["masks"] = TableToJson(*summary.masks);
  if (summary.lens_checks) json["lens_checks"] = TableToJson(*summary.lens_checks);
  json["counts"] = TableToJson(summary.counts);
  json["seconds"] = TableToJson(summary.seconds);
  if (summary.rotodom) json["rotodom"] = TableToJson(*summary.rotodom);
  if (summary.krot) json["krot"] = KrotToJson(*summary.krot);
  if (summary.ba) json["ba"] = TableToJson(*summary.ba);
  if (summary.segments) json["segments"] = SegmentsToJson(*summary.segments);
  if (summary.loops) json["loops"] = TableToJson(*summary.loops);
  // Text from the world (a path) may not be UTF-8: replace, do not throw.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

void WriteSummary(const std::filesystem::path& path, const RunSummary& summary) {
  ReplaceFile(path, SummaryJson(summary));
}

}  // namespace rotslam
