#pragma once

#include <gtest/gtest.h>

#include <exception>
#include <string>

#include "ops/kernels/base/error.hpp"

namespace uniphy::testing {

/// The message of the uniphy::Error that `function` throws. Anything else fails the test.
template <class Function>
std::string error_of(const Function& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  } catch (const std::exception& error) {
    ADD_FAILURE() << "expected uniphy::Error, found another exception: " << error.what();
    return "";
  }
  ADD_FAILURE() << "expected uniphy::Error, found none";
  return "";
}

}  // namespace uniphy::testing
