#pragma once

// Private to the hdf5_*.cpp files: the only place that includes hdf5.h.

#include <hdf5.h>

#include <cstdint>
#include <string>
#include <utility>

#include "uniphy/io/hdf5.hpp"

namespace uniphy::hdf5 {

/// Owns one HDF5 identifier.
class Handle {
 public:
  Handle() = default;
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() { reset(); }

  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor)
  bool valid() const { return id_ >= 0; }
  /// Closes; false where HDF5 reports that it could not (data may not have been written).
  bool reset() {
    const bool good = id_ < 0 || close_(id_) >= 0;
    id_ = -1;
    return good;
  }

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

inline Handle dataspace(hid_t id) { return {id, H5Sclose}; }
inline Handle datatype(hid_t id) { return {id, H5Tclose}; }
inline Handle property_list(hid_t id) { return {id, H5Pclose}; }
inline Handle dataset(hid_t id) { return {id, H5Dclose}; }
inline Handle attribute_handle(hid_t id) { return {id, H5Aclose}; }
inline Handle object_handle(hid_t id) { return {id, H5Oclose}; }
inline Handle file_handle(hid_t id) { return {id, H5Fclose}; }
inline Handle group_handle(hid_t id) { return {id, H5Gclose}; }

/// To be called before any other function: no printing of HDF5's own error stack (messages are made
/// here) and no exit handler.
void prepare_hdf5();
/// Why the last call failed: what the system said, else the innermost message of HDF5's error
/// stack, else "unknown HDF5 error". Every call of HDF5 forgets it.
std::string hdf5_reason();
/// UTF-8 text of at most `size` bytes, padded with zeros (H5T_VARIABLE: of any length). Files are
/// written with fixed lengths, for HDF5 reads damaged variable-length text without care.
Handle text_type(std::size_t size);
/// "float64", "int32", "text", "compound"
std::string type_text(hid_t type);

template <class T>
hid_t native_type();
template <>
inline hid_t native_type<double>() {
  return H5T_NATIVE_DOUBLE;
}
template <>
inline hid_t native_type<float>() {
  return H5T_NATIVE_FLOAT;
}
template <>
inline hid_t native_type<std::int32_t>() {
  return H5T_NATIVE_INT32;
}
template <>
inline hid_t native_type<std::int64_t>() {
  return H5T_NATIVE_INT64;
}

/// "/samples/F" from "samples/F" or "/samples/F"
inline std::string rooted(const std::string& name) {
  return !name.empty() && name[0] == '/' ? name : "/" + name;
}

}  // namespace uniphy::hdf5
