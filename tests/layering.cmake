# SPDX-License-Identifier: Apache-2.0
#
# Rejects includes that go up: cmake -DROOT=<source folder> -P layering.cmake
# Each line of the table is a room and the rooms it may include beside itself; `house/*` is all rooms of a house.
# No room sees tests/.
cmake_minimum_required(VERSION 3.25)

set(rooms
    "kinematics/core:"
    "kinematics/log: kinematics/core"
    "kinematics/bags: kinematics/core kinematics/log"
    "kinematics/parquet: kinematics/core"
    "kinematics/datasets: kinematics/core kinematics/log kinematics/parquet"
    "kinematics/mat: kinematics/core kinematics/log"
    "kinematics/recorded: kinematics/core kinematics/log kinematics/bags kinematics/datasets kinematics/mat"
    "kinematics/model: kinematics/core"
    "kinematics/structure: kinematics/core kinematics/log kinematics/model"
    "kinematics/urdf: kinematics/core kinematics/log kinematics/model"
    "calib/camera: kinematics/*"
    "calib/vision: kinematics/* calib/camera"
    "calib/tracks: kinematics/* calib/camera"
    "calib/bundle: kinematics/* calib/camera"
    "calib/trace: kinematics/core"
    "calib/effects: kinematics/* calib/camera calib/bundle calib/trace"
    "calib/design: kinematics/* calib/camera calib/bundle calib/trace calib/effects"
    "calib/quality: kinematics/* calib/camera calib/bundle"
    "calib/hand_eye: kinematics/* calib/camera calib/bundle calib/trace"
    "dynamics/data: kinematics/*"
    "dynamics/rigid: kinematics/* dynamics/data"
    "dynamics/gp: kinematics/core"
    "dynamics/identify: kinematics/* dynamics/data dynamics/rigid dynamics/gp"
    "dynamics/models: kinematics/* dynamics/data dynamics/rigid dynamics/gp dynamics/identify"
    "dynamics/effects: kinematics/* calib/trace dynamics/data dynamics/rigid dynamics/gp dynamics/identify"
    "dynamics/contact: kinematics/* dynamics/data dynamics/rigid dynamics/gp dynamics/identify"
    "dynamics/experiments: kinematics/* calib/trace dynamics/data dynamics/rigid dynamics/gp dynamics/identify dynamics/models dynamics/effects dynamics/contact dynamics/simulation dynamics/control"
    "dynamics/simulation: kinematics/* calib/trace dynamics/data dynamics/rigid dynamics/effects"
    "dynamics/control: kinematics/* dynamics/data dynamics/rigid dynamics/gp dynamics/identify dynamics/models dynamics/effects dynamics/contact dynamics/simulation"
    "dynamics/policy: kinematics/* dynamics/data dynamics/rigid dynamics/gp dynamics/identify dynamics/effects dynamics/contact dynamics/simulation dynamics/control"
    "app/config: kinematics/* calib/* dynamics/*"
    "app/io: kinematics/* calib/* dynamics/* app/config"
    "app/report: kinematics/* calib/* dynamics/* app/config"
    "app/experiments: kinematics/* dynamics/* app/report"
    "app/explain: kinematics/* calib/* app/io app/report"
    "app/torque: kinematics/* calib/trace dynamics/* app/io app/report"
    "app/capture: kinematics/* calib/* app/io app/report app/explain"
    "app/commands: kinematics/* calib/* dynamics/* app/config app/io app/report app/experiments app/explain app/torque app/capture"
    "app/manual: kinematics/core app/io app/commands"
    "app/python: kinematics/* calib/camera calib/bundle calib/tracks dynamics/data dynamics/gp dynamics/effects dynamics/models app/io app/report app/explain app/torque app/commands"
    "app/examples: kinematics/* calib/* dynamics/control app/io app/explain"
    "app: app/commands")

