# SPDX-License-Identifier: Apache-2.0
#
# What the rule in SCRIPT has to say of the sources in FOLDER: accepted or refused.
function(expect_outcome result sources)
  execute_process(COMMAND ${CMAKE_COMMAND} -DROOT=${FOLDER} -P ${SCRIPT} RESULT_VARIABLE code
                  OUTPUT_QUIET ERROR_VARIABLE message)
  if(result STREQUAL "accepted" AND NOT code EQUAL 0)
    message(FATAL_ERROR "${sources} is refused: ${message}")
  elseif(result STREQUAL "refused" AND code EQUAL 0)
    message(FATAL_ERROR "${sources} is accepted")
  endif()
endfunction()
