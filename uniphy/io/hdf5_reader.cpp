#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/hdf5_handle.hpp"
#include "uniphy/io/hdf5_reader_impl.hpp"
#include "uniphy/io/text_lines.hpp"

namespace uniphy::hdf5 {
namespace {

template <class T>
constexpr bool is_real = std::is_floating_point_v<T>;

bool fits(const Shape& shape, const Shape& expected) {
  if (shape.size() != expected.size()) return false;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (expected[i] >= 0 && shape[i] != expected[i]) return false;
  }
  return true;
}

}  // namespace

void Reader::Impl::fail(const std::string& object, const std::string& message) const {
  throw Error(fmt::format("{}: {}: {}", path.string(), object, message));
}

bool Reader::Impl::exists(const std::string& name) const {
  const std::string full = rooted(name);
  if (full == "/") return true;
  for (std::size_t slash = full.find('/', 1);; slash = full.find('/', slash + 1)) {
    const std::string part = full.substr(0, slash);
    if (H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0) {
      H5Eclear2(H5E_DEFAULT);
      return false;
    }
    H5L_info_t info;
    if (H5Lget_info(file, part.c_str(), &info, H5P_DEFAULT) >= 0 && info.type != H5L_TYPE_HARD &&
        info.type != H5L_TYPE_SOFT) {
      fail(part, "expected data inside the file, found a link to another file");
    }
    if (H5Oexists_by_name(file, part.c_str(), H5P_DEFAULT) <= 0) {
      H5Eclear2(H5E_DEFAULT);
      return false;
    }
    if (slash == std::string::npos) return true;
  }
}

Handle Reader::Impl::open(const std::string& name) const {
  if (!exists(name)) fail(name, "expected a dataset, found nothing of that name");
  Handle object = object_handle(H5Oopen(file, name.c_str(), H5P_DEFAULT));
  if (!object.valid()) fail(name, fmt::format("cannot be opened: {}", hdf5_reason()));
  if (H5Iget_type(object) != H5I_DATASET) fail(name, "expected a dataset, found a group");
  return object;
}

Shape Reader::Impl::shape_of(const std::string& name, const Handle& set) const {
  const Handle space = dataspace(H5Dget_space(set));
  const int rank = space.valid() ? H5Sget_simple_extent_ndims(space) : -1;
  if (rank < 0) fail(name, fmt::format("cannot be read: {}", hdf5_reason()));
  std::vector<hsize_t> size(static_cast<std::size_t>(rank));
  H5Sget_simple_extent_dims(space, size.data(), nullptr);
  Shape shape;
  for (const hsize_t extent : size) {
    if (extent > static_cast<hsize_t>(std::numeric_limits<std::int64_t>::max())) {
      fail(name, "expected extents below 2^63");
    }
    shape.push_back(static_cast<std::int64_t>(extent));
  }
  return shape;
}

Reader::Reader(const std::filesystem::path& file) : impl_(std::make_unique<Impl>()) {
  prepare_hdf5();
  impl_->path = file;
  const auto refuse = [&](const std::string& message) {
    throw Error(fmt::format("{}: {}", file.string(), message));
  };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status)) refuse("expected an HDF5 file, found nothing of that name");
  if (std::filesystem::is_directory(status)) refuse("expected an HDF5 file, found a directory");
  if (std::FILE* stream = std::fopen(file.c_str(), "rb")) {
    std::fclose(stream);
  } else {
    refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
  }
  impl_->file_bytes = static_cast<std::int64_t>(std::filesystem::file_size(file, error));
  if (error) refuse(fmt::format("cannot be read: {}", error.message()));
  if (impl_->file_bytes == 0) refuse("expected an HDF5 file, found an empty file");
  if (H5Fis_hdf5(file.c_str()) <= 0) refuse("expected an HDF5 file, found another format");
  impl_->file = file_handle(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!impl_->file.valid()) {
    const std::string reason = hdf5_reason();
    const bool truncated = reason.find("truncated") != std::string::npos;
    refuse(truncated ? fmt::format("expected a whole HDF5 file, found a truncated one ({})", reason)
                     : fmt::format("cannot be opened as HDF5: {}", reason));
  }
}
Reader::~Reader() = default;
Reader::Reader(Reader&&) noexcept = default;
Reader& Reader::operator=(Reader&&) noexcept = default;

