#include "output/graph/rotation_graph_form.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "output/files/decimal_commas.h"
#include "output/trajectory/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// Of the rotation vector per that of the quaternion's vector part, see g2o.h.
constexpr double kReadInformationFactor = 4.0;
constexpr std::string_view kGraphBlanks = " \t\r,;";

std::optional<double> NumberIn(std::string_view word) {
  if (word.front() == '+') word.remove_prefix(1);
  double value = 0.0;
  const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (code != std::errc() || stop != word.data() + word.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

Eigen::Vector3d TakeVector(GraphLine& line) {
  const double x = line.Number();
  const double y = line.Number();
  return {x, y, line.Number()};
}

Rotation TakeQuaternion(GraphLine& line) { return line.Quaternion(); }

Rotation TakeRollPitchYaw(GraphLine& line) {
  const Eigen::Vector3d angles = TakeVector(line);
  if (!std::isfinite(angles.norm())) line.Fail("an angle is out of range");
  return Rotation::Exp({0.0, 0.0, angles.z()}) * Rotation::Exp({0.0, angles.y(), 0.0}) *
         Rotation::Exp({angles.x(), 0.0, 0.0});
}

// A 6x6 information from its upper triangle.
Eigen::Matrix<double, 6, 6> TakeInformation(GraphLine& line) {
  Eigen::Matrix<double, 6, 6> information;
  for (int r = 0; r < 6; ++r) {
    for (int c = r; c < 6; ++c) information(r, c) = information(c, r) = line.Number();
  }
  return information;
}

// The inverse of the rotation's block.
Eigen::Matrix3d RotationCovariance(const GraphLine& line,
                                   const Eigen::Matrix<double, 6, 6>& information) {
  const Eigen::LLT<Eigen::Matrix3d> cholesky(information.bottomRightCorner<3, 3>());
  if (cholesky.info() != Eigen::Success) {
    line.Fail("the information of the rotation is not positive definite");
  }
  return cholesky.solve(Eigen::Matrix3d::Identity());
}

// Numbers by value, before names by their letters.
bool IsBefore(const std::string& a, const std::string& b) {
  const bool a_is_number = IsWholeNumber(a);
  const bool b_is_number = IsWholeNumber(b);
  if (a_is_number != b_is_number) return a_is_number;
  if (!a_is_number) return a < b;
  const bool a_is_negative = a.front() == '-';
  const bool b_is_negative = b.front() == '-';
  if (a_is_negative != b_is_negative) return a_is_negative;
  if (a_is_negative) return a.size() != b.size() ? a.size() > b.size() : a > b;
  return a.size() != b.size() ? a.size() < b.size() : a < b;
}

}  // namespace

bool IsWholeNumber(std::string_view word) {
  if (word.starts_with('-') || word.starts_with('+')) word.remove_prefix(1);
  return !word.empty() && word.find_first_not_of("0123456789") == std::string_view::npos;
}

bool IsNumberWord(std::string_view word) { return NumberIn(word).has_value(); }

bool IsGraphTag(std::string_view word) {
  return word.starts_with("VERTEX") || word.starts_with("EDGE") || word.starts_with("PARAMS") ||
         word == "FIX";
}

RotationGraphInput ReadRotationGraphInput(const std::filesystem::path& path) {
  RotationGraphInput input;
  input.path = path;
  input.text = ReadText(path);
  if (HasDecimalCommas(input.text)) {
    input.text = WithDecimalPoints(std::move(input.text));
    input.notes.push_back("its commas are taken for decimal points");
  }
  const std::string_view text = input.text;
  for (std::size_t begin = 0; begin < text.size() && input.first_words.empty();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    GraphLine line(path, 1, text.substr(begin, end - begin));
    begin = end + 1;
    if (line.AtEnd() || line.IsComment()) continue;
    while (!line.AtEnd() && input.first_words.size() < 64) {
      input.first_words.emplace_back(line.Word());
    }
    // A header of words.
    const bool is_pose_graph = input.first_words.front().find("EDGE") != std::string::npos ||
                               input.first_words.front().find("VERTEX") != std::string::npos;
    if (!is_pose_graph && input.first_words.size() > 2 &&
        std::none_of(input.first_words.begin(), input.first_words.end(), IsNumberWord)) {
      input.first_words.clear();
    }
  }
  return input;
}

GraphLine::GraphLine(const std::filesystem::path& path, int number, std::string_view text)
    : path_(&path), number_(number), rest_(text) {
  Skip();
}

void GraphLine::Skip() {
  rest_.remove_prefix(std::min(rest_.find_first_not_of(kGraphBlanks), rest_.size()));
}

std::string_view GraphLine::Word() {
  if (AtEnd()) Fail("the line ends too early");
  const std::string_view word = rest_.substr(0, rest_.find_first_of(kGraphBlanks));
  rest_.remove_prefix(word.size());
  Skip();
  return word;
}

double GraphLine::Number() {
  const std::string_view word = Word();
  const std::optional<double> value = NumberIn(word);
  if (!value) Fail("expected a finite number, found \"" + std::string(word) + "\"");
  return *value;
}

std::string GraphLine::Id() {
  const std::string_view word = Word();
  if (!IsWholeNumber(word)) {
    // "0.5" and "nan" are slips rather than names.
    double value = 0.0;
    const std::string_view unsigned_word = word.substr(word.front() == '+' ? 1 : 0);
    const char* const end = unsigned_word.data() + unsigned_word.size();
    if (std::from_chars(unsigned_word.data(), end, value).ptr == end) {
      Fail("expected a view's id, a whole number or a name, found \"" + std::string(word) + "\"");
    }
    return std::string(word);
  }
  const bool is_negative = word.front() == '-';
  std::string_view digits = word.substr(is_negative || word.front() == '+' ? 1 : 0);
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size() - 1));
  return (is_negative && digits != "0" ? "-" : "") + std::string(digits);
}

