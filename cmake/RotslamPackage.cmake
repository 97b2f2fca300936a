# `cpack` makes rotslam_VERSION_ARCH.deb: the program, libraries and headers, find_package(rotslam), the Python module, the
# manual page, the completion and config/. The preset `package` sets the folders of Debian; scripts/package.sh does all.
set(ROTSLAM_PACKAGE_CONTACT "the rotslam authors <rotslam@users.noreply.github.com>" CACHE STRING
  "Who answers for the package: its field Maintainer")

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME rotslam)
set(CPACK_PACKAGE_CONTACT "${ROTSLAM_PACKAGE_CONTACT}")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "camera path and 3-D map from one video, rotations first")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "rotslam recovers a camera's path and a sparse, coloured 3-D map from one
video. It finds orientations first, from 2-D matches alone, so that it does
not lose track when the camera only rotates. Positions and points follow by
quasi-convex optimisation with known rotations, and bundle adjustment refines
everything.
.
This package has the program, the C++ libraries with their headers, and the
Python module. The recommended packages are for building against them.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

# What find_package(rotslam) looks for.
set(development
  libceres-dev libeigen3-dev libopencv-dev libpcl-dev libsqlite3-dev libtinyxml2-dev libyaml-cpp-dev nlohmann-json3-dev
  coinor-libclp-dev libavcodec-dev libavformat-dev libavutil-dev libswscale-dev libheif-dev libbz2-dev liblz4-dev
  libzstd-dev pkg-config)
list(JOIN development ", " CPACK_DEBIAN_PACKAGE_RECOMMENDS)
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "cmake, g++, ffmpeg")
if(TARGET rotslam_python)
  # The module is for one version of Python, as Debian's own are.
  math(EXPR next_minor "${ROTSLAM_PYTHON_MINOR} + 1")
  set(CPACK_DEBIAN_PACKAGE_DEPENDS
    "python3 (>= 3.${ROTSLAM_PYTHON_MINOR}~), python3 (<< 3.${next_minor}~), python3-numpy")
endif()

# What Debian wants to find below share/doc.
set(documents ${PROJECT_BINARY_DIR}/package)
string(TIMESTAMP today "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(CONFIGURE OUTPUT ${documents}/changelog @ONLY CONTENT [[
rotslam (@PROJECT_VERSION@) unstable; urgency=medium

  * Built with cpack; CHANGELOG.md beside this file has what has changed.

 -- @ROTSLAM_PACKAGE_CONTACT@  @today@
]])
file(ARCHIVE_CREATE OUTPUT ${documents}/changelog.gz PATHS ${documents}/changelog FORMAT raw COMPRESSION GZip
  COMPRESSION_LEVEL 9)
install(FILES ${documents}/changelog.gz ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_SOURCE_DIR}/CITATION.cff
  ${PROJECT_SOURCE_DIR}/cmake/package/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/rotslam)

include(CPack)
