#include "uniphy/io/material_parameters.hpp"

#include <limits>
#include <string>

namespace uniphy {

MaterialParameters no_parameters() {
  MaterialParameters parameters;
  parameters.fill(std::numeric_limits<double>::quiet_NaN());
  return parameters;
}

MaterialParameters parameters_of(const kernels::LawDescription& law) {
  MaterialParameters parameters = no_parameters();
  for (const kernels::LawParameter& p : kernels::law_parameters(law.id)) {
    if (p.place < kernels::kFamilyParameters)
      parameters[static_cast<std::size_t>(p.place)] = law.*p.member;
  }
  return parameters;
}

hdf5::Info material_parameter_info(int count) {
  std::string units, names;
  for (const kernels::LawParameter& p : kernels::kLawParameterTable) {
    if (p.place >= count) continue;
    units += (p.place == 0 ? "" : ", ") + std::string(p.unit);
    names += (p.place == 0 ? "" : ", ") + std::string(p.name);
  }
  return {units, names + "; NaN where there is none"};
}

}  // namespace uniphy
