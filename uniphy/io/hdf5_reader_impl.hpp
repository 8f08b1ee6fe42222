#pragma once

// Private to hdf5_reader.cpp and hdf5_attributes.cpp.

#include "uniphy/io/hdf5_handle.hpp"

namespace uniphy::hdf5 {

struct Reader::Impl {
  std::filesystem::path path;
  Handle file;
  std::int64_t file_bytes = 0;

  [[noreturn]] void fail(const std::string& object, const std::string& message) const;
  /// Whether the object is there. Throws Error where a link leads out of the file.
  bool exists(const std::string& name) const;
  /// Opens a dataset.
  Handle open(const std::string& name) const;
  Shape shape_of(const std::string& name, const Handle& set) const;
  /// Refuses data outside the file, unknown filters, and sizes that the file cannot hold.
  void check_storage(const std::string& name, const Handle& set, const Shape& shape) const;
  /// rows < 0 reads everything.
  template <class T>
  std::vector<T> read(const std::string& name, const Shape& expected, std::int64_t first,
                      std::int64_t rows, Values values) const;
};

}  // namespace uniphy::hdf5
