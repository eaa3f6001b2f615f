# The service's settings go to /etc whatever the prefix. What is there stays: somebody may have changed it.
foreach(file default/stillmap stillmap/stillmap.toml)
  if(EXISTS "$ENV{DESTDIR}/etc/${file}")
    message(STATUS "Kept: $ENV{DESTDIR}/etc/${file}")
  else()
    get_filename_component(folder /etc/${file} DIRECTORY)
    file(INSTALL ${CMAKE_CURRENT_LIST_DIR}/etc/${file} DESTINATION ${folder})
  endif()
endforeach()
