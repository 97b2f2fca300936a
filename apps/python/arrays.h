#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <pybind11/numpy.h>

#include "rotodom/types/rotation.h"

// NumPy arrays and what the library takes and gives. What does not fit throws
// std::invalid_argument, which Python sees as ValueError.

namespace rotslam {

using DoubleArray =
    pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

std::string ShapeOf(const pybind11::array& array);

[[noreturn]] void RefuseArray(const char* name, const char* expected, const pybind11::array& found);

/// An array of numbers with these sizes, -1 for any; integers count as numbers, booleans do not.
DoubleArray Numbers(const char* name,
                    const char* expected,
                    const pybind11::object& object,
                    const std::vector<pybind11::ssize_t>& shape);

/// A one-dimensional array of integers from 0.
std::vector<int> Indices(const char* name, const pybind11::object& object);

/// An image as uint8 array, copied; empty for None.
cv::Mat ImageFrom(const char* name, const pybind11::object& object, const cv::Size& size);

/// Of a str or a path object.
std::string PathOf(const pybind11::object& path);

template <class Matrix>
pybind11::array_t<double> ArrayOf(const Matrix& matrix) {
  pybind11::array_t<double> array({matrix.rows(), matrix.cols()});
  auto view = array.mutable_unchecked<2>();
  for (pybind11::ssize_t i = 0; i < matrix.rows(); ++i) {
    for (pybind11::ssize_t j = 0; j < matrix.cols(); ++j) view(i, j) = matrix(i, j);
  }
  return array;
}

/// Camera->world, x y z w, as trajectory files have it.
pybind11::array_t<double> QuaternionOf(const Rotation& cam_from_world);

/// [n, 3].
pybind11::array_t<double> PointsOf(const std::vector<Eigen::Vector3d>& points);

}  // namespace rotslam