const std::filesystem::path& Reader::file() const { return impl_->path; }

void Reader::fail(const std::string& object, const std::string& message) const {
  impl_->fail(object, message);
}

bool Reader::has(const std::string& name) const { return impl_->exists(name); }

std::vector<std::string> Reader::members(const std::string& group) const {
  const std::string name = rooted(group);
  if (!impl_->exists(name)) impl_->fail(name, "expected a group, found nothing of that name");
  const Handle object = object_handle(H5Oopen(impl_->file, name.c_str(), H5P_DEFAULT));
  if (!object.valid() || H5Iget_type(object) != H5I_GROUP) {
    impl_->fail(name, "expected a group, found a dataset");
  }
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* member, const H5L_info_t*, void* data) -> herr_t {
    static_cast<std::vector<std::string>*>(data)->emplace_back(member);
    return 0;
  };
  if (H5Literate(object, H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names) < 0) {
    impl_->fail(name, fmt::format("cannot be listed: {}", hdf5_reason()));
  }
  return names;
}

Shape Reader::shape(const std::string& name) const {
  const std::string full = rooted(name);
  return impl_->shape_of(full, impl_->open(full));
}

template <class T>
std::vector<T> Reader::Impl::read(const std::string& name, const Shape& expected,
                                  std::int64_t first, std::int64_t rows, Values values) const {
  const Handle set = open(name);
  const Handle type = datatype(H5Dget_type(set));
  const H5T_class_t found = type.valid() ? H5Tget_class(type) : H5T_NO_CLASS;
  if (found != H5T_INTEGER && !(is_real<T> && found == H5T_FLOAT)) {
    fail(name, fmt::format("expected {}, found {}", is_real<T> ? "numbers" : "integers",
                           type_text(type)));
  }
  const Shape shape = shape_of(name, set);
  if (!fits(shape, expected)) {
    fail(name,
         fmt::format("expected the shape {}, found {}", shape_text(expected), shape_text(shape)));
  }
  check_storage(name, set, shape);
  if constexpr (!is_real<T>) {
    const bool has_sign = H5Tget_sign(type) != H5T_SGN_NONE;
    if (H5Tget_size(type) + (has_sign ? 0 : 1) > sizeof(std::int64_t)) {
      fail(name, fmt::format("expected integers of at most 64 bits with sign, found {}",
                             type_text(type)));
    }
    if constexpr (sizeof(T) < sizeof(std::int64_t)) {
      if (H5Tget_size(type) + (has_sign ? 0 : 1) > sizeof(T)) {
        const auto wide = read<std::int64_t>(name, expected, first, rows, values);
        for (const std::int64_t value : wide) {
          if (value < std::numeric_limits<T>::min() || value > std::numeric_limits<T>::max()) {
            fail(name, fmt::format("expected integers of {} bits, found {}", 8 * sizeof(T), value));
          }
        }
        return std::vector<T>(wide.begin(), wide.end());
      }
    }
  }

  std::vector<hsize_t> start(shape.size(), 0);
  std::vector<hsize_t> count(shape.begin(), shape.end());
  if (rows >= 0) {
    if (shape.empty() || first < 0 || first > shape[0] || rows > shape[0] - first) {
      fail(name, fmt::format("expected rows {} to {}, found {} rows", first, first + rows,
                             shape.empty() ? 0 : shape[0]));
    }
    start[0] = static_cast<hsize_t>(first);
    count[0] = static_cast<hsize_t>(rows);
  }
  std::size_t size = 1;
  for (const hsize_t extent : count) size *= extent;
  std::vector<T> data(size);
  if (size > 0) {
    const Handle file_space = dataspace(H5Dget_space(set));
    const Handle memory_space = dataspace(
        shape.empty() ? H5Screate(H5S_SCALAR)
                      : H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr));
    if ((!shape.empty() && H5Sselect_hyperslab(file_space, H5S_SELECT_SET, start.data(), nullptr,
                                               count.data(), nullptr) < 0) ||
        H5Dread(set, native_type<T>(), memory_space, file_space, H5P_DEFAULT, data.data()) < 0) {
      fail(name, fmt::format("cannot be read: {}", hdf5_reason()));
    }
  }
  if constexpr (is_real<T>) {
    if (values == Values::finite) {
      const auto bad =
          std::find_if(data.begin(), data.end(), [](T v) { return !std::isfinite(v); });
      if (bad != data.end()) {
        fail(name, fmt::format("expected finite numbers, found {} at position {}",
                               static_cast<double>(*bad), bad - data.begin()));
      }
    }
  }
  return data;
}

