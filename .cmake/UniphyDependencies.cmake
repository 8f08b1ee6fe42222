# External packages. Where Debian releases name a target differently, it is given one name here.
include(UniphyTorch)
include(UniphyPackages)
uniphy_find_packages()
uniphy_find_torch()

if(UNIPHY_TESTS)
  find_package(GTest REQUIRED)
endif()
find_package(benchmark QUIET)
