#include "rotodom/types/archive.h"

#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace rotslam {
namespace {

enum class Colour { kRed, kGreen };

// One of everything.
struct Inner {
  int number = 0;
  std::vector<double> values;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(number, values);
  }
  bool operator==(const Inner&) const = default;
};

struct Everything {
  bool yes = false;
  Colour colour = Colour::kRed;
  double infinite = 0.0;
  std::string text;
  FrameId frame;
  Rotation rotation;
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
  Eigen::MatrixXd matrix;
  Eigen::MatrixXd no_matrix;
  std::vector<Eigen::Matrix2f> matrices;
  std::vector<bool> bits;
  std::vector<Inner> inners;
  std::vector<std::array<int, 2>> pairs;
  std::optional<Inner> something;
  std::optional<int> nothing = 3;
  std::shared_ptr<Inner> shared = std::make_shared<Inner>();
  std::pair<std::string, int> pair;
  std::map<FrameId, Inner> map;

  template <class Archive>
  void Transfer(Archive& archive) {
    archive(yes, colour, infinite, text, frame, rotation, vector, matrix, no_matrix, matrices);
    archive(bits, inners, pairs, something, nothing, shared, pair, map);
  }
};

Everything Filled() {
  Everything filled;
  filled.yes = true;
  filled.colour = Colour::kGreen;
  filled.infinite = -std::numeric_limits<double>::infinity();
  filled.text = std::string("a\0b", 3);
  filled.frame = FrameId{7};
  filled.rotation = Rotation::Exp({0.1, -0.2, 0.3});
  filled.vector = {1.0, 2.0, 1.0 / 3.0};
  filled.matrix = Eigen::MatrixXd::Random(3, 5);
  filled.matrices = {Eigen::Matrix2f::Identity(), Eigen::Matrix2f::Ones()};
  filled.bits = {true, false, true};
  filled.inners = {{1, {0.1}}, {2, {}}};
  filled.pairs = {{1, 2}, {3, 4}};
  filled.something = Inner{3, {0.5, 0.25}};
  filled.nothing.reset();
  *filled.shared = {4, {1e-300}};
  filled.pair = {"pair", 5};
  filled.map = {{FrameId{1}, {6, {}}}, {FrameId{9}, {7, {2.0}}}};
  return filled;
}

std::string BytesOf(Everything everything) {
  ArchiveWriter archive;
  archive(everything);
  return archive.TakeBytes();
}

TEST(Archive, GivesBackEverything) {
  const Everything filled = Filled();
  const std::string bytes = BytesOf(filled);
  Everything read;
  read.map[FrameId{100}] = {};
  ArchiveReader archive(bytes);
  archive(read);
  archive.ExpectEnd();
  EXPECT_EQ(read.yes, filled.yes);
  EXPECT_EQ(read.colour, filled.colour);
  EXPECT_EQ(read.infinite, filled.infinite);
  EXPECT_EQ(read.text, filled.text);
  EXPECT_EQ(read.frame, filled.frame);
  EXPECT_EQ(read.rotation.Quaternion().coeffs(), filled.rotation.Quaternion().coeffs());
  EXPECT_EQ(read.vector, filled.vector);
  EXPECT_EQ(read.matrix, filled.matrix);
  EXPECT_EQ(read.no_matrix.size(), 0);
  EXPECT_EQ(read.matrices, filled.matrices);
  EXPECT_EQ(read.bits, filled.bits);
  EXPECT_EQ(read.inners, filled.inners);
  EXPECT_EQ(read.pairs, filled.pairs);
  EXPECT_EQ(read.something, filled.something);
  EXPECT_EQ(read.nothing, std::nullopt);
  EXPECT_EQ(*read.shared, *filled.shared);
  EXPECT_EQ(read.pair, filled.pair);
  EXPECT_EQ(read.map, filled.map);
  EXPECT_EQ(BytesOf(read), bytes);
}

TEST(Archive, NoticesEveryMissingByteAndMore) {
  const std::string bytes = BytesOf(Filled());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ArchiveReader archive(std::string_view(bytes).substr(0, size));
    Everything read;
    EXPECT_THROW(archive(read), std::runtime_error) << size;
  }
  const std::string more = bytes + "x";
  ArchiveReader archive(more);
  Everything read;
  archive(read);
  EXPECT_THROW(archive.ExpectEnd(), std::runtime_error);
}

template <class Value>
void ExpectRefusedCount(std::size_t count) {
  ArchiveWriter writer;
  writer(count, count);
  const std::string bytes = writer.TakeBytes();
  ArchiveReader reader(bytes);
  Value value;
  EXPECT_THROW(reader(value), std::runtime_error) << count;
}

TEST(Archive, BelievesNoCountThatTheBytesCannotFill) {
  for (const std::size_t count :
       {std::numeric_limits<std::size_t>::max(), std::size_t{1} << 61, std::size_t{1000}}) {
    ExpectRefusedCount<std::string>(count);
    ExpectRefusedCount<std::vector<double>>(count);
    ExpectRefusedCount<std::vector<Inner>>(count);
    ExpectRefusedCount<std::vector<bool>>(count);
    ExpectRefusedCount<std::map<int, int>>(count);
    ExpectRefusedCount<Eigen::MatrixXd>(count);
  }
}

struct Counted {
  static inline int num_made = 0;
  double number = 0.0;

  Counted() { ++num_made; }
  template <class Archive>
  void Transfer(Archive& archive) {
    archive(number);
  }
};

// Each byte could be an element as far as the count knows.
TEST(Archive, MakesNoMoreElementsThanTheBytesFill) {
  ArchiveWriter writer;
  std::size_t count = 5 * sizeof(double);
  writer(count);
  const std::string bytes = writer.TakeBytes() + std::string(count, '\0');
  ArchiveReader reader(bytes);
  std::vector<Counted> read;
  Counted::num_made = 0;
  EXPECT_THROW(reader(read), std::runtime_error);
  EXPECT_EQ(Counted::num_made, 6);
}

}  // namespace
}  // namespace rotslam
