# Third-party parts, all from the distribution's packages (toolchain/setup.sh installs them).
find_package(Threads REQUIRED)
if(NOT STILLMAP_PARITY_ONLY)
  find_package(PkgConfig REQUIRED)
  find_package(Eigen3 3.3 REQUIRED NO_MODULE)
  find_package(fmt REQUIRED)
  find_package(CLI11 REQUIRED)
  find_package(nlohmann_json REQUIRED)
  find_package(nanoflann REQUIRED)
  pkg_check_modules(spng REQUIRED IMPORTED_TARGET spng)
  pkg_check_modules(turbojpeg REQUIRED IMPORTED_TARGET libturbojpeg)
  pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)
  pkg_check_modules(systemd REQUIRED IMPORTED_TARGET libsystemd)
  pkg_check_modules(cairo REQUIRED IMPORTED_TARGET cairo)
  pkg_check_modules(openni2 IMPORTED_TARGET libopenni2)  # without it: no xtion, no oni
  pkg_check_modules(gpiod QUIET IMPORTED_TARGET libgpiod)  # the sonar; left out where it is not there
  if(STILLMAP_BUILD_TESTS)  # what ours is compared with; the program itself needs none of it
    pkg_check_modules(lcm REQUIRED IMPORTED_TARGET lcm)
    find_program(LCM_GEN lcm-gen REQUIRED)
  endif()
  find_path(TOMLPLUSPLUS_INCLUDE_DIR toml++/toml.h REQUIRED)
  add_library(stillmap_tomlplusplus INTERFACE)
  target_include_directories(stillmap_tomlplusplus SYSTEM INTERFACE ${TOMLPLUSPLUS_INCLUDE_DIR})
endif()

# What every library and program of the project is compiled with.
add_library(stillmap_common INTERFACE)
target_include_directories(stillmap_common INTERFACE ${CMAKE_SOURCE_DIR})
target_link_libraries(stillmap_common INTERFACE stillmap_warnings stillmap_sanitize)
