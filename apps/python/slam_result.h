#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>

#include "apps/slam/slam.h"
#include "output/map/ply.h"
#include "output/trajectory/trajectory.h"

namespace rotslam {

/// Images that Python holds as arrays.
class ImageList : public FrameSource {
 public:
  explicit ImageList(std::vector<Frame> frames) : frames_(std::move(frames)) {}

  std::optional<Frame> Next() override;
  void Skip(int count) override;
  void Rewind() override { next_ = 0; }
  int NumFrames() const override { return static_cast<int>(frames_.size()); }
  void Read(const std::set<FrameId>& frames,
            const std::function<void(FrameId, const cv::Mat&)>& take,
            const std::function<void(const std::string&)>& tell) override;

 private:
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

/// A SlamResult as Python sees it, rotslam.Result.
class PyResult {
 public:
  explicit PyResult(const SlamResult& result);

  /// Columns of a TUM trajectory: time, position (1 to 3), quaternion x y z w (4 to 7).
  pybind11::array_t<double> Columns(int first, int count) const;
  pybind11::array_t<double> Points() const;         // [p, 3]
  pybind11::array_t<std::uint8_t> Colours() const;  // [p, 3]
  std::vector<int> Keyframes() const;
  std::vector<std::vector<int>> Components() const;
  std::vector<std::pair<int, int>> Segments() const;
  std::optional<std::string> Failure() const;
  const Camera& camera() const { return map_.camera; }
  pybind11::object Alignment() const;
  bool is_pure_rotation() const { return map_.rotates_throughout; }
  bool interrupted() const { return interrupted_; }
  void WriteTrajectory(const pybind11::object& path) const;
  void WriteCloud(const pybind11::object& path) const;
  std::string Describe() const;

 private:
  MapResult map_;
  bool interrupted_;
  Trajectory trajectory_;
  std::vector<CloudPoint> cloud_;
};

}  // namespace rotslam
