# After project(): that folder is known to the compiler already (aarch64.cmake), so no -isystem names it.
get_filename_component(headers ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-arm64/usr/include ABSOLUTE)
list(APPEND CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES ${headers})
