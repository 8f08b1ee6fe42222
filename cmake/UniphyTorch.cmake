# Finds LibTorch and defines uniphy_find_torch(), which provides the target uniphy_torch.
# Included by the build and by the installed package.
macro(uniphy_find_torch)
  find_package(Torch REQUIRED)
  if(NOT TARGET uniphy_torch)
    add_library(uniphy_torch INTERFACE IMPORTED GLOBAL)
    target_link_libraries(uniphy_torch INTERFACE ${TORCH_LIBRARIES})
  endif()
endmacro()
