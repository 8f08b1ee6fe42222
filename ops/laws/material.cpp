#include "ops/laws/material.hpp"

#include <string>
#include <utility>

#include "ops/base/tensor_check.hpp"
#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/analytic_law.hpp"
#include "ops/kernels/laws/law_parameters.hpp"

namespace uniphy::ops {

using torch::Tensor;

Parameter::Parameter(double value) : tensor_(torch::scalar_tensor(value, torch::kFloat64)) {}
Parameter::Parameter(Tensor tensor) : tensor_(std::move(tensor)) {}

Material material_of(const kernels::LawDescription& law) {
  Material material;
  for (const kernels::LawParameter& p : kernels::law_parameters(law.id))
    material.*kMaterialMembers[p.place] = law.*p.member;
  return material;
}

Material material_of(const char* op, kernels::LawId law, const Tensor& parameters) {
  const auto& taken = kernels::law_parameters(law);
  const auto type = real_type(op, "parameters", parameters);
  check_tensor(op, "parameters", parameters, type, {std::int64_t(taken.size())});
  Material material;
  std::int64_t k = 0;
  for (const kernels::LawParameter& p : taken)
    material.*kMaterialMembers[p.place] = parameters.select(0, k++);
  return material;
}

Tensor pack_material(const char* op, kernels::LawId law, const Material& m) {
  if (law == kernels::LawId::learned)
    throw Error(std::string(op) + ": law: expected an analytic one, found learned");
  std::vector<Tensor> entries;
  for (const kernels::LawParameter& p : kernels::kLawParameterTable) {
    const Tensor& t = (m.*kMaterialMembers[p.place]).tensor();
    if (!t.defined() || t.numel() != 1 || !t.is_floating_point() || !t.device().is_cpu())
      refuse(op, p.name, "one Float or Double number on cpu", t);
    entries.push_back(t.to(torch::kFloat64).reshape({}));
  }
  const Tensor packed = torch::stack(entries);
  const Tensor values = packed.detach();
  const double* v = values.data_ptr<double>();
  kernels::LawDescription description;
  description.id = law;
  for (const kernels::LawParameter& p : kernels::kLawParameterTable)
    description.*p.member = v[p.place];
  kernels::check_parameters(description);
  return packed;
}

template <class T>
kernels::LawParameters<T> law_parameters(const Tensor& packed) {
  const double* v = packed.data_ptr<double>();
  kernels::LawParameters<T> parameters;
  for (int i = 0; i < kernels::kLawParameters; ++i)
    parameters.*kernels::kLawParameterMembers<T>[i] = T(v[i]);
  return parameters;
}
template kernels::LawParameters<float> law_parameters<float>(const Tensor&);
template kernels::LawParameters<double> law_parameters<double>(const Tensor&);

}  // namespace uniphy::ops
