# A package is made of what was built.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)
# cmake --install: the program with presets and documents (component program, anywhere), and what makes it a service of this
# machine (component service: systemd unit, udev rule, user, /etc/stillmap). cpack -G DEB: all of it as a package.
set(documents ${CMAKE_INSTALL_DATADIR}/doc/stillmap)
install(TARGETS stillmap RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(DIRECTORY config/presets/ DESTINATION ${CMAKE_INSTALL_DATADIR}/stillmap/presets COMPONENT program
  FILES_MATCHING PATTERN "*.toml")
install(DIRECTORY config/calibrations/ DESTINATION ${CMAKE_INSTALL_DATADIR}/stillmap/calibrations COMPONENT program
  FILES_MATCHING PATTERN "*.toml")
install(DIRECTORY drivers/lcm/types/ DESTINATION ${CMAKE_INSTALL_DATADIR}/stillmap/lcm COMPONENT program
  FILES_MATCHING PATTERN "*.lcm")
install(FILES README.md docs/DEPLOY.md docs/PAPER.md docs/RESULTS.md DESTINATION ${documents} COMPONENT program)
install(FILES LICENSE DESTINATION ${documents} RENAME copyright COMPONENT program)

install(FILES toolchain/systemd/stillmap.service DESTINATION lib/systemd/system COMPONENT service)
if(STILLMAP_CUDA_FOUND)
  install(FILES toolchain/systemd/cuda.conf DESTINATION lib/systemd/system/stillmap.service.d COMPONENT service)
endif()
install(FILES toolchain/systemd/stillmap.sysusers DESTINATION lib/sysusers.d RENAME stillmap.conf COMPONENT service)
install(FILES toolchain/udev/60-stillmap.rules DESTINATION lib/udev/rules.d COMPONENT service)
install(SCRIPT toolchain/systemd/install_settings.cmake COMPONENT service)

set(CPACK_PACKAGE_NAME stillmap)
set(CPACK_PACKAGE_CONTACT "The Stillmap developers <stillmap@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Real-time dense RGB-D SLAM among moving people and things")
set(CPACK_PACKAGE_DESCRIPTION "Tracks a depth camera, throws out whatever moves, maps what stands still in memory fixed at start,\n gives poses over LCM. Runs as a service from boot on; see /usr/share/doc/stillmap/DEPLOY.md.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
# Libraries by dpkg-shlibdeps; the rest is what the maintainer scripts call.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "systemd, init-system-helpers (>= 1.54)")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "udev")
foreach(file conffiles postinst prerm postrm)
  list(APPEND CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_SOURCE_DIR}/toolchain/package/${file})
endforeach()
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
