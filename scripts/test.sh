#!/usr/bin/env bash
# Installs what is missing, builds and passes all tests. Ends with ctest's summary. Arguments go to the configuration:
# `scripts/test.sh -DROTSLAM_WARNINGS_AS_ERRORS=ON` stops at the first warning.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_packages.sh

if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER:-ccache}
fi
cmake --preset dev "$@" >/dev/null
cmake --build --preset dev
ctest --preset dev --parallel "$(nproc)"
