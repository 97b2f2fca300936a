#pragma once

#include <pybind11/pybind11.h>

// The parts of the module: each adds its classes and functions with their docstrings. These are the
// manual; they name the C++ headers that describe the algorithms.

namespace rotslam {

void AddCamera(pybind11::module_& module);
void AddSequence(pybind11::module_& module);
void AddOdometry(pybind11::module_& module);
void AddKnownRotation(pybind11::module_& module);
void AddAveraging(pybind11::module_& module);
void AddBundle(pybind11::module_& module);
void AddReaders(pybind11::module_& module);
void AddMapReaders(pybind11::module_& module);  // after AddCamera
void AddSlam(pybind11::module_& module);
void AddLiveSlam(pybind11::module_& module);  // after AddSlam
void AddEvaluation(pybind11::module_& module);

}  // namespace rotslam
