# Build type, warnings, sanitizers, ccache: everything that concerns all targets alike.
option(UNIPHY_TESTS "Build the tests" ${PROJECT_IS_TOP_LEVEL})
option(UNIPHY_PCH "Precompile the headers of LibTorch once for all targets that use it" ON)
option(UNIPHY_CCACHE "Compile through ccache when it is installed" ON)
set(UNIPHY_SANITIZE "" CACHE STRING "Comma-separated sanitizers, e.g. address,undefined")

set(CMAKE_CXX_STANDARD 17)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

get_property(uniphy_multi_config GLOBAL PROPERTY GENERATOR_IS_MULTI_CONFIG)
if(NOT CMAKE_BUILD_TYPE AND NOT uniphy_multi_config)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  add_compile_options(-Wall -Wextra)
endif()

if(UNIPHY_SANITIZE)
  # -fno-sanitize-recover: undefined behaviour ends the test instead of only printing a line.
  add_compile_options(-fsanitize=${UNIPHY_SANITIZE} -fno-sanitize-recover=all
                      -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${UNIPHY_SANITIZE})
endif()

if(UNIPHY_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(UNIPHY_CCACHE_PROGRAM ccache)
  if(UNIPHY_CCACHE_PROGRAM)
    # The sloppiness is what ccache asks for before it caches compilations with precompiled headers.
    set(CMAKE_CXX_COMPILER_LAUNCHER
        "${CMAKE_COMMAND}" -E env
        "CCACHE_SLOPPINESS=pch_defines,time_macros"
        "${UNIPHY_CCACHE_PROGRAM}")
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fpch-preprocess>)
    endif()
  endif()
endif()
