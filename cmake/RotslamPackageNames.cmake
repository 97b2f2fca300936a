# Newer packages have renamed imported targets and warn of the former names. We use the new names; where a package is
# older, they are made here. Included after find_package, also by what is installed.
foreach(names "yaml-cpp::yaml-cpp yaml-cpp" "SQLite3::SQLite3 SQLite::SQLite3")
  separate_arguments(names)
  list(GET names 0 name)
  list(GET names 1 former_name)
  if(NOT TARGET ${name} AND TARGET ${former_name})
    add_library(${name} INTERFACE IMPORTED)
    set_target_properties(${name} PROPERTIES INTERFACE_LINK_LIBRARIES ${former_name})
  endif()
endforeach()
