# Build requirements shared by all targets; they ride on targets and set no global flag.

# Warnings for our own code only; third-party headers are SYSTEM. GCC 12 sees overlapping copies in `"text" + string`
# under -O3 (its bug 105651); the stricter builds, whose commands clang-tidy reads, are not affected. From 13 on GCC sees
# uninitialised values in copies of a std::optional that holds a matrix of Eigen; GCC 12, the sanitizers and clang-tidy,
# which .ci/run has, look for those that are ours.
add_library(rotslam_warnings INTERFACE)
add_library(rotslam::warnings ALIAS rotslam_warnings)
target_compile_options(rotslam_warnings INTERFACE
  -Wall -Wextra -Wconversion -Wshadow -Wno-sign-conversion
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<NOT:$<BOOL:${ROTSLAM_WARNINGS_AS_ERRORS}>>>:-Wno-restrict>
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<VERSION_GREATER_EQUAL:$<CXX_COMPILER_VERSION>,13>>:-Wno-maybe-uninitialized>
  $<$<BOOL:${ROTSLAM_WARNINGS_AS_ERRORS}>:-Werror>)

# What makes a memory fault of ours end the program instead of serving whoever found it. Programs are position-independent,
# like the libraries, and their tables of addresses read-only once they run.
add_library(rotslam_hardening INTERFACE)
add_library(rotslam::hardening ALIAS rotslam_hardening)
if(ROTSLAM_HARDENING)
  include(CheckPIESupported)
  check_pie_supported()
  set(CMAKE_POSITION_INDEPENDENT_CODE ON)
  target_compile_options(rotslam_hardening INTERFACE
    "$<$<CONFIG:Release,RelWithDebInfo>:-fstack-protector-strong;-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2>")
  target_link_options(rotslam_hardening INTERFACE "$<$<CONFIG:Release,RelWithDebInfo>:LINKER:-z,relro,-z,now>")
endif()

# x86-64-v2 without AVX: Debian's Eigen-based libraries (OpenGV, PCL, Ceres) are built without it, and Eigen's
# alignment rules change with it.
set(ROTSLAM_ARCH_FLAGS "")
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  set(ROTSLAM_ARCH_FLAGS -msse4.2 -mpopcnt)
endif()

# rotslam_add_library(<name> SOURCES ... [PUBLIC ...] [PRIVATE ...])
# Defines rotslam_<name>, exported as rotslam::<name>; includes carry the folder ("krot/bracket/bisection.h").
function(rotslam_add_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(rotslam_${name} STATIC ${ARG_SOURCES})
  add_library(rotslam::${name} ALIAS rotslam_${name})
  set_target_properties(rotslam_${name} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_compile_features(rotslam_${name} PUBLIC cxx_std_20)
  target_compile_options(rotslam_${name} PRIVATE ${ROTSLAM_ARCH_FLAGS})
  target_include_directories(rotslam_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/rotslam>)
  target_link_libraries(rotslam_${name} PUBLIC ${ARG_PUBLIC}
    PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:rotslam::warnings> $<BUILD_INTERFACE:rotslam::hardening>)
  set_property(GLOBAL APPEND PROPERTY ROTSLAM_INSTALLED_TARGETS rotslam_${name})
endfunction()
