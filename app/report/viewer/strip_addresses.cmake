# SPDX-License-Identifier: Apache-2.0
#
# Takes addresses out of the bundle's comments (three keeps one inside a shader), so that the report names no
# outside place. The names of the XHTML and SVG name spaces are not addresses and stay.
file(READ "${INPUT}" text)
string(REPLACE "http://www.w3.org/" "@KINESCOPE_NAMESPACE@" text "${text}")
string(REGEX REPLACE "https?://[A-Za-z0-9_./~%#?&=-]*" "" text "${text}")
string(REPLACE "@KINESCOPE_NAMESPACE@" "http://www.w3.org/" text "${text}")
# A script element ends at its first closing tag, also inside a string.
string(REPLACE "</script" "<\\/script" text "${text}")
file(WRITE "${OUTPUT}" "${text}")
