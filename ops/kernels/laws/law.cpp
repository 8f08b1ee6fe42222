#include "ops/kernels/laws/law.hpp"

#include <array>
#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/analytic_law.hpp"
#include "ops/kernels/learned/learned_law.hpp"

namespace uniphy::kernels {
namespace {

// In the order of LawId.
constexpr std::array<const char*, kAnalyticLaws + 1> kNames{
    "elastic",       "newtonian",       "plasticine",    "sand",
    "non_newtonian", "fixed_corotated", "water",         "volume_corrected_sand",
    "mooney_rivlin", "carreau",         "cohesive_sand", "herschel_bulkley",
    "learned"};
static_assert(static_cast<int>(LawId::learned) == kAnalyticLaws);

}  // namespace

const char* law_name(LawId id) { return kNames.at(static_cast<std::size_t>(id)); }

LawId law_id(const std::string& name) {
  std::string known;
  for (int i = 0; i <= static_cast<int>(LawId::learned); ++i) {
    const LawId id = static_cast<LawId>(i);
    if (name == law_name(id)) return id;
    known += (i == 0 ? "" : ", ") + std::string(law_name(id));
  }
  throw Error("law: expected one of " + known + "; found \"" + name + "\"");
}

template <class T>
void LawKernel<T>::weight_gradient(const T*, const T*, T*) const {
  throw Error("law: expected one with networks, found one that has no weights");
}
template class LawKernel<float>;
template class LawKernel<double>;

template <class T>
std::shared_ptr<const LawKernel<T>> make_law(const LawDescription& description) {
  if (description.id == LawId::learned) return make_learned_law<T>(description);
  return make_analytic_law<T>(description);
}

template std::shared_ptr<const LawKernel<float>> make_law<float>(const LawDescription&);
template std::shared_ptr<const LawKernel<double>> make_law<double>(const LawDescription&);

}  // namespace uniphy::kernels
