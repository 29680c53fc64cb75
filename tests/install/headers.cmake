# SPDX-License-Identifier: Apache-2.0
#
# Fails when an installed header includes one that is not installed: cmake -DINCLUDE=<folder> -P headers.cmake
cmake_minimum_required(VERSION 3.25)

file(GLOB_RECURSE headers ${INCLUDE}/*.h)
if(NOT headers)
  message(FATAL_ERROR "no header below ${INCLUDE}")
endif()
set(faults "")
foreach(header IN LISTS headers)
  file(STRINGS ${header} includes REGEX "^[ \t]*#[ \t]*include[ \t]*\"")
  foreach(include IN LISTS includes)
    string(REGEX REPLACE "^[^\"]*\"([^\"]*)\".*$" "\\1" target "${include}")
    if(NOT EXISTS ${INCLUDE}/${target})
      string(APPEND faults "  ${header} includes ${target}\n")
    endif()
  endforeach()
endforeach()
if(faults)
  message(FATAL_ERROR "name these headers in the HEADERS of their folders:\n${faults}")
endif()
