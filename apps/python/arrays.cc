#include "apps/python/arrays.h"

#include <cstdint>
#include <limits>
#include <stdexcept>

namespace py = pybind11;

namespace rotslam {

std::string ShapeOf(const py::array& array) { return py::str(array.attr("shape")); }

[[noreturn]] void RefuseArray(const char* name, const char* expected, const py::array& found) {
  throw std::invalid_argument(std::string(name) + " must be " + expected + ", found " +
                              std::string(py::str(found.dtype())) + " of shape " + ShapeOf(found));
}

DoubleArray Numbers(const char* name,
                    const char* expected,
                    const py::object& object,
                    const std::vector<py::ssize_t>& shape) {
  const py::array array = py::array::ensure(object);
  if (!array) throw std::invalid_argument(std::string(name) + " must be " + expected);
  const char kind = array.dtype().kind();
  bool fits = (kind == 'f' || kind == 'i' || kind == 'u') &&
              array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (py::ssize_t k = 0; fits && k < array.ndim(); ++k) {
    fits = shape[static_cast<std::size_t>(k)] < 0 ||
           shape[static_cast<std::size_t>(k)] == array.shape(k);
  }
  if (!fits) RefuseArray(name, expected, array);
  return DoubleArray::ensure(array);
}

std::vector<int> Indices(const char* name, const py::object& object) {
  constexpr const char* kExpected = "one-dimensional array of integers from 0";
  const py::array array = py::array::ensure(object);
  if (!array) throw std::invalid_argument(std::string(name) + " must be a " + kExpected);
  const char kind = array.dtype().kind();
  if ((kind != 'i' && kind != 'u') || array.ndim() != 1) RefuseArray(name, kExpected, array);
  const auto wide = py::array_t<std::int64_t, py::array::forcecast>::ensure(array);
  std::vector<int> indices;
  indices.reserve(static_cast<std::size_t>(wide.size()));
  for (py::ssize_t k = 0; k < wide.size(); ++k) {
    const std::int64_t index = wide.at(k);
    if (index < 0 || index > std::numeric_limits<int>::max()) {
      throw std::invalid_argument(std::string(name) + " has " + std::to_string(index) + " at " +
                                  std::to_string(k) + ", must be " + kExpected);
    }
    indices.push_back(static_cast<int>(index));
  }
  return indices;
}

cv::Mat ImageFrom(const char* name, const py::object& object, const cv::Size& size) {
  if (object.is_none()) return {};
  constexpr const char* kExpected = "a uint8 array [height, width] or [height, width, 3] (BGR)";
  const py::array image = py::array::ensure(object);
  if (!image) throw std::invalid_argument(std::string(name) + " must be " + kExpected);
  const bool is_grey = image.ndim() == 2;
  const bool is_bgr = image.ndim() == 3 && image.shape(2) == 3;
  if (!(is_grey || is_bgr) || image.dtype().kind() != 'u' || image.itemsize() != 1) {
    RefuseArray(name, kExpected, image);
  }
  if (image.shape(0) != size.height || image.shape(1) != size.width) {
    throw std::invalid_argument(std::string(name) + " must have the camera's size [" +
                                std::to_string(size.height) + ", " + std::to_string(size.width) +
                                "], found " + ShapeOf(image));
  }
  const auto packed = py::array_t<std::uint8_t, py::array::c_style>::ensure(image);
  // The caller may write into the array as soon as the call is over; older images stay in use.
  return cv::Mat(size.height,
                 size.width,
                 is_grey ? CV_8UC1 : CV_8UC3,
                 const_cast<std::uint8_t*>(packed.data()))
      .clone();
}

std::string PathOf(const py::object& path) {
  return py::str(py::module_::import("os").attr("fspath")(path));
}

py::array_t<double> QuaternionOf(const Rotation& cam_from_world) {
  const Eigen::Vector4d xyzw = cam_from_world.Inverse().Quaternion().coeffs();
  return py::array_t<double>(4, xyzw.data());
}

py::array_t<double> PointsOf(const std::vector<Eigen::Vector3d>& points) {
  py::array_t<double> array({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  auto view = array.mutable_unchecked<2>();
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) view(static_cast<py::ssize_t>(k), axis) = points[k][axis];
  }
  return array;
}

}  // namespace rotslam
