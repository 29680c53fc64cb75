# SPDX-License-Identifier: Apache-2.0
#
# Makes the Debian packages, and runs the program that is in one and, with -DPYTHON=, the module that is in another.
cmake_minimum_required(VERSION 3.25)

foreach(tool dpkg-deb dpkg-shlibdeps file)
  find_program(TOOL_${tool} ${tool})
  if(NOT TOOL_${tool})
    message("SKIPPED: ${tool} is not installed")
    return()
  endif()
endforeach()

include(${CMAKE_CURRENT_LIST_DIR}/run.cmake)

file(REMOVE_RECURSE ${SCRATCH})
run(${CPACK} --config ${BUILD}/CPackConfig.cmake -B ${SCRATCH})
file(GLOB program ${SCRATCH}/kinescope_*.deb)
run(${TOOL_dpkg-deb} --field ${program} Depends)
if(NOT out MATCHES "libc6 .*libopenblas0")
  message(FATAL_ERROR "the program's libraries are not all in its package's dependencies: ${out}")
endif()
run(${TOOL_dpkg-deb} --extract ${program} ${SCRATCH}/root)
run(${SCRATCH}/root/usr/bin/kinescope --version)
foreach(file doc/kinescope/copyright man/man1/kinescope-run.1.gz zsh/vendor-completions/_kinescope)
  if(NOT EXISTS ${SCRATCH}/root/usr/share/${file})
    message(FATAL_ERROR "/usr/share/${file} is not in ${program}")
  endif()
endforeach()

if(NOT PYTHON)
  return()
endif()
file(GLOB module ${SCRATCH}/python3-kinescope_*.deb)
run(${TOOL_dpkg-deb} --field ${module} Depends)
if(NOT out MATCHES "libc6 .*libopenblas0" OR NOT out MATCHES "python3-numpy" OR NOT out MATCHES "python3 \\(<< 3[.]")
  message(FATAL_ERROR "what the module needs is not all in its package's dependencies: ${out}")
endif()
run(${TOOL_dpkg-deb} --extract ${module} ${SCRATCH}/python)
set(place ${SCRATCH}/python/usr/lib/python3/dist-packages)
run(${CMAKE_COMMAND} -E env PYTHONPATH=${place} PYTHONDONTWRITEBYTECODE=1 ${PYTHON}
    ${CMAKE_CURRENT_LIST_DIR}/python_module.py ${place})
