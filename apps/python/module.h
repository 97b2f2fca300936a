#pragma once

#include <pybind11/pybind11.h>

// What the module is made of: each adds its classes and functions with their docstrings, which are
// the manual; the algorithms' own are in the C++ headers named there.

namespace rotslam {

void AddCamera(pybind11::module_& module);
void AddSequence(pybind11::module_& module);
void AddOdometry(pybind11::module_& module);
void AddKnownRotation(pybind11::module_& module);
void AddAveraging(pybind11::module_& module);
void AddBundle(pybind11::module_& module);
void AddReaders(pybind11::module_& module);
void AddSlam(pybind11::module_& module);
void AddLiveSlam(pybind11::module_& module);  // after AddSlam
void AddEvaluation(pybind11::module_& module);

}  // namespace rotslam
