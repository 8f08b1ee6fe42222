#pragma once

#include <array>

#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/io/hdf5.hpp"

namespace uniphy {

/// The parameters of one material of the five families as a row of dataset.h5 or model.h5: in the
/// order and the units of kernels::kLawParameterTable, NaN where the law has none.
using MaterialParameters = std::array<double, kernels::kFamilyParameters>;
MaterialParameters no_parameters();
MaterialParameters parameters_of(const kernels::LawDescription& law);

/// The units and the names of the first `count` of the table, for the attributes of such rows.
hdf5::Info material_parameter_info(int count = kernels::kFamilyParameters);

}  // namespace uniphy
