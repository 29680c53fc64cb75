# SPDX-License-Identifier: Apache-2.0
#
# Run by CPack on the installed trees before they are packed.
find_program(GZIP gzip REQUIRED)
set(version ${CPACK_PACKAGE_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})
string(TIMESTAMP today "%a, %d %b %Y %H:%M:%S +0000" UTC)  # or SOURCE_DATE_EPOCH

function(mend_package root name)
  set(doc ${root}/usr/share/doc/${name})
  file(MAKE_DIRECTORY ${doc})
  configure_file(${CMAKE_CURRENT_LIST_DIR}/copyright.in ${doc}/copyright @ONLY)
  file(REMOVE ${doc}/LICENSE)  # base-files has it
  file(COPY_FILE ${CMAKE_CURRENT_LIST_DIR}/../../CHANGELOG.md ${doc}/changelog)
  file(WRITE ${doc}/changelog.Debian
       "${name} (${version}) unstable; urgency=medium\n\n  * Changes are in changelog.gz.\n\n"
       " -- ${CPACK_PACKAGE_CONTACT}  ${today}\n")
  file(GLOB pages ${root}/usr/share/man/man1/*.1)
  execute_process(COMMAND ${GZIP} -9nf ${doc}/changelog ${doc}/changelog.Debian ${pages} COMMAND_ERROR_IS_FATAL ANY)
  set(zsh ${root}/usr/share/zsh)
  if(EXISTS ${zsh}/site-functions)
    file(RENAME ${zsh}/site-functions ${zsh}/vendor-completions)
  endif()
endfunction()

# The conditions alone, as a field of the file: every line one further in, empty ones with a dot.
file(READ ${CMAKE_CURRENT_LIST_DIR}/../report/page/licence_three.txt THREE_LICENCE)
string(REGEX REPLACE "^.*authors\n\n" "" THREE_LICENCE "${THREE_LICENCE}")
string(REPLACE "\n\n" "\n.\n" THREE_LICENCE "${THREE_LICENCE}")
string(REPLACE "\n" "\n " THREE_LICENCE " ${THREE_LICENCE}")
string(STRIP "${THREE_LICENCE}" THREE_LICENCE)
mend_package(${CPACK_TEMPORARY_DIRECTORY}/program kinescope)
mend_package(${CPACK_TEMPORARY_DIRECTORY}/development libkinescope-dev)
set(python ${CPACK_TEMPORARY_DIRECTORY}/python)
if(EXISTS ${python})
  mend_package(${python} python3-kinescope)
  # One folder for all versions; the extension's name says which it is for.
  file(GLOB packages ${python}/usr/lib/python3.*/dist-packages)
  file(MAKE_DIRECTORY ${python}/usr/lib/python3)
  file(RENAME ${packages} ${python}/usr/lib/python3/dist-packages)
  file(GLOB versioned ${python}/usr/lib/python3.*)
  file(REMOVE_RECURSE ${versioned})
endif()
