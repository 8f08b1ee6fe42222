#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/hdf5_handle.hpp"
#include "uniphy/io/seal.hpp"

namespace uniphy::hdf5 {
namespace {

std::vector<hsize_t> extents(const Shape& shape) { return {shape.begin(), shape.end()}; }

/// Rows a chunk: about half a MiB, so that a chunk fits HDF5's chunk cache, and few enough that
/// short datasets waste little.
hsize_t chunk_rows(std::int64_t row_bytes) {
  constexpr std::int64_t target = 1 << 19;
  constexpr std::int64_t maximum = 1024;
  return static_cast<hsize_t>(
      std::clamp<std::int64_t>(target / std::max<std::int64_t>(row_bytes, 1), 1, maximum));
}

}  // namespace

struct Writer::Impl {
  std::filesystem::path path;
  std::filesystem::path temporary;
  bool made = false;  ///< the temporary file
  Handle file;
  struct Extendible {
    Handle set;
    std::vector<hsize_t> size;  ///< [rows so far, row...]
    std::int64_t row_count;     ///< numbers a row
  };
  std::map<std::string, Extendible> extendible;

  ~Impl() {
    extendible.clear();
    file.reset();
    std::error_code ignored;  // not there after commit()
    if (made) std::filesystem::remove(temporary, ignored);
  }

  /// Everything to the file, and the file closed.
  void finish() {
    for (auto& [name, dataset] : extendible) close(dataset.set, name);
    if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0) fail_hdf5("/", "written");
    close(file, "/");
  }

  [[noreturn]] void fail(const std::string& name, const std::string& message) const {
    throw Error(fmt::format("{}: {}: {}", path.string(), name, message));
  }
  [[noreturn]] void fail_hdf5(const std::string& name, const std::string& doing) const {
    fail(name, fmt::format("cannot be {}: {}", doing, hdf5_reason()));
  }
  /// Data may reach the disk as late as here.
  void close(Handle& handle, const std::string& name) const {
    if (!handle.reset()) fail_hdf5(name, "written");
  }

  void set_text(const std::string& object, const std::string& name, const std::string& value) {
    const Handle type = text_type(value.size());
    set_attribute(object, name, type, dataspace(H5Screate(H5S_SCALAR)), type, value.c_str());
  }

