#pragma once

#include <string>
#include <vector>

#include "uniphy/io/hdf5.hpp"

namespace uniphy {

/// Saved optimizers as the datasets /optimizers, their bytes one after the other, eight in a word
/// (so that HDF5 keeps a checksum of them), and /optimizer_sizes.
void write_optimizers(hdf5::Writer& writer, const std::vector<std::string>& optimizers);
/// `count` of them. Throws Error where the sizes do not fit.
std::vector<std::string> read_optimizers(const hdf5::Reader& reader, std::int64_t count);

}  // namespace uniphy
