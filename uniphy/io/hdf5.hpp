#pragma once

// HDF5 through its C API (1.10 to 1.14) with errors as uniphy::Error naming the file, the dataset,
// what was expected and what was found. The HDF5 library is not safe to call from several threads:
// use readers and writers from one thread at a time.
//
// Names are paths from the root ("/samples/F"); groups on the way are made. Arrays are row-major.
// Text is written as UTF-8 of fixed length (h5py shows it as bytes) and read with any length.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace uniphy::hdf5 {

/// Extents; -1 in an expected shape accepts any extent.
using Shape = std::vector<std::int64_t>;

/// "[20, -1, 3]"
std::string shape_text(const Shape& shape);

/// What every dataset carries as attributes, and how it is stored.
struct Info {
  std::string units;  ///< "m", "Pa", "1" where there are none
  std::string description;
  int gzip = 0;  ///< 0: not compressed; 1 to 9: byte shuffle and deflate
};

/// Writes `<file>.tmp`; commit() flushes it to the disk and gives it its name. Without commit()
/// the temporary file is removed and an older `file` stays as it was.
class Writer {
 public:
  explicit Writer(const std::filesystem::path& file);
  ~Writer();
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;

  /// T in {double, float, int32_t, int64_t}; data.size() must be the product of the shape.
  template <class T>
  void write(const std::string& name, const std::vector<T>& data, const Shape& shape,
             const Info& info);
  template <class T>
  void write(const std::string& name, const T* data, const Shape& shape, const Info& info);
  void write_strings(const std::string& name, const std::vector<std::string>& data,
                     const Info& info);

  /// Makes an empty dataset [0, row...] that append() extends along its first axis.
  template <class T>
  void extendible(const std::string& name, const Shape& row, const Info& info);
  /// Appends `rows` rows; T may differ from the stored type in precision, not in class.
  template <class T>
  void append(const std::string& name, const T* data, std::int64_t rows);
  template <class T>
  void append(const std::string& name, const std::vector<T>& data);
  /// Makes the dataset `name` that shows row `row` of the extendible dataset `of` and holds no data
  /// of its own (a virtual dataset, which HDF5 reads from release 1.10 on; the rest of the file
  /// stays readable to 1.8). It has no attributes.
  void row_view(const std::string& name, const std::string& of, std::int64_t row);

  /// Attributes of a group or dataset ("/" is the file's own); an older value is replaced.
  void attribute(const std::string& object, const std::string& name, const std::string& value);
  void attribute(const std::string& object, const std::string& name, const char* value);
  void attribute(const std::string& object, const std::string& name, double value);
  void attribute(const std::string& object, const std::string& name, std::int64_t value);
  void attribute(const std::string& object, const std::string& name, int value);
  void attribute(const std::string& object, const std::string& name,
                 const std::vector<double>& value);
  void group(const std::string& name);

  /// Makes what was written so far safe in the temporary file (for very long runs).
  void flush();
  void commit();
  /// The same for a file that a later run goes on from (seal.hpp).
  void commit_sealed();
  const std::filesystem::path& file() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether a reader accepts NaN and infinities.
enum class Values { any, finite };

/// Throws Error `file: object: ...` where a number is larger than `limit` either way: damage that
/// would only show as something else, steps later.
void check_magnitude(const class Reader& reader, const std::string& object,
                     const std::vector<double>& data, double limit);

/// Opens a file for reading. Before anything is allocated, the type class, the rank and the extents
/// are checked, and the size is held against that of the file (a header that claims more data than
/// the file can hold is refused). External links, external storage, virtual datasets and filters
/// other than deflate, shuffle and fletcher32 are refused.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& file);
  ~Reader();
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;

  bool has(const std::string& name) const;
  bool has_attribute(const std::string& object, const std::string& name) const;
  /// Names of the members of a group, sorted.
  std::vector<std::string> members(const std::string& group) const;
  Shape shape(const std::string& dataset) const;

  /// T in {double, float, int32_t, int64_t}: floating-point types read numbers of any kind and
  /// precision, integers read integer datasets whose values fit.
  template <class T>
  std::vector<T> read(const std::string& name, const Shape& expected,
                      Values values = Values::any) const;
  /// Rows [first, first + count) along the first axis of a dataset [expected...].
  template <class T>
  std::vector<T> read_rows(const std::string& name, const Shape& expected, std::int64_t first,
                           std::int64_t count, Values values = Values::any) const;
  /// A dataset of strings [count] (fixed or variable length); -1 accepts any count.
  std::vector<std::string> read_strings(const std::string& name, std::int64_t count = -1) const;

  std::string attribute_text(const std::string& object, const std::string& name) const;
  double attribute_real(const std::string& object, const std::string& name) const;
  /// A real number will do where it is whole.
  std::int64_t attribute_integer(const std::string& object, const std::string& name) const;
  /// A rank-1 attribute of numbers; -1 accepts any count up to 4096.
  std::vector<double> attribute_reals(const std::string& object, const std::string& name,
                                      std::int64_t count = -1) const;

  /// Checks the root attributes `format` and `version` (1 up to the newest known version).
  std::int64_t check_format(const std::string& format, std::int64_t newest_version) const;
  /// Error `file: object: message`.
  [[noreturn]] void fail(const std::string& object, const std::string& message) const;
  const std::filesystem::path& file() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace uniphy::hdf5
