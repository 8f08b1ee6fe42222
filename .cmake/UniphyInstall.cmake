# Install tree and the package that find_package(uniphy) reads.
include(CMakePackageConfigHelpers)
get_property(uniphy_targets GLOBAL PROPERTY UNIPHY_INSTALLED_TARGETS)
set(uniphy_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/uniphy")
install(TARGETS ${uniphy_targets} EXPORT uniphyTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ops models uniphy DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/uniphy
        FILES_MATCHING PATTERN "*.hpp")
install(EXPORT uniphyTargets NAMESPACE uniphy:: DESTINATION ${uniphy_package_dir})
configure_package_config_file(.cmake/uniphyConfig.cmake.in uniphyConfig.cmake
                              INSTALL_DESTINATION ${uniphy_package_dir})
write_basic_package_version_file(uniphyConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES "${PROJECT_BINARY_DIR}/uniphyConfig.cmake"
              "${PROJECT_BINARY_DIR}/uniphyConfigVersion.cmake"
              .cmake/UniphyTorch.cmake .cmake/UniphyPackages.cmake
        DESTINATION ${uniphy_package_dir})
