#include "output/rotation_list.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "output/atomic_file.h"
#include "output/unit_length.h"
#include "rotodom/types/text_file.h"

namespace rotslam {
namespace {

// Of the rotation vector per that of the quaternion's vector part, see g2o.h.
constexpr double kInformationFactor = 4.0;
constexpr std::string_view kBlanks = " \t\r,";

// The words of one line, taken one by one.
class Line {
 public:
  Line(const std::filesystem::path& path, int number, std::string_view text)
      : path_(&path), number_(number), rest_(text) {
    Skip();
  }
  bool AtEnd() const { return rest_.empty(); }
  bool IsComment() const { return rest_.front() == '#'; }
  std::string_view Word() {
    if (AtEnd()) Fail("the line ends too early");
    const std::string_view word = rest_.substr(0, rest_.find_first_of(kBlanks));
    rest_.remove_prefix(word.size());
    Skip();
    return word;
  }
  double Number() {
    const std::string_view word = Word();
    const std::optional<double> value = NumberIn(word);
    if (!value) Fail("expected a finite number, found \"" + std::string(word) + "\"");
    return *value;
  }
  std::uint64_t Id() {
    const std::string_view word = Word();
    std::uint64_t value = 0;
    const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc() || stop != word.data() + word.size()) {
      Fail("expected a vertex id, found \"" + std::string(word) + "\"");
    }
    return value;
  }
  [[noreturn]] void Fail(const std::string& reason) const {
    throw std::runtime_error(AtLine(*path_, number_, reason));
  }

 private:
  void Skip() { rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks), rest_.size())); }
  static std::optional<double> NumberIn(std::string_view word) {
    if (word.front() == '+') word.remove_prefix(1);
    double value = 0.0;
    const auto [stop, code] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (code != std::errc() || stop != word.data() + word.size() || !std::isfinite(value)) {
      return std::nullopt;
    }
    return value;
  }

  const std::filesystem::path* path_;
  int number_;
  std::string_view rest_;
};

Eigen::Vector3d TakeVector(Line& line) {
  const double x = line.Number();
  const double y = line.Number();
  return {x, y, line.Number()};
}

Rotation TakeQuaternion(Line& line) {
  const Eigen::Vector3d v = TakeVector(line);
  const Eigen::Quaterniond q(line.Number(), v.x(), v.y(), v.z());
  if (!IsUnitLength(q.norm())) line.Fail("the quaternion is not of unit length");
  return Rotation(q);
}

Rotation TakeRollPitchYaw(Line& line) {
  const Eigen::Vector3d angles = TakeVector(line);
  if (!std::isfinite(angles.norm())) line.Fail("an angle is out of range");
  return Rotation::Exp({0.0, 0.0, angles.z()}) * Rotation::Exp({0.0, angles.y(), 0.0}) *
         Rotation::Exp({angles.x(), 0.0, 0.0});
}

