# Install tree and find_package(rotslam).
include(CMakePackageConfigHelpers)

get_property(installed_targets GLOBAL PROPERTY ROTSLAM_INSTALLED_TARGETS)
install(TARGETS ${installed_targets} EXPORT rotslamTargets)
install(EXPORT rotslamTargets NAMESPACE rotslam:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/rotslam)
foreach(folder rotodom krot ba output apps/slam)
  cmake_path(GET folder PARENT_PATH parent)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/rotslam/${parent}
    FILES_MATCHING PATTERN "*.h")
endforeach()

# Static libraries: who links them needs what they use, also where no header of ours shows it.
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/rotslamConfig.cmake @ONLY CONTENT [[
include(CMakeFindDependencyMacro)
find_dependency(Eigen3 NO_MODULE)
find_dependency(Threads)
find_dependency(OpenCV 4.5)
find_dependency(yaml-cpp)
find_dependency(Ceres 2.1)
find_dependency(nlohmann_json 3.10)
find_dependency(tinyxml2)
find_dependency(SQLite3)
list(PREPEND CMAKE_MODULE_PATH "${CMAKE_CURRENT_LIST_DIR}")
find_dependency(PclIo)
list(POP_FRONT CMAKE_MODULE_PATH)
find_dependency(PkgConfig)
pkg_check_modules(CLP REQUIRED IMPORTED_TARGET clp)
pkg_check_modules(FFMPEG REQUIRED IMPORTED_TARGET libavformat libavcodec libavutil libswscale)
include("${CMAKE_CURRENT_LIST_DIR}/RotslamPackageNames.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/rotslamTargets.cmake")
]])
write_basic_package_version_file(${PROJECT_BINARY_DIR}/rotslamConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(
  FILES
    ${PROJECT_BINARY_DIR}/rotslamConfig.cmake
    ${PROJECT_BINARY_DIR}/rotslamConfigVersion.cmake
    ${PROJECT_SOURCE_DIR}/cmake/FindPclIo.cmake
    ${PROJECT_SOURCE_DIR}/cmake/RotslamPackageNames.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/rotslam)
