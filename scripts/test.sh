#!/usr/bin/env bash
# Installs what is missing, builds with warnings as errors and passes all tests. Ends with ctest's summary.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_packages.sh

if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER:-ccache}
fi
cmake --preset dev >/dev/null
cmake --build --preset dev
ctest --preset dev --parallel "$(nproc)"
