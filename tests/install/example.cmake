# SPDX-License-Identifier: Apache-2.0
#
# Builds the installed example against the installed library, by CMake and by pkg-config, and runs it.
cmake_minimum_required(VERSION 3.25)

include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

file(REMOVE_RECURSE ${SCRATCH})
run(${CMAKE_COMMAND} -S ${PREFIX}/share/kinescope/examples/calibrate -B ${SCRATCH} -G ${GENERATOR}
    -DCMAKE_PREFIX_PATH=${PREFIX} -DCMAKE_BUILD_TYPE=${CONFIG} -DCMAKE_CXX_COMPILER=${COMPILER}
    -DCMAKE_CXX_FLAGS=${FLAGS} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
run(${CMAKE_COMMAND} --build ${SCRATCH} --config ${CONFIG})
run(${SCRATCH}/calibrate ${RECORDING})
set(urdf "${out}")
string(REGEX MATCHALL "type=\"revolute\"" revolute "${urdf}")
string(REGEX MATCHALL "type=\"prismatic\"" prismatic "${urdf}")
list(LENGTH revolute revolutes)
list(LENGTH prismatic prismatics)
if(NOT revolutes EQUAL 3 OR NOT prismatics EQUAL 1)
  message(FATAL_ERROR "${revolutes} revolute and ${prismatics} prismatic joints in place of 3 and 1:\n${urdf}")
endif()

find_program(PKG_CONFIG pkg-config REQUIRED)
set(ENV{PKG_CONFIG_PATH} ${LIBDIR}/pkgconfig)
run(${PKG_CONFIG} --libs kinescope)
separate_arguments(libraries UNIX_COMMAND "${out}")
separate_arguments(FLAGS UNIX_COMMAND "${FLAGS}")
file(GLOB_RECURSE object ${SCRATCH}/calibrate.cpp.o)
run(${COMPILER} ${FLAGS} ${object} ${libraries} -o ${SCRATCH}/calibrate_by_pkg_config)
run(${SCRATCH}/calibrate_by_pkg_config ${RECORDING})
if(NOT out STREQUAL urdf)
  message(FATAL_ERROR "linked by pkg-config the example gives another robot:\n${out}")
endif()
