file(REMOVE_RECURSE ${work_dir})

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "failed (${result}): ${command}")
  endif()
endfunction()

run(${CMAKE_COMMAND} --install ${build_dir} --prefix ${work_dir}/prefix)
run(${CMAKE_COMMAND} -S ${consumer_dir} -B ${work_dir}/build -G ${generator}
  -D CMAKE_PREFIX_PATH=${work_dir}/prefix -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS=${flags}
  -D expected_version=${version})
run(${CMAKE_COMMAND} --build ${work_dir}/build)
run(${work_dir}/build/consumer ${work_dir}/trajectory.txt)
run(${work_dir}/prefix/bin/rotslam eval --json ${work_dir}/trajectory.txt ${work_dir}/trajectory.txt)
foreach(file demo.yaml cameras/7scenes.yaml)
  if(NOT EXISTS ${work_dir}/prefix/${data_dir}/rotslam/config/${file})
    message(FATAL_ERROR "config/${file} is not installed")
  endif()
endforeach()
# The vocabulary is in the program, wherever it lies.
run(${work_dir}/prefix/bin/rotslam vocabulary info)

# The Python module, where it was built.
if(python)
  run(${CMAKE_COMMAND} -E env PYTHONPATH=${work_dir}/prefix/${python_dir}
    ${python} -c "import rotslam; assert rotslam.__version__ == '${version}', rotslam.__version__")
endif()

# The examples, on a small rendered sequence.
foreach(example streaming run average known_rotation adjust)
  run(${CMAKE_COMMAND} -S ${examples_dir}/${example} -B ${work_dir}/${example} -G ${generator}
    -D CMAKE_PREFIX_PATH=${work_dir}/prefix -D CMAKE_CXX_COMPILER=${compiler} -D CMAKE_CXX_FLAGS=${flags})
  run(${CMAKE_COMMAND} --build ${work_dir}/${example})
endforeach()
run(${work_dir}/prefix/bin/rotslam simulate handheld --frames 24 --width 320 --height 240 --quiet
  --out ${work_dir}/sequence)

# Eight numbers for each frame.
execute_process(
  COMMAND ${work_dir}/streaming/streaming ${work_dir}/sequence ${work_dir}/sequence/camera.yaml
  OUTPUT_VARIABLE lines RESULT_VARIABLE result)
string(REGEX MATCHALL "\n[0-9.]+ -?[0-9.]+ -?[0-9.]+ -?[0-9.]+ -?[0-9.]+ [0-9.]+ [0-9.]+ [0-9.]+" frames "${lines}")
list(LENGTH frames num_frames)
if(NOT result EQUAL 0 OR NOT num_frames EQUAL 24)
  message(FATAL_ERROR "the streaming example (${result}) printed:\n${lines}")
endif()

# A pose of each frame and a cloud.
run(${work_dir}/run/run ${work_dir}/sequence ${work_dir}/sequence/camera.yaml ${work_dir}/cloud.ply
  ${work_dir}/map_trajectory.txt)
file(STRINGS ${work_dir}/map_trajectory.txt poses REGEX "^[0-9]")
list(LENGTH poses num_poses)
file(STRINGS ${work_dir}/cloud.ply num_points REGEX "^element vertex [1-9][0-9][0-9]")
if(NOT num_poses EQUAL 24 OR NOT num_points)
  message(FATAL_ERROR "the run example has written ${num_poses} poses and \"${num_points}\"")
endif()
run(${work_dir}/prefix/bin/rotslam eval --json ${work_dir}/sequence/groundtruth_tum.txt ${work_dir}/map_trajectory.txt)

# The stages by themselves, on what the program leaves of the same sequence.
run(${work_dir}/prefix/bin/rotslam run ${work_dir}/sequence --out ${work_dir}/program --no-report --quiet)
run(${work_dir}/average/average ${work_dir}/program/view_graph.g2o ${work_dir}/averaged.g2o)
file(STRINGS ${work_dir}/averaged.g2o vertices REGEX "^VERTEX_SE3:QUAT ")
list(LENGTH vertices num_vertices)
if(NOT num_vertices EQUAL 24)
  message(FATAL_ERROR "the average example has written ${num_vertices} vertices")
endif()
execute_process(COMMAND ${work_dir}/known_rotation/known_rotation ${work_dir}/program
  OUTPUT_VARIABLE lines RESULT_VARIABLE result)
string(REGEX MATCHALL "\n[0-9]+ 0 -?[0-9.]+ -?[0-9.]+ -?[0-9.]+" centers "${lines}")
list(LENGTH centers num_centers)
if(NOT result EQUAL 0 OR num_centers LESS 2)
  message(FATAL_ERROR "the known-rotation example (${result}) printed:\n${lines}")
endif()
execute_process(COMMAND ${work_dir}/adjust/adjust ${work_dir}/program 0.05
  OUTPUT_VARIABLE line RESULT_VARIABLE result)
if(NOT result EQUAL 0 OR NOT line MATCHES "^[1-9][0-9]+ observations of [1-9][0-9]+ points, median error 0")
  message(FATAL_ERROR "the adjust example (${result}) printed:\n${line}")
endif()