  void set_attribute(const std::string& object, const std::string& name, hid_t file_type,
                     const Handle& space, hid_t memory_type, const void* data) {
    if (H5Aexists_by_name(file, object.c_str(), name.c_str(), H5P_DEFAULT) > 0) {
      H5Adelete_by_name(file, object.c_str(), name.c_str(), H5P_DEFAULT);
    }
    Handle attribute =
        attribute_handle(H5Acreate_by_name(file, object.c_str(), name.c_str(), file_type, space,
                                           H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    if (!attribute.valid() || H5Awrite(attribute, memory_type, data) < 0) {
      fail_hdf5(fmt::format("attribute {} of {}", name, object), "written");
    }
    close(attribute, fmt::format("attribute {} of {}", name, object));
  }

  /// Makes the group and those above it, where they are not there yet.
  void make_group(const std::string& name) {
    const Handle properties = property_list(H5Pcreate(H5P_GROUP_CREATE));
    H5Pset_obj_track_times(properties, false);
    for (std::size_t slash = 0; slash != std::string::npos;) {
      slash = name.find('/', slash + 1);
      const std::string part = name.substr(0, slash);
      if (H5Lexists(file, part.c_str(), H5P_DEFAULT) > 0) continue;
      Handle group =
          group_handle(H5Gcreate2(file, part.c_str(), H5P_DEFAULT, properties, H5P_DEFAULT));
      if (!group.valid()) fail_hdf5(part, "made");
      close(group, part);
    }
  }

  Handle create(const std::string& name, hid_t type, const Handle& space,
                const std::vector<hsize_t>& chunk, const Info& info) {
    const std::size_t slash = name.rfind('/');
    if (slash > 0) make_group(name.substr(0, slash));
    const Handle storage = property_list(H5Pcreate(H5P_DATASET_CREATE));
    H5Pset_obj_track_times(storage, false);
    if (!chunk.empty()) {
      H5Pset_chunk(storage, static_cast<int>(chunk.size()), chunk.data());
      if (info.gzip > 0) {
        H5Pset_shuffle(storage);
        H5Pset_deflate(storage, static_cast<unsigned>(std::min(info.gzip, 9)));
      }
      H5Pset_fletcher32(storage);  // a bit that flips on the disk is an error when it is read
    }
    Handle set =
        dataset(H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, storage, H5P_DEFAULT));
    if (!set.valid()) fail_hdf5(name, "made");
    set_text(name, "units", info.units);
    set_text(name, "description", info.description);
    return set;
  }
};

Writer::Writer(const std::filesystem::path& file) : impl_(std::make_unique<Impl>()) {
  prepare_hdf5();
  impl_->path = file;
  impl_->temporary = temporary_name(file);
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    throw Error(fmt::format("{}: expected a file, found a directory", file.string()));
  }
  // The format of HDF5 1.8 has checksums on its metadata, so that damage is found, and takes text
  // attributes longer than 64 KiB. Only row views need that of 1.10.
  const Handle access = property_list(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_V110);
  // No times anywhere: the same data make the same file, byte for byte.
  const Handle creation = property_list(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_obj_track_times(creation, false);
  errno = 0;
  impl_->file = file_handle(H5Fcreate(impl_->temporary.c_str(), H5F_ACC_TRUNC, creation, access));
  if (!impl_->file.valid()) {
    const std::string reason = errno ? std::strerror(errno) : hdf5_reason();
    std::filesystem::remove(impl_->temporary, ignored);
    throw Error(fmt::format("{}: cannot be written: {}", file.string(), reason));
  }
  impl_->made = true;
}
Writer::~Writer() = default;
Writer::Writer(Writer&&) noexcept = default;
Writer& Writer::operator=(Writer&&) noexcept = default;

const std::filesystem::path& Writer::file() const { return impl_->path; }

template <class T>
void Writer::write(const std::string& name, const T* data, const Shape& shape, const Info& info) {
  const std::string full = rooted(name);
  const std::vector<hsize_t> size = extents(shape);
  std::vector<hsize_t> chunk;
  std::int64_t count = 1;
  for (const std::int64_t extent : shape) count *= extent;
  if (count > 0 && !shape.empty()) {  // chunks are what has a checksum
    chunk = size;
    chunk[0] =
        std::min(size[0], chunk_rows(count / shape[0] * static_cast<std::int64_t>(sizeof(T))));
  }
  const Handle space = dataspace(
      shape.empty() ? H5Screate(H5S_SCALAR)
                    : H5Screate_simple(static_cast<int>(size.size()), size.data(), nullptr));
  Handle set = impl_->create(full, native_type<T>(), space, chunk, info);
  if (count > 0 && H5Dwrite(set, native_type<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, data) < 0) {
    impl_->fail_hdf5(full, "written");
  }
  impl_->close(set, full);
}

template <class T>
void Writer::write(const std::string& name, const std::vector<T>& data, const Shape& shape,
                   const Info& info) {
  std::int64_t count = 1;
  for (const std::int64_t extent : shape) count *= extent;
  if (count != static_cast<std::int64_t>(data.size())) {
    impl_->fail(rooted(name), fmt::format("expected {} numbers for the shape {}, found {}", count,
                                          shape_text(shape), data.size()));
  }
  write(name, data.data(), shape, info);
}

void Writer::write_strings(const std::string& name, const std::vector<std::string>& data,
                           const Info& info) {
  const std::string full = rooted(name);
  const hsize_t size = data.size();
  const Handle space = dataspace(H5Screate_simple(1, &size, nullptr));
  std::size_t width = 1;
  for (const std::string& text : data) width = std::max(width, text.size());
  const Handle type = text_type(width);
  Handle set = impl_->create(full, type, space, {}, info);
  std::string padded;
  for (const std::string& text : data) {
    padded += text;
    padded.append(width - text.size(), '\0');
  }
  if (!data.empty() && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()) < 0) {
    impl_->fail_hdf5(full, "written");
  }
  impl_->close(set, full);
}

template <class T>
void Writer::extendible(const std::string& name, const Shape& row, const Info& info) {
  const std::string full = rooted(name);
  std::vector<hsize_t> size = extents(row);
  std::int64_t row_count = 1;
  for (const std::int64_t extent : row) row_count *= extent;
  if (row_count <= 0) impl_->fail(full, "expected rows of at least one number");
  size.insert(size.begin(), 0);
  std::vector<hsize_t> maximum = size;
  maximum[0] = H5S_UNLIMITED;
  std::vector<hsize_t> chunk = size;
  chunk[0] = chunk_rows(row_count * static_cast<std::int64_t>(sizeof(T)));
  const Handle space =
      dataspace(H5Screate_simple(static_cast<int>(size.size()), size.data(), maximum.data()));
  Handle set = impl_->create(full, native_type<T>(), space, chunk, info);
  impl_->extendible[full] = {std::move(set), size, row_count};
}

template <class T>
void Writer::append(const std::string& name, const T* data, std::int64_t rows) {
  const std::string full = rooted(name);
  const auto found = impl_->extendible.find(full);
  if (found == impl_->extendible.end()) impl_->fail(full, "expected an extendible dataset");
  if (rows == 0) return;
  Impl::Extendible& target = found->second;
  std::vector<hsize_t> start(target.size.size(), 0);
  std::vector<hsize_t> count = target.size;
  start[0] = target.size[0];
  count[0] = static_cast<hsize_t>(rows);
  target.size[0] += static_cast<hsize_t>(rows);
  bool good = H5Dset_extent(target.set, target.size.data()) >= 0;
  const Handle file_space = dataspace(H5Dget_space(target.set));
  const Handle memory_space =
      dataspace(H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr));
  good = good &&
         H5Sselect_hyperslab(file_space, H5S_SELECT_SET, start.data(), nullptr, count.data(),
                             nullptr) >= 0 &&
         H5Dwrite(target.set, native_type<T>(), memory_space, file_space, H5P_DEFAULT, data) >= 0;
  if (!good) impl_->fail_hdf5(full, "extended");
}