// The inverse of the rotation's block in the upper triangle of a 6x6 information.
Eigen::Matrix3d TakeCovariance(Line& line) {
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

struct ReadEdge {
  std::uint64_t i;
  std::uint64_t j;
  Rotation j_from_i;
  Eigen::Matrix3d covariance;
};
struct ReadVertex {
  std::uint64_t id;
  Rotation cam_from_world;
  Eigen::Vector3d center_in_world;
};
struct ReadLines {
  std::vector<ReadEdge> edges;
  std::vector<ReadVertex> vertices;
  std::vector<std::uint64_t> fixed;
  bool is_pose_graph = false;
};

// A line with an id in front: i j and a quaternion or a matrix.
ReadEdge TakePlainEdge(Line& line, double sigma_rad) {
  ReadEdge edge;
  edge.i = line.Id();
  edge.j = line.Id();
  edge.covariance = sigma_rad * sigma_rad * Eigen::Matrix3d::Identity();
  std::array<double, 9> numbers;
  std::size_t count = 0;
  while (!line.AtEnd() && count < numbers.size()) numbers[count++] = line.Number();
  if (count == 4) {
    const Eigen::Quaterniond q(numbers[3], numbers[0], numbers[1], numbers[2]);
    if (!IsUnitLength(q.norm())) line.Fail("the quaternion is not of unit length");
    edge.j_from_i = Rotation(q);
  } else if (count == 9) {
    const Eigen::Matrix3d R =
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
    if (R.determinant() < 0.0 ||
        (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > kMaxLengthError) {
      line.Fail("the nine numbers are no rotation matrix");
    }
    edge.j_from_i = Rotation(Eigen::Quaterniond(R));
  } else {
    line.Fail("expected i j and a quaternion or the nine numbers of a rotation matrix");
  }
  return edge;
}

ReadVertex TakeVertex(Line& line, Rotation (*take_rotation)(Line&)) {
  ReadVertex vertex;
  vertex.id = line.Id();
  vertex.center_in_world = TakeVector(line);
  vertex.cam_from_world = take_rotation(line).Inverse();
  return vertex;
}

ReadEdge TakePoseEdge(Line& line, Rotation (*take_rotation)(Line&)) {
  ReadEdge edge;
  edge.i = line.Id();
  edge.j = line.Id();
  TakeVector(line);
  edge.j_from_i = take_rotation(line).Inverse();
  return edge;
}

void TakeLine(Line& line, double sigma_rad, ReadLines& lines) {
  Line peek = line;
  const std::string_view tag = peek.Word();
  if (tag.front() >= '0' && tag.front() <= '9') {
    lines.edges.push_back(TakePlainEdge(line, sigma_rad));
    return;
  }
  line = peek;
  if (tag == "VERTEX_SE3:QUAT") {
    lines.vertices.push_back(TakeVertex(line, TakeQuaternion));
  } else if (tag == "VERTEX3") {
    lines.vertices.push_back(TakeVertex(line, TakeRollPitchYaw));
  } else if (tag == "EDGE_SE3:QUAT") {
    lines.edges.push_back(TakePoseEdge(line, TakeQuaternion));
    lines.edges.back().covariance = kInformationFactor * TakeCovariance(line);
  } else if (tag == "EDGE3") {
    lines.edges.push_back(TakePoseEdge(line, TakeRollPitchYaw));
    lines.edges.back().covariance =
        line.AtEnd() ? Eigen::Matrix3d(sigma_rad * sigma_rad * Eigen::Matrix3d::Identity())
                     : TakeCovariance(line);
  } else if (tag == "FIX") {
    while (!line.AtEnd()) lines.fixed.push_back(line.Id());
  } else {
    return;
  }
  lines.is_pose_graph = true;
}

ReadLines TakeLines(const std::filesystem::path& path, double sigma_rad) {
  const std::string text = ReadBytes(path);
  ReadLines lines;
  int number = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    Line line(path, ++number, std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    if (line.AtEnd() || line.IsComment()) continue;
    TakeLine(line, sigma_rad, lines);
    if (!lines.edges.empty() && lines.edges.back().i == lines.edges.back().j) {
      line.Fail("an edge from a view to itself");
    }
  }
  if (lines.edges.empty()) {
    throw std::runtime_error(path.string() +
                             ": has no edges: neither EDGE_SE3:QUAT, nor EDGE3, nor lines with two "
                             "ids and a rotation");
  }
  return lines;
}

std::vector<std::uint64_t> AllIds(const ReadLines& lines) {
  std::vector<std::uint64_t> ids;
  ids.reserve(2 * lines.edges.size() + lines.vertices.size());
  for (const ReadEdge& edge : lines.edges) {
    ids.push_back(edge.i);
    ids.push_back(edge.j);
  }
  for (const ReadVertex& vertex : lines.vertices) ids.push_back(vertex.id);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

void Append(std::string& text, double value) { text += ' ' + FormatNumber("%.12g", value); }

void AppendRotation(std::string& text, const Rotation& rotation) {
  for (const double value : rotation.Quaternion().coeffs()) Append(text, value);
}

std::string PoseGraphText(const RotationList& list, const RotationMap& cam_from_world) {
  std::string text;
  const auto center_of = [&](FrameId view) {
    const auto found = list.center_in_world.find(view);
    return found == list.center_in_world.end() ? Eigen::Vector3d::Zero().eval() : found->second;
  };
  for (const auto& [view, rotation] : cam_from_world) {
    text += "VERTEX_SE3:QUAT " + std::to_string(list.ids[view.value]);
    for (const double value : center_of(view)) Append(text, value);
    AppendRotation(text, rotation.Inverse());
    text += '\n';
  }
  for (const FrameId view : list.fixed) {
    text += "FIX " + std::to_string(list.ids[view.value]) + '\n';
  }
  for (const RelativeRotation& edge : list.edges) {
    text += "EDGE_SE3:QUAT " + std::to_string(list.ids[edge.i.value]) + ' ' +
            std::to_string(list.ids[edge.j.value]);
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
  const ReadLines lines = TakeLines(path, sigma_rad);
  RotationList list;
  list.is_pose_graph = lines.is_pose_graph;
  list.ids = AllIds(lines);
  const auto find = [&](std::uint64_t id) {
    const auto found = std::lower_bound(list.ids.begin(), list.ids.end(), id);
    return found != list.ids.end() && *found == id
               ? std::optional(FrameId{static_cast<int>(found - list.ids.begin())})
               : std::nullopt;
  };
  list.edges.reserve(lines.edges.size());
  for (const ReadEdge& read : lines.edges) {
    RelativeRotation& edge = list.edges.emplace_back();
    edge.i = *find(read.i);
    edge.j = *find(read.j);
    edge.j_from_i = read.j_from_i;
    edge.covariance = read.covariance;
  }
  for (const ReadVertex& vertex : lines.vertices) {
    list.cam_from_world[*find(vertex.id)] = vertex.cam_from_world;
    list.center_in_world[*find(vertex.id)] = vertex.center_in_world;
  }
  for (const std::uint64_t id : lines.fixed) {
    const std::optional<FrameId> view = find(id);
    if (!view || !list.cam_from_world.contains(*view)) {
      throw std::runtime_error(path.string() + ": FIX names " + std::to_string(id) +
                               ", which has no vertex");
    }
    list.fixed.push_back(*view);
  }
  return list;
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
    text += std::to_string(list.ids[view.value]);
    AppendRotation(text, rotation);
    text += '\n';
  }
  ReplaceFile(path, text);
}

}  // namespace rotslam
