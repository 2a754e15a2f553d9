# Writes a file for ctest with one entry per suite of the program: cmake -DPROGRAM=... -DOUTPUT=... -P list_suites.cmake
# One entry per test, as gtest_discover_tests makes them, starts a process each, and loading the image library with the
# 260 it needs takes longer than most tests do.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listing COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+\\.( |\n)" suites "${listing}")
set(entries "")
foreach(suite IN LISTS suites)
  string(REGEX MATCH "[A-Za-z0-9_/]+" suite "${suite}")
  string(APPEND entries "add_test(${suite} \"${PROGRAM}\" \"--gtest_filter=${suite}.*\")\n")
endforeach()
file(WRITE ${OUTPUT} "${entries}")