template <class T>
void Writer::append(const std::string& name, const std::vector<T>& data) {
  const std::string full = rooted(name);
  const auto found = impl_->extendible.find(full);
  const std::int64_t row = found == impl_->extendible.end() ? 1 : found->second.row_count;
  if (static_cast<std::int64_t>(data.size()) % row != 0) {
    impl_->fail(full, fmt::format("expected whole rows of {} numbers, found {}", row, data.size()));
  }
  append(name, data.data(), static_cast<std::int64_t>(data.size()) / row);
}

void Writer::row_view(const std::string& name, const std::string& of, std::int64_t row) {
  const std::string full = rooted(name), source = rooted(of);
  const auto found = impl_->extendible.find(source);
  if (found == impl_->extendible.end()) impl_->fail(source, "expected an extendible dataset");
  const std::vector<hsize_t>& size = found->second.size;
  if (row < 0 || static_cast<hsize_t>(row) >= size[0]) {
    impl_->fail(source, fmt::format("expected a row below {}, found {}", size[0], row));
  }
  std::vector<hsize_t> start(size.size(), 0), count = size;
  start[0] = static_cast<hsize_t>(row);
  count[0] = 1;
  const auto rank = static_cast<int>(size.size());
  const Handle rows = dataspace(H5Screate_simple(rank, size.data(), nullptr));
  const Handle one = dataspace(H5Screate_simple(rank - 1, size.data() + 1, nullptr));
  const Handle type = datatype(H5Dget_type(found->second.set));
  const Handle storage = property_list(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(storage, false);
  impl_->make_group(full.substr(0, full.rfind('/')));
  // "." is the file itself, wherever it is and whatever it is called.
  const bool good = H5Sselect_hyperslab(rows, H5S_SELECT_SET, start.data(), nullptr, count.data(),
                                        nullptr) >= 0 &&
                    H5Pset_virtual(storage, one, ".", source.c_str(), rows) >= 0;
  Handle view;
  if (good) {
    view = dataset(
        H5Dcreate2(impl_->file, full.c_str(), type, one, H5P_DEFAULT, storage, H5P_DEFAULT));
  }
  if (!view.valid()) impl_->fail_hdf5(full, "made");
  impl_->close(view, full);
}

void Writer::attribute(const std::string& object, const std::string& name,
                       const std::string& value) {
  impl_->set_text(rooted(object), name, value);
}
void Writer::attribute(const std::string& object, const std::string& name, const char* value) {
  impl_->set_text(rooted(object), name, value);
}
void Writer::attribute(const std::string& object, const std::string& name, double value) {
  impl_->set_attribute(rooted(object), name, H5T_NATIVE_DOUBLE, dataspace(H5Screate(H5S_SCALAR)),
                       H5T_NATIVE_DOUBLE, &value);
}
void Writer::attribute(const std::string& object, const std::string& name, std::int64_t value) {
  impl_->set_attribute(rooted(object), name, H5T_NATIVE_INT64, dataspace(H5Screate(H5S_SCALAR)),
                       H5T_NATIVE_INT64, &value);
}
void Writer::attribute(const std::string& object, const std::string& name, int value) {
  attribute(object, name, static_cast<std::int64_t>(value));
}
void Writer::attribute(const std::string& object, const std::string& name,
                       const std::vector<double>& value) {
  const hsize_t size = value.size();
  impl_->set_attribute(rooted(object), name, H5T_NATIVE_DOUBLE,
                       dataspace(H5Screate_simple(1, &size, nullptr)), H5T_NATIVE_DOUBLE,
                       value.data());
}

void Writer::group(const std::string& name) { impl_->make_group(rooted(name)); }

void Writer::flush() {
  if (H5Fflush(impl_->file, H5F_SCOPE_GLOBAL) < 0) impl_->fail_hdf5("/", "flushed");
}

void Writer::commit() {
  impl_->finish();
  replace_atomically(impl_->temporary, impl_->path);
}

void Writer::commit_sealed() {
  impl_->finish();
  seal_file(impl_->temporary, impl_->path);
  replace_atomically(impl_->temporary, impl_->path);
}

#define UNIPHY_INSTANTIATE(T)                                                           \
  template void Writer::write(const std::string&, const T*, const Shape&, const Info&); \
  template void Writer::write(const std::string&, const std::vector<T>&, const Shape&,  \
                              const Info&);                                             \
  template void Writer::extendible<T>(const std::string&, const Shape&, const Info&);   \
  template void Writer::append(const std::string&, const T*, std::int64_t);             \
  template void Writer::append(const std::string&, const std::vector<T>&);
UNIPHY_INSTANTIATE(double)
UNIPHY_INSTANTIATE(float)
UNIPHY_INSTANTIATE(std::int32_t)
UNIPHY_INSTANTIATE(std::int64_t)
#undef UNIPHY_INSTANTIATE

}  // namespace uniphy::hdf5
