#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <pybind11/stl.h>

#include "apps/python/arrays.h"
#include "apps/python/module.h"
#include "rotodom/camera/read_camera.h"
#include "rotodom/sequence/sequence.h"

namespace py = pybind11;
using namespace py::literals;  // NOLINT(google-build-using-namespace): "name"_a

namespace rotslam {
namespace {

// How long `distortion` is: five, as in version 0.1.0, or more where the model has more.
std::size_t NumCoefficients(CameraModel model) {
  return std::max<std::size_t>(5, DistortionNames(model).size());
}

// Ten parameters: the keyword arguments of Python's Camera().
Camera MakeCamera(double fx,
                  double fy,
                  double cx,
                  double cy,
                  int width,
                  int height,
                  const std::string& model,
                  const std::vector<double>& distortion,
                  double readout_s,
                  const std::string& readout_from) {
  Camera camera;
  const auto found = FindCameraModel(model);
  if (!found) {
    throw std::invalid_argument("model is \"" + model + "\", must be one of " + CameraModelNames());
  }
  camera.model = *found;
  if (distortion.size() > NumCoefficients(camera.model)) {
    throw std::invalid_argument("distortion has " + std::to_string(distortion.size()) +
                                " numbers, must be at most " +
                                std::to_string(NumCoefficients(camera.model)));
  }
  std::copy(distortion.begin(), distortion.end(), camera.distortion.begin());
  camera.fx = fx;
  camera.fy = fy;
  camera.cx = cx;
  camera.cy = cy;
  camera.width = width;
  camera.height = height;
  camera.readout_s = readout_s;
  const auto start = FindReadoutStart(readout_from);
  if (!start) {
    throw std::invalid_argument("readout_from is \"" + readout_from +
                                "\", must be top, bottom, left or right");
  }
  camera.readout_from = *start;
  if (const auto problem = camera.Problem()) throw std::invalid_argument(*problem);
  return camera;
}

Camera ReadCameraFor(const py::object& path,
                     const std::optional<int>& width,
                     const std::optional<int>& height,
                     const std::string& name) {
  if (width.has_value() != height.has_value()) {
    throw std::invalid_argument("width and height go together");
  }
  CameraReference reference = ParseCameraReference(PathOf(path));
  if (!name.empty()) reference.name = name;
  const Camera camera = ReadCamera(reference, {}, {width.value_or(0), height.value_or(0)});
  return width ? MatchToImages(camera, cv::Size(*width, *height)) : camera;
}

}  // namespace

void AddCamera(py::module_& module) {
  py::class_<Camera>(module, "Camera", R"(A calibrated camera: x right, y down, z forward.

Lengths in pixels, pixel centres at integer coordinates. model is "pinhole", "radtan" (OpenCV:
k1 k2 p1 p2 k3), "equidistant" (OpenCV's fisheye: k1 k2 k3 k4), "rational" (OpenCV: k1 k2 p1 p2
k3 k4 k5 k6) or "fov" (w, in radians). distortion holds these; zeros at the end may be left out,
and are filled up to five numbers.
readout_s: rolling shutter, seconds from the first row to the last; 0 for a global one.
readout_from: where its first row is, "top", "bottom", "left" or "right".)")
      .def(py::init(&MakeCamera),
           "fx"_a,
           "fy"_a,
           "cx"_a,
           "cy"_a,
           "width"_a,
           "height"_a,
           "model"_a = "pinhole",
           "distortion"_a = std::vector<double>(),
           "readout_s"_a = 0.0,
           "readout_from"_a = "top")
      .def_readonly("fx", &Camera::fx)
      .def_readonly("fy", &Camera::fy)
      .def_readonly("cx", &Camera::cx)
      .def_readonly("cy", &Camera::cy)
      .def_readonly("width", &Camera::width)
      .def_readonly("height", &Camera::height)
      .def_property_readonly("distortion",
                             [](const Camera& camera) {
                               const auto begin = camera.distortion.begin();
                               return std::vector<double>(begin,
                                                          begin + NumCoefficients(camera.model));
                             })
      .def_readonly("readout_s", &Camera::readout_s)
      .def_property_readonly("readout_from",
                             [](const Camera& camera) { return Name(camera.readout_from); })
      .def_property_readonly("model", [](const Camera& camera) { return Name(camera.model); })
      .def("__repr__",
           [](const Camera& camera) { return "<rotslam.Camera " + Describe(camera) + ">"; });
  module.def("read_camera",
             &ReadCameraFor,
             "path"_a,
             "width"_a = py::none(),
             "height"_a = py::none(),
             "camera"_a = "",
             R"(The camera of a calibration file of any form that `rotslam run` reads.

camera: name of one of several in the file, "cam1" or "P2"; also as "calib.yaml:cam1" in path.
width, height: of the images, for files that do not say; a file that says otherwise is refused.
Raises RuntimeError in one line that names file and key.)");
}

}  // namespace rotslam
