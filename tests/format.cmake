# SPDX-License-Identifier: Apache-2.0
#
# Fails when a source file is not as .clang-format has it: cmake -DROOT=<source folder> -P format.cmake
cmake_minimum_required(VERSION 3.25)

# Versions format differently: only this one counts.
find_program(CLANG_FORMAT clang-format-19)
if(NOT CLANG_FORMAT)
  message("SKIPPED: clang-format-19 is not installed")
  return()
endif()

file(GLOB_RECURSE files ${ROOT}/app/*.h ${ROOT}/app/*.cpp ${ROOT}/calib/*.h ${ROOT}/calib/*.cpp
     ${ROOT}/dynamics/*.h ${ROOT}/dynamics/*.cpp ${ROOT}/kinematics/*.h ${ROOT}/kinematics/*.cpp
     ${ROOT}/tests/*.h ${ROOT}/tests/*.cpp)
if(NOT files)
  message(FATAL_ERROR "no source below ${ROOT}")
endif()
execute_process(COMMAND ${CLANG_FORMAT} --style=file --dry-run --Werror ${files}
                RESULT_VARIABLE result ERROR_VARIABLE faults)
if(result)
  message(FATAL_ERROR "run clang-format-19 -i on the files named here\n${faults}")
endif()
