# SPDX-License-Identifier: Apache-2.0
#
# Rejects two types of one name in one namespace: cmake -DROOT=<source folder> -P one_definition.cmake
# No compiler sees both, the linker keeps the members of either, and the program ends in a crash.
cmake_minimum_required(VERSION 3.25)

include(${CMAKE_CURRENT_LIST_DIR}/source_files.cmake)

set(faults "")
foreach(file IN LISTS files)
  set(place "")
  set(unnamed FALSE)
  file(STRINGS ${ROOT}/${file} lines
       REGEX "^(namespace [^=]*|}  // namespace.*|(struct|class|enum class) [A-Za-z]+[^;]*({.*)?)$")
  foreach(line IN LISTS lines)
    if(line MATCHES "^namespace (kinescope[A-Za-z_:]*) {")
      set(place ${CMAKE_MATCH_1})
    elseif(line MATCHES "^namespace {")
      set(unnamed TRUE)
    elseif(line MATCHES "^}  // namespace kinescope")
      set(place "")
    elseif(line MATCHES "^}  // namespace")
      set(unnamed FALSE)
    elseif(line MATCHES "^(struct|class|enum class) ([A-Za-z0-9]+)( |$)" AND NOT unnamed AND place)
      set(type "${place}::${CMAKE_MATCH_2}")
      if(DEFINED "defined_${type}" AND NOT "${defined_${type}}" STREQUAL file)
        string(APPEND faults "  ${type}: ${defined_${type}} and ${file}\n")
      endif()
      set("defined_${type}" ${file})
    endif()
  endforeach()
endforeach()

if(faults)
  message(FATAL_ERROR "one name for two types:\n${faults}")
endif()
