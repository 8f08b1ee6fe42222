# Every package but LibTorch, for the build and for the installed package alike.
macro(uniphy_find_packages)
  find_package(Eigen3 3.4 REQUIRED NO_MODULE)
  find_package(OpenMP REQUIRED COMPONENTS CXX)
  find_package(xsimd REQUIRED)
  find_package(nanoflann REQUIRED)
  find_package(HDF5 REQUIRED COMPONENTS C)
  find_package(yaml-cpp REQUIRED)
  find_package(fmt REQUIRED)
  find_package(spdlog REQUIRED)
  find_package(CLI11 REQUIRED)
  find_package(nlohmann_json REQUIRED)
  find_package(ZLIB REQUIRED)

  # Header-only. Only the include directory: Debian 12's target also asks for a library that
  # does not exist (-lxtl).
  if(NOT TARGET uniphy_xsimd)
    get_target_property(uniphy_xsimd_include xsimd INTERFACE_INCLUDE_DIRECTORIES)
    add_library(uniphy_xsimd INTERFACE IMPORTED GLOBAL)
    set_target_properties(uniphy_xsimd PROPERTIES
                          INTERFACE_INCLUDE_DIRECTORIES "${uniphy_xsimd_include}")
  endif()
  # yaml-cpp 0.7 exports `yaml-cpp`, 0.8 `yaml-cpp::yaml-cpp`.
  if(NOT TARGET uniphy_yaml)
    add_library(uniphy_yaml INTERFACE IMPORTED GLOBAL)
    if(TARGET yaml-cpp::yaml-cpp)
      target_link_libraries(uniphy_yaml INTERFACE yaml-cpp::yaml-cpp)
    else()
      target_link_libraries(uniphy_yaml INTERFACE yaml-cpp)
    endif()
  endif()
endmacro()
