#include "output/graph/rotation_list_file.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include <Eigen/LU>

#include "output/files/atomic_file.h"
#include "output/graph/rotation_graph_form.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// Of the rotation vector per that of the quaternion's vector part, see g2o.h.
constexpr double kInformationFactor = 4.0;

void Append(std::string& text, double value) { text += ' ' + FormatNumber("%.12g", value); }

void AppendRotation(std::string& text, const Rotation& rotation) {
  for (const double value : rotation.Quaternion().coeffs()) Append(text, value);
}

// The file's ids where all are numbers, else numbers from 0 on.
std::vector<std::string> NumbersOf(const RotationList& list) {
  if (std::all_of(list.ids.begin(), list.ids.end(), IsWholeNumber)) return list.ids;
  std::vector<std::string> numbers;
  for (std::size_t k = 0; k < list.ids.size(); ++k) numbers.push_back(std::to_string(k));
  return numbers;
}

std::string PoseGraphText(const RotationList& list, const RotationMap& cam_from_world) {
  std::string text;
  const std::vector<std::string> ids = NumbersOf(list);
  for (std::size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] != list.ids[k]) text += "# " + ids[k] + " is " + list.ids[k] + '\n';
  }
  const auto center_of = [&](FrameId view) {
    const auto found = list.center_in_world.find(view);
    return found == list.center_in_world.end() ? Eigen::Vector3d::Zero().eval() : found->second;
  };
  for (const auto& [view, rotation] : cam_from_world) {
    text += "VERTEX_SE3:QUAT " + ids[view.value];
    for (const double value : center_of(view)) Append(text, value);
    AppendRotation(text, rotation.Inverse());
    text += '\n';
  }
  for (const FrameId view : list.fixed) text += "FIX " + ids[view.value] + '\n';
  for (const RelativeRotation& edge : list.edges) {
    text += "EDGE_SE3:QUAT " + ids[edge.i.value] + ' ' + ids[edge.j.value];
    // As WriteG2o: the vertices' translation, which weighs nothing.
    const Eigen::Vector3d between =
        cam_from_world.at(edge.i) * (center_of(edge.j) - center_of(edge.i));
    for (const double value : between) Append(text, value);
    AppendRotation(text, edge.j_from_i.Inverse());
    const Eigen::Matrix3d information = kInformationFactor * edge.covariance.inverse();
    text += " 1e-06 0 0 0 0 0 1e-06 0 0 0 0 1e-06 0 0 0";
    for (int r = 0; r < 3; ++r) {
      for (int c = r; c < 3; ++c) Append(text, information(r, c));
    }
    text += '\n';
  }
  return text;
}

}  // namespace

RotationList ReadRotationList(const std::filesystem::path& path, double sigma_rad) {
  const RotationGraphInput input = ReadRotationGraphInput(path);
  for (const RotationGraphForm& form : RotationGraphForms()) {
    if (form.recognises(input)) return form.read(input, sigma_rad);
  }
  std::string reason =
      "has no edges: neither EDGE_SE3:QUAT, nor EDGE3, nor lines with two ids and a rotation";
  if (!input.first_words.empty()) {
    reason += "; its first line has " + std::to_string(input.first_words.size()) +
              " words and begins with \"" + input.first_words.front().substr(0, 40) + "\"";
  }
  throw std::runtime_error(path.string() + ": " + reason);
}

std::optional<std::string> RecogniseRotationList(const std::filesystem::path& path) {
  const RotationGraphInput input = ReadRotationGraphInput(path);
  for (const RotationGraphForm& form : RotationGraphForms()) {
    if (form.recognises(input)) return form.name;
  }
  return std::nullopt;
}

void WriteRotationList(const std::filesystem::path& path,
                       const RotationList& list,
                       const RotationMap& cam_from_world) {
  if (path.extension() == ".g2o") {
    ReplaceFile(path, PoseGraphText(list, cam_from_world));
    return;
  }
  std::string text = "# id qx qy qz qw of cam_from_world\n";
  for (const auto& [view, rotation] : cam_from_world) {
    text += list.ids[view.value];
    AppendRotation(text, rotation);
    text += '\n';
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