Rotation GraphLine::Quaternion() {
  const Eigen::Vector3d v = TakeVector(*this);
  const Eigen::Quaterniond q(Number(), v.x(), v.y(), v.z());
  if (!IsUnitLength(q.norm())) Fail("the quaternion is not of unit length");
  return Rotation(q);
}

void GraphLine::Fail(const std::string& reason) const {
  throw std::runtime_error(AtLine(*path_, number_, reason));
}

RotationGraphBuilder::RotationGraphBuilder(const RotationGraphInput& input) : path_(input.path) {
  list_.notes = input.notes;
}

int RotationGraphBuilder::ViewOf(const std::string& id) {
  const auto [entry, is_new] = views_.try_emplace(id, static_cast<int>(list_.ids.size()));
  if (is_new) list_.ids.push_back(id);
  return entry->second;
}

void RotationGraphBuilder::AddEdge(const GraphLine& line,
                                   const std::string& i,
                                   const std::string& j,
                                   const Rotation& j_from_i,
                                   const Eigen::Matrix3d& covariance) {
  if (i == j) line.Fail("an edge from a view to itself");
  RelativeRotation& edge = list_.edges.emplace_back();
  edge.i = FrameId{ViewOf(i)};
  edge.j = FrameId{ViewOf(j)};
  edge.j_from_i = j_from_i;
  edge.covariance = covariance;
}

void RotationGraphBuilder::AddVertex(const std::string& id,
                                     const Rotation& cam_from_world,
                                     const Eigen::Vector3d& center_in_world) {
  const FrameId view{ViewOf(id)};
  list_.cam_from_world[view] = cam_from_world;
  list_.center_in_world[view] = center_in_world;
}

void RotationGraphBuilder::AddTranslation(const EdgeTranslation& translation) {
  list_.translations.push_back(translation);
}

