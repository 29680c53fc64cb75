# SPDX-License-Identifier: Apache-2.0
#
# Proves that one_definition.cmake can fail:
# cmake -DSCRIPT=one_definition.cmake -DFOLDER=<scratch> -P one_definition_test.cmake
cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/rule_outcome.cmake)

function(expect result second)
  file(REMOVE_RECURSE ${FOLDER})
  file(WRITE ${FOLDER}/calib/bundle/a.h "namespace kinescope {\nstruct Motion {\n};\n}  // namespace kinescope\n")
  file(WRITE ${FOLDER}/dynamics/control/b.h "${second}")
  expect_outcome(${result} "${second}")
endfunction()

expect(accepted "namespace kinescope {\nstruct Motion;\n}  // namespace kinescope\n")
expect(accepted "namespace kinescope::control {\nstruct Motion {\n};\n}  // namespace kinescope::control\n")
expect(accepted "namespace kinescope {\nnamespace {\nstruct Motion {\n};\n}  // namespace\n}  // namespace kinescope\n")
expect(refused "namespace kinescope {\nstruct Motion {\n};\n}  // namespace kinescope\n")
expect(refused "namespace kinescope {\nclass Motion : public Other {\n};\n}  // namespace kinescope\n")
