# uniphy_library(<target> EXPORT <name> [TORCH] SOURCES ... PUBLIC <libs> PRIVATE <libs>)
# A static library with the alias uniphy::<name>. Sources are relative to the calling folder.
function(uniphy_library target)
  cmake_parse_arguments(arg "TORCH" "EXPORT" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  if(NOT arg_SOURCES)
    set(arg_SOURCES "${PROJECT_BINARY_DIR}/${target}_empty.cpp")
    file(CONFIGURE OUTPUT "${arg_SOURCES}" CONTENT "// ${target} has no sources yet.\n")
  endif()
  add_library(${target} STATIC ${arg_SOURCES})
  add_library(uniphy::${arg_EXPORT} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${arg_EXPORT} LINKER_LANGUAGE CXX)
  target_compile_features(${target} PUBLIC cxx_std_17)
  target_include_directories(${target} PUBLIC
    "$<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>"
    "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/uniphy>")
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE})
  if(arg_TORCH)
    target_link_libraries(${target} PUBLIC uniphy_torch OpenMP::OpenMP_CXX)
    uniphy_use_torch_pch(${target})
  endif()
  set_property(GLOBAL APPEND PROPERTY UNIPHY_INSTALLED_TARGETS ${target})
endfunction()

# uniphy_binary(<name> SOURCES ... LIBS ... [TORCH])
function(uniphy_binary name)
  cmake_parse_arguments(arg "TORCH" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBS})
  if(arg_TORCH)
    uniphy_use_torch_pch(${name})
  endif()
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

# uniphy_test(NAME <name> SOURCES ... LIBS ... [TORCH])
# A GoogleTest executable; each of its tests is one CTest test. Without sources: nothing.
function(uniphy_test)
  cmake_parse_arguments(arg "TORCH" "NAME" "SOURCES;LIBS" ${ARGN})
  if(NOT arg_SOURCES)
    return()
  endif()
  add_executable(${arg_NAME} ${arg_SOURCES})
  target_link_libraries(${arg_NAME} PRIVATE ${arg_LIBS} GTest::gmock GTest::gtest_main)
  target_compile_definitions(${arg_NAME} PRIVATE
    UNIPHY_SOURCE_DIR="${PROJECT_SOURCE_DIR}" UNIPHY_BINARY_DIR="${PROJECT_BINARY_DIR}")
  if(arg_TORCH)
    uniphy_use_torch_pch(${arg_NAME})
  endif()
  # Instrumented loops over lanes are about fifty times slower.
  set(timeout 300)
  if(UNIPHY_SANITIZE)
    set(timeout 1800)
  endif()
  # CTest runs tests side by side: threads that spin while they wait would slow the neighbours.
  gtest_discover_tests(${arg_NAME} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 NO_PRETTY_VALUES
    PROPERTIES ENVIRONMENT "OMP_WAIT_POLICY=passive" TIMEOUT ${timeout})
endfunction()

# One precompiled ops/base/torch.hpp for every target that uses LibTorch; their flags must agree, so
# all of them compile with OpenMP and, because some make up a shared library, with -fPIC.
function(uniphy_use_torch_pch target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 13)
    # False alarms on the std::vector<bool> inside torch::autograd::Function::apply.
    target_compile_options(${target} PRIVATE -Wno-array-bounds -Wno-stringop-overflow)
  endif()
  if(NOT UNIPHY_PCH)
    return()
  endif()
  if(NOT TARGET uniphy_torch_pch)
    file(CONFIGURE OUTPUT "${PROJECT_BINARY_DIR}/pch/uniphy_torch_pch.cpp"
         CONTENT "// Owner of the precompiled ops/base/torch.hpp.\n")
    add_library(uniphy_torch_pch OBJECT "${PROJECT_BINARY_DIR}/pch/uniphy_torch_pch.cpp")
    target_compile_features(uniphy_torch_pch PUBLIC cxx_std_17)
    target_link_libraries(uniphy_torch_pch PRIVATE uniphy_torch OpenMP::OpenMP_CXX)
    target_compile_options(uniphy_torch_pch PRIVATE -fPIC)
    target_precompile_headers(uniphy_torch_pch PRIVATE
                              "${PROJECT_SOURCE_DIR}/ops/base/torch.hpp")
  endif()
  target_compile_options(${target} PRIVATE -fPIC)
  target_precompile_headers(${target} REUSE_FROM uniphy_torch_pch)
endfunction()
if(UNIPHY_TESTS)
  include(GoogleTest)
endif()

# uniphy_add_isa(<target> <isa> <flags>...)
# Compiles ${uniphy_isa_sources} once more with <flags> and adds the objects to <target>. The object
# library is <target>_<isa>; tests check its symbols (check_isa_symbols.cmake).
function(uniphy_add_isa target isa)
  if(NOT uniphy_isa_sources)
    return()
  endif()
  add_library(${target}_${isa} OBJECT ${uniphy_isa_sources})
  foreach(property COMPILE_OPTIONS INCLUDE_DIRECTORIES COMPILE_DEFINITIONS LINK_LIBRARIES
                   POSITION_INDEPENDENT_CODE CXX_VISIBILITY_PRESET VISIBILITY_INLINES_HIDDEN)
    get_target_property(value ${target} ${property})
    if(value)
      set_target_properties(${target}_${isa} PROPERTIES ${property} "${value}")
    endif()
  endforeach()
  target_compile_options(${target}_${isa} PRIVATE ${ARGN})
  target_sources(${target} PRIVATE $<TARGET_OBJECTS:${target}_${isa}>)
endfunction()

# A CTest test that no object of <target>_<isa> can leak code to CPUs without <isa>.
function(uniphy_add_isa_symbol_test target isa)
  if(TARGET ${target}_${isa} AND CMAKE_NM AND NOT UNIPHY_SANITIZE)
    add_test(NAME isa_symbols.${isa} COMMAND ${CMAKE_COMMAND}
             -DNM=${CMAKE_NM} -DISA=${isa} "-DOBJECTS=$<TARGET_OBJECTS:${target}_${isa}>"
             -P "${PROJECT_SOURCE_DIR}/.cmake/check_isa_symbols.cmake")
  endif()
endfunction()
