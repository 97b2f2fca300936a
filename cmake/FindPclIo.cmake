# PCL's readers, writers and filters alone. find_package(PCL) would look for VTK, Qt and all that the rest of PCL can use.
# Defines the imported target PclIo::PclIo; also installed, for find_package(rotslam).
find_path(PclIo_INCLUDE_DIR pcl/io/ply_io.h PATH_SUFFIXES pcl-1.15 pcl-1.14 pcl-1.13 pcl-1.12)
find_library(PclIo_LIBRARY pcl_io)
find_library(PclIo_FILTERS_LIBRARY pcl_filters)
find_library(PclIo_SEARCH_LIBRARY pcl_search)
find_library(PclIo_COMMON_LIBRARY pcl_common)
mark_as_advanced(PclIo_INCLUDE_DIR PclIo_LIBRARY PclIo_FILTERS_LIBRARY PclIo_SEARCH_LIBRARY PclIo_COMMON_LIBRARY)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(PclIo
  REQUIRED_VARS PclIo_LIBRARY PclIo_FILTERS_LIBRARY PclIo_SEARCH_LIBRARY PclIo_COMMON_LIBRARY PclIo_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "PCL is in Debian's libpcl-dev")

if(PclIo_FOUND AND NOT TARGET PclIo::PclIo)
  add_library(PclIo::PclIo INTERFACE IMPORTED)
  target_include_directories(PclIo::PclIo SYSTEM INTERFACE ${PclIo_INCLUDE_DIR})
  target_link_libraries(PclIo::PclIo INTERFACE
    ${PclIo_LIBRARY} ${PclIo_FILTERS_LIBRARY} ${PclIo_SEARCH_LIBRARY} ${PclIo_COMMON_LIBRARY} Eigen3::Eigen)
endif()
