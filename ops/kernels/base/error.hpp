#pragma once

#include <stdexcept>

namespace uniphy {

/// The one exception type of the project. The message is a single line for the user: what is wrong
/// and where (file, key, particle, step), what was expected and what was found.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace uniphy
