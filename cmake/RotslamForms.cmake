# rotslam_add_forms(<target> <Type> <folder> <header>)
# Puts the sources of <folder> into a library and makes the table `std::vector<Type>& <Type>s()` of them, which <header>
# declares. A source `orb_slam.cc` defines `<Type> forms::<Type>OrbSlam()`: a new form is a new file, nothing else.
function(rotslam_add_forms target type folder header)
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cc)
  set(declarations "")
  set(calls "")
  foreach(source ${sources})
    cmake_path(GET source STEM LAST_ONLY stem)
    string(REPLACE "_" ";" words ${stem})
    set(function ${type})
    foreach(word ${words})
      string(SUBSTRING ${word} 0 1 first)
      string(TOUPPER ${first} first)
      string(SUBSTRING ${word} 1 -1 rest)
      string(APPEND function ${first}${rest})
    endforeach()
    string(APPEND declarations "${type} ${function}();\n")
    string(APPEND calls "      forms::${function}(),\n")
  endforeach()
  set(table ${CMAKE_CURRENT_BINARY_DIR}/${target}_${type}_table.cc)
  file(CONFIGURE OUTPUT ${table} @ONLY CONTENT [[
// Made by rotslam_add_forms from the files of @folder@.
#include "@header@"

namespace rotslam {
namespace forms {
@declarations@}  // namespace forms

const std::vector<@type@>& @type@s() {
  static const std::vector<@type@> forms = {
@calls@  };
  return forms;
}

}  // namespace rotslam
]])
  target_sources(rotslam_${target} PRIVATE ${sources} ${table})
endfunction()
