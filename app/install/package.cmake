# SPDX-License-Identifier: Apache-2.0
#
# Debian packages from the components of install.cmake: `cmake --workflow --preset package` makes kinescope,
# libkinescope-dev and python3-kinescope. debian_files.cmake does what Debian wants otherwise than other systems.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "The Kinescope authors <maintainers@kinescope.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
                                                WORLD_READ WORLD_EXECUTE)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/app/install/debian_files.cmake)
set(CPACK_COMPONENTS_ALL program development)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME kinescope)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION
    "learns a robot's body from a marker video and a joint log
Kinescope reads a video of a robot with a fiducial marker on every link and
the log of its joints. It finds which marker is on which link, how the links
are joined and which channel drives which joint, calibrates the kinematics
with uncertainties, and writes a URDF and a report. With torques in the log it
identifies masses and friction, and detects contacts.")

# The names of setup.sh, for Debian 12 and Ubuntu 24.04.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libkinescope-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    libopencv-dev
    libapriltag-dev
    libopenblas-pthread-dev
    libceres-dev
    libeigen3-dev
    liburdfdom-dev
    libconsole-bridge-dev
    libtinyxml2-dev
    libyaml-cpp-dev
    libcli11-dev
    libfmt-dev
    nlohmann-json3-dev
    libssl-dev
    zlib1g-dev
    libsvm-dev
    libdlib-dev
    libavformat-dev
    libavcodec-dev
    libavutil-dev
    libswscale-dev
    libzstd-dev
    libsnappy-dev
    liblz4-dev
    libbz2-dev
    libsqlite3-dev
    libcpp-httplib-dev
    pkg-config)
list(JOIN CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION
    "robot calibration from a marker video, development files
Static libraries and headers of Kinescope, which learns a robot's body from a
video of markers and the log of its joints, with a CMake package, a pkg-config
file and an example.")

if(KINESCOPE_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-kinescope)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/app/install/python/postinst
                                                ${PROJECT_SOURCE_DIR}/app/install/python/prerm)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION
      "robot calibration from a marker video, Python module
Every command of Kinescope as a function, and what they write as NumPy arrays:
structure, calibration with covariance, residuals, forward kinematics, camera,
torque models.")
endif()
include(CPack)
