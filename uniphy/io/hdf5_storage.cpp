// What a dataset's header claims, held against what the file can hold.

#include <fmt/format.h>

#include <algorithm>

#include "uniphy/io/hdf5_handle.hpp"
#include "uniphy/io/hdf5_reader_impl.hpp"

namespace uniphy::hdf5 {
namespace {

/// deflate cannot shrink data further than this.
constexpr double kLargestCompression = 1040;

}  // namespace

void Reader::Impl::check_storage(const std::string& name, const Handle& set,
                                 const Shape& shape) const {
  const Handle properties = property_list(H5Dget_create_plist(set));
  const Handle type = datatype(H5Dget_type(set));
  if (!properties.valid() || !type.valid()) {
    fail(name, fmt::format("cannot be read: {}", hdf5_reason()));
  }
  const H5D_layout_t layout = H5Pget_layout(properties);
  if (layout == H5D_VIRTUAL || H5Pget_external_count(properties) > 0) {
    fail(name, "expected data inside the file, found a reference to another file");
  }
  bool deflated = false;
  const int filters = H5Pget_nfilters(properties);
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    char text[64] = "";
    const H5Z_filter_t filter = H5Pget_filter2(properties, static_cast<unsigned>(i), &flags,
                                               &values, nullptr, sizeof text, text, nullptr);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE &&
        filter != H5Z_FILTER_FLETCHER32) {
      fail(name,
           fmt::format("expected data stored plainly or with gzip, found the filter {} (\"{}\")",
                       static_cast<int>(filter), text));
    }
    deflated = deflated || filter == H5Z_FILTER_DEFLATE;
  }
  // In floating point: a hostile header's product overflows 64 bits.
  double claimed = static_cast<double>(H5Tget_size(type));
  for (const std::int64_t extent : shape) claimed *= static_cast<double>(extent);
  double largest = claimed;
  if (layout == H5D_CHUNKED && !shape.empty()) {
    std::vector<hsize_t> chunk(shape.size());
    H5Pget_chunk(properties, static_cast<int>(chunk.size()), chunk.data());
    double bytes = static_cast<double>(H5Tget_size(type));
    for (const hsize_t extent : chunk) bytes *= static_cast<double>(extent);
    // A chunk that is larger than its dataset is stored whole all the same.
    largest = std::max(largest, bytes);
  }
  const double limit = static_cast<double>(file_bytes) * (deflated ? kLargestCompression : 1.0);
  const hsize_t stored = H5Dget_storage_size(set);
  if (claimed > limit || (claimed > 0 && stored == 0) ||
      largest > std::max(limit, 64.0 * 1024 * 1024)) {
    fail(name, fmt::format("the shape {} claims {:.6g} bytes, found {} bytes of data in a file of "
                           "{}; the file is damaged",
                           shape_text(shape), claimed, stored, file_bytes));
  }
}

}  // namespace uniphy::hdf5
