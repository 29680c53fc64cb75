# SPDX-License-Identifier: Apache-2.0
#
# files: the sources of the product below ROOT.
file(GLOB_RECURSE files RELATIVE ${ROOT} ${ROOT}/app/*.h ${ROOT}/app/*.cpp ${ROOT}/calib/*.h
     ${ROOT}/calib/*.cpp ${ROOT}/dynamics/*.h ${ROOT}/dynamics/*.cpp ${ROOT}/kinematics/*.h
     ${ROOT}/kinematics/*.cpp)
if(NOT files)
  message(FATAL_ERROR "no source below ${ROOT}")
endif()
