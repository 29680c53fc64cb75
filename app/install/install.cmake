# SPDX-License-Identifier: Apache-2.0
#
# What `cmake --install` copies, in components: `program` (with manual, completion, schemas and files for clusters), `development`
# (libraries, headers, CMake package, pkg-config files, examples) and, from app/python, `python`.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

install(TARGETS kinescope RUNTIME COMPONENT program)
set(manual ${CMAKE_BINARY_DIR}/manual)  # app/manual writes it
install(DIRECTORY ${manual}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT program)
install(FILES ${manual}/kinescope.bash RENAME kinescope COMPONENT program
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${manual}/_kinescope COMPONENT program
        DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(DIRECTORY app/io/schema DESTINATION ${CMAKE_INSTALL_DATADIR}/kinescope COMPONENT program
        FILES_MATCHING PATTERN *.json)
install(PROGRAMS app/install/cluster/kinescope.slurm DESTINATION ${CMAKE_INSTALL_DATADIR}/kinescope/cluster COMPONENT program)
install(FILES app/install/cluster/Snakefile DESTINATION ${CMAKE_INSTALL_DATADIR}/kinescope/cluster COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)

get_property(rooms GLOBAL PROPERTY KINESCOPE_ROOMS)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/Kinescope)
install(TARGETS ${rooms} EXPORT KinescopeTargets
        ARCHIVE COMPONENT development
        FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/kinescope COMPONENT development)
install(EXPORT KinescopeTargets NAMESPACE kinescope:: DESTINATION ${package_folder} COMPONENT development)
configure_package_config_file(app/install/KinescopeConfig.cmake.in KinescopeConfig.cmake
                              INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/KinescopeConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/KinescopeConfig.cmake
              ${CMAKE_CURRENT_BINARY_DIR}/KinescopeConfigVersion.cmake app/install/third_parties.cmake
        DESTINATION ${package_folder} COMPONENT development)

# An archive stands before those that it needs: the rooms in reverse.
set(kinescope_archives "")
foreach(room IN LISTS rooms)
  string(PREPEND kinescope_archives "-l${room} ")
endforeach()
# Those of kinescope_torque alone.
get_property(below TARGET kinescope_torque PROPERTY LINK_LIBRARIES)
set(torque_rooms kinescope_torque)
while(below)
  list(POP_FRONT below target)
  string(REPLACE "kinescope::" "kinescope_" room "${target}")
  if(room IN_LIST rooms AND NOT room IN_LIST torque_rooms)
    list(APPEND torque_rooms ${room})
    get_property(next TARGET ${room} PROPERTY LINK_LIBRARIES)
    list(APPEND below ${next})
  endif()
endwhile()
set(kinescope_torque_archives "")
foreach(room IN LISTS rooms)
  if(room IN_LIST torque_rooms)
    string(PREPEND kinescope_torque_archives "-l${room} ")
  endif()
endforeach()
# Also where the prefix is moved.
file(RELATIVE_PATH KINESCOPE_PC_TO_PREFIX ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" KINESCOPE_PC_TO_PREFIX "${KINESCOPE_PC_TO_PREFIX}")
set(kinescope_scalapack_library "")
if(KINESCOPE_SCALAPACK)
  set(kinescope_scalapack_library "-lscalapack-openmpi ")
endif()
foreach(package kinescope kinescope_torque)
  configure_file(app/install/${package}.pc.in ${package}.pc @ONLY)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${package}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
          COMPONENT development)
endforeach()
install(DIRECTORY app/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/kinescope COMPONENT development)
