#!/usr/bin/env bash
# Makes build/package/rotslam_VERSION_ARCH.deb for the Debian that it runs on: installs what is missing, builds Release
# without tests, packs, and asks lintian where it is installed. Afterwards: apt install ./build/package/rotslam_*.deb
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/install_packages.sh --package

if command -v ccache >/dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER:-ccache}
fi
cmake --preset package >/dev/null
cmake --build --preset package
rm -f build/package/rotslam_*.deb
umask 022  # the folders in the package
cpack --preset package
if command -v lintian >/dev/null; then
  lintian --fail-on error --allow-root build/package/rotslam_*.deb
fi
