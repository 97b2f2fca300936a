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

// The inverse of the rotation's block in the upper triangle of a 6x6 information.
Eigen::Matrix3d TakeCovariance(GraphLine& line) {
  for (int k = 0; k < 15; ++k) line.Number();
  Eigen::Matrix3d information;
  for (int r = 0; r < 3; ++r) {
    for (int c = r; c < 3; ++c) information(r, c) = information(c, r) = line.Number();
  }
  const Eigen::LLT<Eigen::Matrix3d> cholesky(information);
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
  const auto number_in = [&](auto value) -> std::optional<std::string> {
    const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
    const auto [stop, code] = std::from_chars(begin, word.data() + word.size(), value);
    if (code != std::errc() || stop != word.data() + word.size()) return std::nullopt;
    return std::to_string(value);
  };
  std::optional<std::string> id = number_in(std::uint64_t{0});
  if (!id) id = number_in(std::int64_t{0});
  if (!id) Fail("expected a vertex id, a whole number, found \"" + std::string(word) + "\"");
  return *id;
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

void RotationGraphBuilder::Skip(const GraphLine& line, std::string_view tag) {
  constexpr std::size_t kMaxTags = 20;
  constexpr std::size_t kMaxTagLength = 40;
  std::string name(tag.substr(0, kMaxTagLength));
  if (skipped_.size() >= kMaxTags && !skipped_.contains(name)) name = "others";
  Skipped& skipped = skipped_[name];
  if (skipped.count++ == 0) skipped.first_line = line.number();
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
  std::string tags;
  for (const auto& [tag, skipped] : skipped_) {
    const std::string text = std::to_string(skipped.count) + " line" +
                             (skipped.count == 1 ? "" : "s") + " of \"" + tag + "\"";
    Note(text + " not used, the first in line " + std::to_string(skipped.first_line));
    tags += (tags.empty() ? "; found " : ", ") + text;
  }
  if (list_.edges.empty()) {
    throw std::runtime_error(path_.string() +
                             ": has no edges: neither EDGE_SE3:QUAT, nor EDGE3, nor lines with two "
                             "ids and a rotation" +
                             tags);
  }
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
    } else if (tag == "VERTEX3") {
      take_vertex(line, TakeRollPitchYaw);
    } else if (tag == "EDGE_SE3:QUAT" || tag == "EDGE3") {
      const bool is_g2o = tag == "EDGE_SE3:QUAT";
      const std::string i = line.Id();
      const std::string j = line.Id();
      TakeVector(line);
      const Rotation i_from_j = is_g2o ? TakeQuaternion(line) : TakeRollPitchYaw(line);
      Eigen::Matrix3d covariance = isotropic;
      if (is_g2o) {
        covariance = kReadInformationFactor * TakeCovariance(line);
      } else if (!line.AtEnd()) {
        covariance = TakeCovariance(line);
      }
      builder.AddEdge(line, i, j, i_from_j.Inverse(), covariance);
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

}  // namespace rotslam
