# uniphy_find_torch(): finds LibTorch (Debian's, or another one through CMAKE_PREFIX_PATH or
# Torch_DIR) and provides the target uniphy_torch. Included by the build and by the installed
# package.
macro(uniphy_find_torch)
  if(NOT TARGET uniphy_torch)
    # TorchConfig warns about every static library that a build without it left out (kineto on
    # Debian 13); none of them is needed with shared libraries. Errors still show.
    set(uniphy_saved_log_level "${CMAKE_MESSAGE_LOG_LEVEL}")
    set(CMAKE_MESSAGE_LOG_LEVEL ERROR)
    find_package(Torch REQUIRED)
    set(CMAKE_MESSAGE_LOG_LEVEL "${uniphy_saved_log_level}")
    message(STATUS "LibTorch ${Torch_VERSION}: ${TORCH_LIBRARY}")
    if(TORCH_CXX_FLAGS MATCHES "_GLIBCXX_USE_CXX11_ABI=0")
      message(FATAL_ERROR "${TORCH_LIBRARY} was built with the old C++ ABI "
        "(_GLIBCXX_USE_CXX11_ABI=0); uniphy needs the cxx11 ABI build of LibTorch")
    endif()
    add_library(uniphy_torch INTERFACE IMPORTED GLOBAL)
    target_link_libraries(uniphy_torch INTERFACE ${TORCH_LIBRARIES})
  endif()
endmacro()