void RotationGraphBuilder::Skip(const GraphLine& line, std::string_view tag) {
  constexpr std::size_t kMaxTags = 20;
  constexpr std::size_t kMaxTagLength = 40;
  constexpr std::size_t kMaxLines = 3;
  std::string name(tag.substr(0, kMaxTagLength));
  if (skipped_.size() >= kMaxTags && !skipped_.contains(name)) name = "others";
  Skipped& skipped = skipped_[name];
  ++skipped.count;
  if (skipped.lines.size() < kMaxLines) skipped.lines.push_back(line.number());
}

// "3 lines of "EDGE_SE2" (12, 13, 14), 9 lines of "NOTE" (1, 2, 3 ...)".
std::string RotationGraphBuilder::UnreadLines() const {
  std::string text;
  for (const auto& [tag, skipped] : skipped_) {
    text += (text.empty() ? "" : ", ") + std::to_string(skipped.count) + " line" +
            (skipped.count == 1 ? "" : "s") + " of \"" + tag + "\" (";
    for (std::size_t k = 0; k < skipped.lines.size(); ++k) {
      text += (k == 0 ? "" : ", ") + std::to_string(skipped.lines[k]);
    }
    text += static_cast<int>(skipped.lines.size()) < skipped.count ? " ...)" : ")";
  }
  return text;
}

void RotationGraphBuilder::ChooseReading(const std::vector<EdgeReading>& readings) {
  if (list_.edges.empty()) return;
  const EdgeChoice choice = ChooseEdgeReading(list_.edges, readings);
  for (RelativeRotation& edge : list_.edges) {
    edge.j_from_i = ReadEdgeAs(edge.j_from_i, readings[choice.reading]);
  }
  Note(choice.note);
}

RotationList RotationGraphBuilder::Finish(const std::string& form) {
  list_.form = form;
  list_.unread = UnreadLines();
  if (list_.edges.empty()) {
    const auto count = [&](const char* tag) {
      const auto found = skipped_.find(tag);
      return found == skipped_.end() ? 0 : found->second.count;
    };
    const int num_plane = count("EDGE_SE2") + count("EDGE2");
    if (num_plane > 0) {
      throw std::runtime_error(path_.string() + ": is a 2-D graph (" + std::to_string(num_plane) +
                               " edges of a pose in the plane); expected 3-D ones: "
                               "EDGE_SE3:QUAT, EDGE3, or lines with two ids and a rotation");
    }
    throw std::runtime_error(path_.string() +
                             ": has no edges: neither EDGE_SE3:QUAT, nor EDGE3, nor lines with two "
                             "ids and a rotation" +
                             (list_.unread.empty() ? "" : "; found " + list_.unread));
  }
  if (list_.translations.size() != list_.edges.size()) list_.translations.clear();
  std::vector<int> order(list_.ids.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = static_cast<int>(k);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    return IsBefore(list_.ids[static_cast<std::size_t>(a)], list_.ids[static_cast<std::size_t>(b)]);
  });
  std::vector<FrameId> place(order.size());
  std::vector<std::string> ids;
  ids.reserve(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    place[static_cast<std::size_t>(order[k])] = FrameId{static_cast<int>(k)};
    ids.push_back(list_.ids[static_cast<std::size_t>(order[k])]);
  }
  for (const std::string& id : fixed_) {
    const auto view = views_.find(id);
    if (view == views_.end() || !list_.cam_from_world.contains(FrameId{view->second})) {
      throw std::runtime_error(path_.string() + ": FIX names " + id + ", which has no vertex");
    }
    list_.fixed.push_back(place[static_cast<std::size_t>(view->second)]);
  }
  list_.ids = std::move(ids);
  for (RelativeRotation& edge : list_.edges) {
    edge.i = place[static_cast<std::size_t>(edge.i.value)];
    edge.j = place[static_cast<std::size_t>(edge.j.value)];
  }
  const auto renumbered = [&](const auto& map) {
    std::remove_cvref_t<decltype(map)> result;
    for (const auto& [view, value] : map)
      result[place[static_cast<std::size_t>(view.value)]] = value;
    return result;
  };
  list_.cam_from_world = renumbered(list_.cam_from_world);
  list_.center_in_world = renumbered(list_.center_in_world);
  return std::move(list_);
}