template <class T>
std::vector<T> Reader::read(const std::string& name, const Shape& expected, Values values) const {
  return impl_->read<T>(rooted(name), expected, 0, -1, values);
}

template <class T>
std::vector<T> Reader::read_rows(const std::string& name, const Shape& expected, std::int64_t first,
                                 std::int64_t count, Values values) const {
  return impl_->read<T>(rooted(name), expected, first, std::max<std::int64_t>(count, 0), values);
}

void check_magnitude(const Reader& reader, const std::string& object,
                     const std::vector<double>& data, double limit) {
  for (std::size_t i = 0; i < data.size(); ++i) {
    if (std::abs(data[i]) <= limit) continue;
    reader.fail(object, fmt::format("expected numbers of at most {:g} either way, found {} at "
                                    "position {}",
                                    limit, data[i], i));
  }
}

std::vector<std::string> Reader::read_strings(const std::string& name, std::int64_t count) const {
  const std::string full = rooted(name);
  const Handle set = impl_->open(full);
  const Handle type = datatype(H5Dget_type(set));
  if (!type.valid() || H5Tget_class(type) != H5T_STRING) {
    impl_->fail(full, fmt::format("expected text, found {}", type_text(type)));
  }
  const Shape shape = impl_->shape_of(full, set);
  if (!fits(shape, {count})) {
    impl_->fail(full, fmt::format("expected the shape {}, found {}", shape_text({count}),
                                  shape_text(shape)));
  }
  impl_->check_storage(full, set, shape);
  std::vector<std::string> texts;
  if (shape[0] == 0) return texts;
  const auto size = static_cast<std::size_t>(shape[0]);
  if (H5Tis_variable_str(type) > 0) {
    // The file's own character set: HDF5 does not convert between ASCII and UTF-8.
    const Handle memory_type = text_type(H5T_VARIABLE);
    H5Tset_cset(memory_type, H5Tget_cset(type));
    std::vector<char*> pointers(size, nullptr);
    if (H5Dread(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0) {
      impl_->fail(full, fmt::format("cannot be read: {}", hdf5_reason()));
    }
    for (const char* pointer : pointers) texts.emplace_back(pointer ? pointer : "");
    const Handle space = dataspace(H5Dget_space(set));
    H5Dvlen_reclaim(memory_type, space, H5P_DEFAULT, pointers.data());
  } else {
    const std::size_t width = H5Tget_size(type);
    std::vector<char> buffer(size * width);
    if (H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, buffer.data()) < 0) {
      impl_->fail(full, fmt::format("cannot be read: {}", hdf5_reason()));
    }
    for (std::size_t i = 0; i < size; ++i) {
      const char* text = buffer.data() + i * width;
      texts.emplace_back(text, strnlen(text, width));
    }
  }
  for (const std::string& text : texts) {
    if (is_utf8(text)) continue;
    impl_->fail(full, fmt::format("expected UTF-8 text, found {}", quoted_word(text)));
  }
  return texts;
}

#define UNIPHY_INSTANTIATE(T)                                                               \
  template std::vector<T> Reader::read(const std::string&, const Shape&, Values) const;     \
  template std::vector<T> Reader::read_rows(const std::string&, const Shape&, std::int64_t, \
                                            std::int64_t, Values) const;
UNIPHY_INSTANTIATE(double)
UNIPHY_INSTANTIATE(float)
UNIPHY_INSTANTIATE(std::int32_t)
UNIPHY_INSTANTIATE(std::int64_t)
#undef UNIPHY_INSTANTIATE

}  // namespace uniphy::hdf5
