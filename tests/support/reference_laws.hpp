#pragma once

#include <hdf5.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "ops/kernels/laws/law_parameters.hpp"

namespace uniphy::testing {

/// Independently computed samples of one law, tests/data/reference_laws.h5; matrices [samples, 9].
struct ReferenceLaw {
  kernels::LawDescription description;
  double dt = 0;
  std::vector<double> F, C, F_proj, tau;
  std::ptrdiff_t size() const { return static_cast<std::ptrdiff_t>(F.size() / 9); }
};

inline ReferenceLaw read_reference_law(const std::string& law) {
  const std::string path = std::string(UNIPHY_SOURCE_DIR) + "/tests/data/reference_laws.h5";
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file < 0) throw std::runtime_error("cannot open " + path);
  ReferenceLaw r;
  r.description.id = kernels::law_id(law);
  const auto attribute = [&](const char* name) {
    double value = 0;
    const hid_t id = H5Aopen_by_name(file, law.c_str(), name, H5P_DEFAULT, H5P_DEFAULT);
    if (id < 0 || H5Aread(id, H5T_NATIVE_DOUBLE, &value) < 0) throw std::runtime_error(name);
    H5Aclose(id);
    return value;
  };
  const auto dataset = [&](const char* name) {
    const hid_t id = H5Dopen2(file, (law + "/" + name).c_str(), H5P_DEFAULT);
    if (id < 0) throw std::runtime_error(name);
    const hid_t space = H5Dget_space(id);
    std::vector<double> values(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    const herr_t status =
        H5Dread(id, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Sclose(space);
    H5Dclose(id);
    if (status < 0) throw std::runtime_error(name);
    return values;
  };
  r.dt = attribute("dt");
  for (const kernels::LawParameter& p : kernels::law_parameters(r.description.id))
    r.description.*p.member = attribute(p.name);
  r.F = dataset("F");
  r.C = dataset("C");
  r.F_proj = dataset("F_proj");
  r.tau = dataset("tau");
  H5Fclose(file);
  return r;
}

}  // namespace uniphy::testing
