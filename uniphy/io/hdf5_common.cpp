#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "uniphy/io/hdf5_handle.hpp"

namespace uniphy::hdf5 {

std::string shape_text(const Shape& shape) { return fmt::format("[{}]", fmt::join(shape, ", ")); }

void prepare_hdf5() {
  static const bool once = [] {
    // Every file is closed by its reader or writer. Where that failed (a full disk) HDF5 would try
    // again in its exit handler, and end the program with a segmentation fault.
    H5dont_atexit();
    return true;
  }();
  (void)once;
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

std::string hdf5_reason() {
  std::string reason;
  const auto visit = [](unsigned, const H5E_error2_t* error, void* data) -> herr_t {
    auto& text = *static_cast<std::string*>(data);
    const std::string found = error->desc ? error->desc : "";
    // What the system says stands within "errno = 28, error message = 'No space left on device'".
    const std::string mark = "error message = '";
    const std::size_t start = found.find(mark);
    if (start != found.npos) {
      text = found.substr(start + mark.size());
      text.resize(std::min(text.size(), text.find('\'')));
      return 1;
    }
    if (text.empty()) text = found;
    // Where a checksum fails, the deepest message says so in HDF5 1.10 and that a filter failed in
    // 1.14.
    for (const char* sign : {"checksum", "filter"}) {
      if (found.find(sign) == found.npos) continue;
      text = "its checksum is wrong, the file is damaged (" + found + ")";
      return 1;
    }
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, visit, &reason);
  H5Eclear2(H5E_DEFAULT);
  return reason.empty() ? "unknown HDF5 error" : reason;
}

Handle text_type(std::size_t size) {
  Handle type = datatype(H5Tcopy(H5T_C_S1));
  H5Tset_size(type, size > 0 ? size : 1);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

std::string type_text(hid_t type) {
  const std::size_t bits = 8 * H5Tget_size(type);
  switch (H5Tget_class(type)) {
    case H5T_INTEGER:
      return fmt::format("{}int{}", H5Tget_sign(type) == H5T_SGN_NONE ? "u" : "", bits);
    case H5T_FLOAT:
      return fmt::format("float{}", bits);
    case H5T_STRING:
      return "text";
    case H5T_COMPOUND:
      return "compound values";
    case H5T_ENUM:
      return "enumerated values";
    case H5T_VLEN:
      return "variable-length lists";
    default:
      return "another type";
  }
}

}  // namespace uniphy::hdf5
