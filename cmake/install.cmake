# cmake --install gives headers, libraries, the program, and a package for find_package(glyphwave).
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/glyphwave)

set_target_properties(fontcore PROPERTIES OUTPUT_NAME glyphwave_fontcore)
set_target_properties(glyphs PROPERTIES OUTPUT_NAME glyphwave_glyphs)
install(TARGETS fontcore glyphs EXPORT glyphwaveTargets)
if(GLYPHWAVE_TOOLS)
  install(TARGETS glyphwave)
endif()
set(private_headers compact_chain.h compact_search.h canvas.h emission.h glif.h glyph_editor.h json_reader.h sfnt_cff.h
    sfnt_check.h sfnt_tables.h shared_fits.h variation_tables.h weight_law.h xml.h)
list(TRANSFORM private_headers REPLACE "(.+)" "PATTERN;\\1;EXCLUDE")
install(DIRECTORY fontcore glyphs DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/glyphwave
        FILES_MATCHING PATTERN "*.h" ${private_headers})
install(FILES LICENSE NOTICE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/glyphwave)

install(EXPORT glyphwaveTargets NAMESPACE glyphwave:: DESTINATION ${package_dir})
configure_package_config_file(cmake/glyphwaveConfig.cmake.in ${PROJECT_BINARY_DIR}/glyphwaveConfig.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/glyphwaveConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/glyphwaveConfig.cmake ${PROJECT_BINARY_DIR}/glyphwaveConfigVersion.cmake
        DESTINATION ${package_dir})
