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

std::string PoseGraphText(const RotationList& list, const AveragedGraph& averaged) {
  std::string text;
  const std::vector<std::string> ids = NumbersOf(list);
  for (std::size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] != list.ids[k]) text += "# " + ids[k] + " is " + list.ids[k] + '\n';
  }
  const RotationMap& cam_from_world = averaged.cam_from_world;
  const auto center_of = [&](FrameId view) {
    const auto found = averaged.center_in_world.find(view);
    return found == averaged.center_in_world.end() ? Eigen::Vector3d::Zero().eval() : found->second;
  };
  for (const auto& [view, rotation] : cam_from_world) {
    text += "VERTEX_SE3:QUAT " + ids[view.value];
    for (const double value : center_of(view)) Append(text, value);
    AppendRotation(text, rotation.Inverse());
    text += '\n';
  }
  for (const FrameId view : list.fixed) {
    if (cam_from_world.contains(view)) text += "FIX " + ids[view.value] + '\n';
  }
  for (std::size_t k = 0; k < list.edges.size(); ++k) {
    const RelativeRotation& edge = list.edges[k];
    const auto i_from_world = cam_from_world.find(edge.i);
    if (i_from_world == cam_from_world.end() || !cam_from_world.contains(edge.j)) continue;
    EdgeTranslation translation;
    if (!list.translations.empty()) {
      translation = list.translations[k];
    } else {
      // As WriteG2o: the vertices' translation, which weighs nothing.
      translation.j_in_i = i_from_world->second * (center_of(edge.j) - center_of(edge.i));
      translation.information.setZero();
      translation.information.topLeftCorner<3, 3>().diagonal().setConstant(1e-6);
      translation.information.bottomRightCorner<3, 3>() =
          kInformationFactor * edge.covariance.inverse();
    }
    text += "EDGE_SE3:QUAT " + ids[edge.i.value] + ' ' + ids[edge.j.value];
    for (const double value : translation.j_in_i) Append(text, value);
    AppendRotation(text, edge.j_from_i.Inverse());
    for (int r = 0; r < 6; ++r) {
      for (int c = r; c < 6; ++c) Append(text, translation.information(r, c));
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

RotationMap ReadStartOrientations(const std::filesystem::path& path, const RotationList& list) {
  const std::map<std::string, Rotation> by_id = ReadOrientationLines(ReadRotationGraphInput(path));
  RotationMap cam_from_world;
  for (std::size_t k = 0; k < list.ids.size(); ++k) {
    const auto found = by_id.find(list.ids[k]);
    if (found == by_id.end()) {
      throw std::runtime_error(path.string() + ": has no orientation of view " + list.ids[k]);
    }
    cam_from_world.emplace_hint(cam_from_world.end(), FrameId{static_cast<int>(k)}, found->second);
  }
  return cam_from_world;
}

void WriteRotationList(const std::filesystem::path& path,
                       const RotationList& list,
                       const AveragedGraph& averaged) {
  if (path.extension() == ".g2o") {
    ReplaceFile(path, PoseGraphText(list, averaged));
    return;
  }
  const bool has_sigmas = !averaged.sigma_deg.empty();
  std::string text = "# id qx qy qz qw of cam_from_world";
  text += has_sigmas ? ", sigma_x_deg sigma_y_deg sigma_z_deg\n" : "\n";
  for (const auto& [view, rotation] : averaged.cam_from_world) {
    text += list.ids[view.value];
    AppendRotation(text, rotation);
    if (has_sigmas) {
      const auto sigma = averaged.sigma_deg.find(view);
      for (int axis = 0; axis < 3; ++axis) {
        text += sigma == averaged.sigma_deg.end() ? " nan"
                                                  : ' ' + FormatNumber("%.6g", sigma->second[axis]);
      }
    }
    text += '\n';
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