# Third parties stop at a room's border: the beginning of an include, and the rooms it is for.
set(third_parties
    "opencv2/: calib/vision"
    "libsvm/: dynamics/models"
    "dlib/: dynamics/models"
    "apriltag: calib/vision"
    "libav: calib/vision"
    "libsw: calib/vision"
    "ceres/: calib/camera calib/vision calib/tracks calib/bundle calib/hand_eye dynamics/identify dynamics/gp"
    "glog/: kinematics/core"
    "cblas: dynamics/gp kinematics/core"
    "urdf_: kinematics/urdf"
    "console_bridge/: kinematics/urdf"
    "tinyxml: kinematics/urdf calib/camera"
    "yaml-cpp/: kinematics/bags calib/camera app/io"
    "openssl/: app/io"
    "zlib.h: kinematics/core kinematics/bags kinematics/mat"
    "zstd.h: kinematics/bags kinematics/parquet"
    "snappy-c.h: kinematics/parquet"
    "lz4frame.h: kinematics/bags"
    "bzlib.h: kinematics/bags"
    "sqlite3.h: kinematics/bags"
    "httplib.h: app/capture"
    "nlohmann/: kinematics/datasets app/io app/report app/capture app/commands dynamics/models"
    "CLI/: app/commands app/manual"
    "pybind11/: app/python"
    "gtest/: none")

function(room_of file out)
  if(file MATCHES "^([a-z]+/[a-z_]+)/")
    set(${out} ${CMAKE_MATCH_1} PARENT_SCOPE)
  else()
    get_filename_component(folder ${file} DIRECTORY)
    set(${out} ${folder} PARENT_SCOPE)
  endif()
endfunction()

function(allowed_rooms room out known)
  foreach(line IN LISTS rooms)
    string(REGEX REPLACE ":.*" "" name "${line}")
    if(name STREQUAL room)
      string(REGEX REPLACE "^[^:]*: ?" "" list "${line}")
      string(REPLACE " " ";" list "${list}")
      set(${out} "${list}" PARENT_SCOPE)
      set(${known} TRUE PARENT_SCOPE)
      return()
    endif()
  endforeach()
  set(${known} FALSE PARENT_SCOPE)
endfunction()

set(faults "")

function(check_own file room target)
  allowed_rooms(${room} allowed known)
  room_of(${target} target_room)
  string(REGEX REPLACE "/.*" "" target_house "${target_room}")
  if(target_room STREQUAL room OR target_room IN_LIST allowed OR "${target_house}/*" IN_LIST allowed)
    return()
  endif()
  set(faults "${faults}  ${file} includes ${target}: ${room} may see ${allowed}\n" PARENT_SCOPE)
endfunction()

function(check_third_party file room target)
  foreach(line IN LISTS third_parties)
    string(REGEX REPLACE ": .*" "" prefix "${line}")
    string(FIND "${target}" "${prefix}" at)
    if(NOT at EQUAL 0)
      continue()
    endif()
    string(REGEX REPLACE "^[^:]*: " "" list "${line}")
    string(REPLACE " " ";" list "${list}")
    if(NOT room IN_LIST list)
      set(faults "${faults}  ${file} includes <${target}>: only for ${list}\n" PARENT_SCOPE)
    endif()
    return()
  endforeach()
endfunction()

include(${CMAKE_CURRENT_LIST_DIR}/source_files.cmake)
foreach(file IN LISTS files)
  room_of(${file} room)
  allowed_rooms(${room} allowed known)
  if(NOT known)
    set(faults "${faults}  ${file} is in ${room}, a room that tests/layering.cmake does not know\n")
    continue()
  endif()
  file(STRINGS ${ROOT}/${file} includes REGEX "^[ \t]*#[ \t]*include[ \t]*[<\"]")
  foreach(include IN LISTS includes)
    string(REGEX REPLACE "^[^<\"]*[<\"]([^>\"]*).*$" "\\1" target "${include}")
    if(target MATCHES "^(app|calib|dynamics|kinematics|tests)/")
      check_own(${file} ${room} ${target})
    elseif(include MATCHES "\"")
      set(faults "${faults}  ${file} includes \"${target}\": write it from the root\n")
    else()
      check_third_party(${file} ${room} ${target})
    endif()
  endforeach()
endforeach()

if(faults)
  message(FATAL_ERROR "includes that go up (STYLE, section 2):\n${faults}")
endif()