Rotation RotationOfNine(const GraphLine& line, const std::array<double, 9>& numbers) {
  const Eigen::Matrix3d R =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
  if (R.determinant() < 0.0 ||
      !((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() <= kMaxLengthError)) {
    line.Fail("the nine numbers are no rotation matrix");
  }
  return Rotation(Eigen::Quaterniond(R));
}

RotationList ReadPoseGraphLines(const RotationGraphInput& input,
                                double sigma_rad,
                                const std::string& form) {
  RotationGraphBuilder builder(input);
  const auto take_vertex = [&](GraphLine& line, Rotation (*take_rotation)(GraphLine&)) {
    const std::string id = line.Id();
    const Eigen::Vector3d center_in_world = TakeVector(line);
    builder.AddVertex(id, take_rotation(line).Inverse(), center_in_world);
  };
  const Eigen::Matrix3d isotropic = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  ForEachGraphLine(input, [&](GraphLine& line) {
    const std::string_view tag = line.Word();
    if (tag == "VERTEX_SE3:QUAT") {
      take_vertex(line, TakeQuaternion);
    } else if (tag == "VERTEX3" || tag == "VERTEX_SE3:EULER") {
      take_vertex(line, TakeRollPitchYaw);
    } else if (tag == "EDGE_SE3:QUAT" || tag == "EDGE3" || tag == "EDGE_SE3:EULER") {
      const bool is_g2o = tag == "EDGE_SE3:QUAT";
      const std::string i = line.Id();
      const std::string j = line.Id();
      EdgeTranslation translation;
      translation.j_in_i = TakeVector(line);
      const Rotation i_from_j = is_g2o ? TakeQuaternion(line) : TakeRollPitchYaw(line);
      Eigen::Matrix3d covariance = isotropic;
      if (is_g2o || !line.AtEnd()) {
        translation.information = TakeInformation(line);
        covariance = RotationCovariance(line, translation.information);
      } else {
        translation.information.bottomRightCorner<3, 3>() /= sigma_rad * sigma_rad;
      }
      if (is_g2o) {
        covariance *= kReadInformationFactor;
      } else {
        // Of the quaternion's vector part, half the rotation vector.
        translation.information.topRightCorner<3, 3>() *= 2.0;
        translation.information.bottomLeftCorner<3, 3>() *= 2.0;
        translation.information.bottomRightCorner<3, 3>() *= kReadInformationFactor;
      }
      builder.AddEdge(line, i, j, i_from_j.Inverse(), covariance);
      builder.AddTranslation(translation);
    } else if (tag == "FIX") {
      while (!line.AtEnd()) builder.Fix(line.Id());
    } else {
      builder.Skip(line, tag);
    }
  });
  RotationList list = builder.Finish(form);
  list.is_pose_graph = true;
  return list;
}

std::map<std::string, Rotation> ReadOrientationLines(const RotationGraphInput& input) {
  std::map<std::string, Rotation> cam_from_world;
  const bool is_pose_graph = !input.first_words.empty() && IsGraphTag(input.first_words.front());
  ForEachGraphLine(input, [&](GraphLine& line) {
    if (!is_pose_graph) {
      const std::string id = line.Id();
      cam_from_world[id] = line.Quaternion();
      return;
    }
    const std::string_view tag = line.Word();
    if (!tag.starts_with("VERTEX")) return;
    const bool has_angles = tag == "VERTEX3" || tag == "VERTEX_SE3:EULER";
    if (!has_angles && tag != "VERTEX_SE3:QUAT") return;
    const std::string id = line.Id();
    TakeVector(line);
    cam_from_world[id] = (has_angles ? TakeRollPitchYaw(line) : TakeQuaternion(line)).Inverse();
  });
  return cam_from_world;
}

}  // namespace rotslam
