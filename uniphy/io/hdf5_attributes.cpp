// Attributes of an open file.

#include <fmt/format.h>

#include <cmath>
#include <cstring>

#include "uniphy/io/hdf5_handle.hpp"
#include "uniphy/io/hdf5_reader_impl.hpp"
#include "uniphy/io/text_lines.hpp"

namespace uniphy::hdf5 {
namespace {

std::string attribute_title(const std::string& object, const std::string& name) {
  return object == "/" ? fmt::format("attribute {}", name)
                       : fmt::format("attribute {} of {}", name, object);
}

std::string count_text(hssize_t count) {
  return count == 1 ? "one value" : fmt::format("{} values", count);
}

/// An attribute that is there, holds `wanted` values of one class and (unless count < 0) `count`
/// of them.
struct OpenAttribute {
  Handle handle;
  Handle type;
  hssize_t count = 0;
};

template <class Fail>
OpenAttribute open_attribute(hid_t file, const std::string& object, const std::string& name,
                             H5T_class_t wanted, const char* wanted_text, std::int64_t count,
                             const Fail& fail) {
  OpenAttribute attribute;
  attribute.handle = attribute_handle(
      H5Aopen_by_name(file, object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT));
  if (!attribute.handle.valid()) fail(fmt::format("cannot be opened: {}", hdf5_reason()));
  attribute.type = datatype(H5Aget_type(attribute.handle));
  const Handle space = dataspace(H5Aget_space(attribute.handle));
  if (!attribute.type.valid() || !space.valid()) {
    fail(fmt::format("cannot be read: {}", hdf5_reason()));
  }
  // h5py stores density = 1000 as an integer, and grid = 20.0 as a real number.
  const H5T_class_t found = H5Tget_class(attribute.type);
  const bool numbers = wanted != H5T_STRING && (found == H5T_INTEGER || found == H5T_FLOAT);
  if (found != wanted && !numbers) {
    fail(fmt::format("expected {}, found {}", wanted_text, type_text(attribute.type)));
  }
  attribute.count = H5Sget_simple_extent_npoints(space);
  const std::int64_t largest = count < 0 ? 4096 : count;
  if (attribute.count < 0 || (count >= 0 && attribute.count != count) ||
      attribute.count > largest) {
    fail(fmt::format("expected {}, found {}", count < 0 ? "at most 4096 values" : count_text(count),
                     count_text(attribute.count)));
  }
  return attribute;
}

}  // namespace

bool Reader::has_attribute(const std::string& object, const std::string& name) const {
  const std::string full = rooted(object);
  if (!impl_->exists(full)) return false;
  const htri_t found = H5Aexists_by_name(impl_->file, full.c_str(), name.c_str(), H5P_DEFAULT);
  H5Eclear2(H5E_DEFAULT);
  return found > 0;
}

std::string Reader::attribute_text(const std::string& object, const std::string& name) const {
  const std::string title = attribute_title(rooted(object), name);
  const auto fail = [&](const std::string& message) { impl_->fail(title, message); };
  const auto checked = [&](const std::string& text) {
    if (!is_utf8(text)) fail("expected UTF-8 text, found " + quoted_word(text));
    return text;
  };
  if (!has_attribute(object, name)) fail("expected text, found no such attribute");
  const auto attribute =
      open_attribute(impl_->file, rooted(object), name, H5T_STRING, "text", 1, fail);
  if (H5Tis_variable_str(attribute.type) > 0) {
    const Handle memory_type = text_type(H5T_VARIABLE);
    H5Tset_cset(memory_type, H5Tget_cset(attribute.type));
    char* pointer = nullptr;
    if (H5Aread(attribute.handle, memory_type, &pointer) < 0) {
      fail(fmt::format("cannot be read: {}", hdf5_reason()));
    }
    std::string text = pointer ? pointer : "";
    const Handle space = dataspace(H5Aget_space(attribute.handle));
    H5Dvlen_reclaim(memory_type, space, H5P_DEFAULT, &pointer);
    return checked(text);
  }
  const std::size_t width = H5Tget_size(attribute.type);
  if (width > static_cast<std::size_t>(impl_->file_bytes)) {
    fail(fmt::format("expected text that the file can hold, found {} bytes", width));
  }
  std::vector<char> buffer(width);
  if (H5Aread(attribute.handle, attribute.type, buffer.data()) < 0) {
    fail(fmt::format("cannot be read: {}", hdf5_reason()));
  }
  return checked(std::string(buffer.data(), strnlen(buffer.data(), width)));
}

std::vector<double> Reader::attribute_reals(const std::string& object, const std::string& name,
                                            std::int64_t count) const {
  const std::string title = attribute_title(rooted(object), name);
  const auto fail = [&](const std::string& message) { impl_->fail(title, message); };
  if (!has_attribute(object, name)) fail("expected numbers, found no such attribute");
  const auto attribute =
      open_attribute(impl_->file, rooted(object), name, H5T_FLOAT, "numbers", count, fail);
  std::vector<double> values(static_cast<std::size_t>(attribute.count));
  if (!values.empty() && H5Aread(attribute.handle, H5T_NATIVE_DOUBLE, values.data()) < 0) {
    fail(fmt::format("cannot be read: {}", hdf5_reason()));
  }
  return values;
}

double Reader::attribute_real(const std::string& object, const std::string& name) const {
  const double value = attribute_reals(object, name, 1)[0];
  if (!std::isfinite(value)) {
    impl_->fail(attribute_title(rooted(object), name),
                fmt::format("expected a finite number, found {}", value));
  }
  return value;
}

std::int64_t Reader::attribute_integer(const std::string& object, const std::string& name) const {
  const std::string title = attribute_title(rooted(object), name);
  const auto fail = [&](const std::string& message) { impl_->fail(title, message); };
  if (!has_attribute(object, name)) fail("expected an integer, found no such attribute");
  const auto attribute =
      open_attribute(impl_->file, rooted(object), name, H5T_INTEGER, "an integer", 1, fail);
  if (H5Tget_class(attribute.type) == H5T_FLOAT) {
    double value = 0;
    if (H5Aread(attribute.handle, H5T_NATIVE_DOUBLE, &value) < 0) {
      fail(fmt::format("cannot be read: {}", hdf5_reason()));
    }
    // Doubles hold every integer up to 2⁵³.
    if (!(std::abs(value) <= 0x1p53) || value != std::floor(value)) {
      fail(fmt::format("expected an integer, found {}", value));
    }
    return static_cast<std::int64_t>(value);
  }
  std::int64_t value = 0;
  if (H5Aread(attribute.handle, H5T_NATIVE_INT64, &value) < 0) {
    fail(fmt::format("cannot be read: {}", hdf5_reason()));
  }
  return value;
}

std::int64_t Reader::check_format(const std::string& format, std::int64_t newest_version) const {
  if (!has_attribute("/", "format")) {
    impl_->fail("attribute format",
                fmt::format("expected \"{}\", found no such attribute", format));
  }
  const std::string found = attribute_text("/", "format");
  if (found != format) {
    impl_->fail("attribute format", fmt::format("expected \"{}\", found \"{}\"", format, found));
  }
  const std::int64_t version = attribute_integer("/", "version");
  if (version < 1 || version > newest_version) {
    const std::string expected = newest_version == 1 ? "1" : fmt::format("1 to {}", newest_version);
    impl_->fail("attribute version", fmt::format("expected {}, found {}", expected, version));
  }
  return version;
}

}  // namespace uniphy::hdf5
