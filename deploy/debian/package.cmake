# The Debian package, by CPack. dpkg-shlibdeps (dpkg-dev) finds what it depends on.
find_program(gzip gzip REQUIRED)
string(TIMESTAMP changelog_date "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_PACKAGE_CONTACT "gonio developers <gonio@example.org>")
configure_file(debian/changelog.in changelog.Debian @ONLY)
configure_file(${PROJECT_SOURCE_DIR}/CHANGELOG.md changelog COPYONLY)
foreach(changelog changelog changelog.Debian)
    execute_process(COMMAND gzip -9nf ${CMAKE_CURRENT_BINARY_DIR}/${changelog} COMMAND_ERROR_IS_FATAL ANY)
    install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${changelog}.gz DESTINATION ${CMAKE_INSTALL_DOCDIR})
endforeach()
install(FILES debian/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGING_INSTALL_PREFIX ${CMAKE_INSTALL_PREFIX})
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "virtual gonioreflectometer: BRDFs of measured micro-surfaces")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"From a height field and the reflectance of its facets, gonio simulates what an
instrument would measure: the BRDF with shadowing, masking and every order of
scattering, each value with its error.
.
The package holds the command line program and its HTTP service (OGC API -
Processes), whose systemd unit is installed but not enabled.")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA)
foreach(script conffiles postinst prerm postrm)
    list(APPEND CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_CURRENT_SOURCE_DIR}/debian/${script})
endforeach()
include(CPack)
