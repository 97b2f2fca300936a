# Install tree and find_package(rotslam).
include(CMakePackageConfigHelpers)

get_property(installed_targets GLOBAL PROPERTY ROTSLAM_INSTALLED_TARGETS)
install(TARGETS ${installed_targets} EXPORT rotslamTargets)
install(EXPORT rotslamTargets NAMESPACE rotslam:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/rotslam)
foreach(folder rotodom krot ba output)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/rotslam
    FILES_MATCHING PATTERN "*.h")
endforeach()

file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/rotslamConfig.cmake @ONLY CONTENT [[
include(CMakeFindDependencyMacro)
find_dependency(Eigen3 3.4 NO_MODULE)
find_dependency(Threads)
find_dependency(OpenCV)
find_dependency(yaml-cpp)
find_dependency(Ceres)
include("${CMAKE_CURRENT_LIST_DIR}/rotslamTargets.cmake")
]])
write_basic_package_version_file(${PROJECT_BINARY_DIR}/rotslamConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/rotslamConfig.cmake ${PROJECT_BINARY_DIR}/rotslamConfigVersion.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/rotslam)
