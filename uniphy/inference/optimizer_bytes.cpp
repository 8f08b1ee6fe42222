#include "uniphy/inference/optimizer_bytes.hpp"

#include <cstdint>
#include <cstring>

namespace uniphy {
namespace {

std::vector<std::int64_t> words(const std::string& bytes) {
  std::vector<std::int64_t> result((bytes.size() + 7) / 8, 0);
  if (!bytes.empty()) std::memcpy(result.data(), bytes.data(), bytes.size());
  return result;
}

}  // namespace

void write_optimizers(hdf5::Writer& writer, const std::vector<std::string>& optimizers) {
  std::string bytes;
  std::vector<std::int64_t> sizes;
  for (const std::string& optimizer : optimizers) {
    bytes += optimizer;
    sizes.push_back(static_cast<std::int64_t>(optimizer.size()));
  }
  const std::vector<std::int64_t> all = words(bytes);
  writer.write("optimizers", all, {static_cast<std::int64_t>(all.size())},
               {"1", "Torch archives of the optimizers, one after the other"});
  writer.write("optimizer_sizes", sizes, {static_cast<std::int64_t>(sizes.size())},
               {"1", "bytes of each"});
}

std::vector<std::string> read_optimizers(const hdf5::Reader& reader, std::int64_t count) {
  const auto sizes = reader.read<std::int64_t>("optimizer_sizes", {count});
  const auto all = reader.read<std::int64_t>("optimizers", {-1});
  const std::string bytes(reinterpret_cast<const char*>(all.data()), 8 * all.size());
  std::vector<std::string> result;
  std::size_t at = 0;
  for (const std::int64_t size : sizes) {
    if (size < 0 || static_cast<std::size_t>(size) > bytes.size() - at) {
      reader.fail("/optimizer_sizes", "expected sizes that /optimizers has room for");
    }
    result.push_back(bytes.substr(at, static_cast<std::size_t>(size)));
    at += static_cast<std::size_t>(size);
  }
  return result;
}

}  // namespace uniphy
