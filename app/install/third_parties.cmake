# SPDX-License-Identifier: Apache-2.0
#
# The third parties of the libraries, found alike by the build and by KinescopeConfig.cmake.

# Each the arguments of find_package.
set(kinescope_packages
    "Eigen3 3.4 NO_MODULE"
    fmt
    yaml-cpp
    nlohmann_json
    CLI11
    Ceres
    "OpenCV COMPONENTS core imgproc imgcodecs videoio calib3d aruco"
    urdfdom
    urdfdom_headers
    tinyxml2
    console_bridge
    "OpenSSL COMPONENTS Crypto"
    Threads
    ZLIB
    BZip2
    PkgConfig)

# The same of kinescope::torque and the rooms below it.
set(kinescope_torque_packages "Eigen3 3.4 NO_MODULE" fmt nlohmann_json Ceres Threads ZLIB)

# What is not installed; empty when all is there.
set(kinescope_missing "")

# kinescope_find_libraries(target library ..): an imported target of libraries without a CMake package that serves.
macro(kinescope_find_libraries target)
  if(NOT TARGET ${target})
    add_library(${target} INTERFACE IMPORTED)
    foreach(library ${ARGN})
      find_library(KINESCOPE_LIBRARY_${library} ${library})
      if(KINESCOPE_LIBRARY_${library})
        target_link_libraries(${target} INTERFACE ${KINESCOPE_LIBRARY_${library}})
      else()
        list(APPEND kinescope_missing lib${library})
      endif()
    endforeach()
  endif()
endmacro()

macro(kinescope_find_torque_third_parties)
  # OpenBLAS must stand before Ceres on every link line: Debian's Ceres names ATLAS, which otherwise
  # wins the BLAS symbols and is four times slower (tests/acceptance checks the running program).
  kinescope_find_libraries(kinescope_blas openblas)
  kinescope_find_libraries(kinescope_libsvm svm)
  # Debian's dlibConfig.cmake asks for libraries of its pictures and windows; the network needs none.
  kinescope_find_libraries(kinescope_dlib dlib)
  if(KINESCOPE_SCALAPACK)
    kinescope_find_libraries(kinescope_scalapack scalapack-openmpi)
  endif()
endmacro()

# To be called when PkgConfig is found.
macro(kinescope_find_third_parties)
  # The CMake files of Ubuntu 24.04's package point beside its libraries.
  kinescope_find_libraries(kinescope_apriltag apriltag apriltag-utils)
  kinescope_find_torque_third_parties()
  pkg_check_modules(KINESCOPE_LIBAV QUIET IMPORTED_TARGET libavformat libavcodec libavutil libswscale)
  if(NOT KINESCOPE_LIBAV_FOUND)
    list(APPEND kinescope_missing libavformat libavcodec libavutil libswscale)
  endif()
  pkg_check_modules(KINESCOPE_BAGS QUIET IMPORTED_TARGET libzstd liblz4 sqlite3)
  if(NOT KINESCOPE_BAGS_FOUND)
    list(APPEND kinescope_missing libzstd liblz4 libsqlite3)
  endif()
  pkg_check_modules(KINESCOPE_PARQUET QUIET IMPORTED_TARGET libzstd snappy)
  if(NOT KINESCOPE_PARQUET_FOUND)
    list(APPEND kinescope_missing libsnappy)
  endif()
  pkg_check_modules(KINESCOPE_HTTP QUIET IMPORTED_TARGET cpp-httplib)
  if(NOT KINESCOPE_HTTP_FOUND)
    list(APPEND kinescope_missing libcpp-httplib)
  endif()
endmacro()
