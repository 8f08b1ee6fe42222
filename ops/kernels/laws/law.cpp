#include "ops/kernels/laws/law.hpp"

#include <array>
#include <cmath>
#include <utility>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/laws/analytic_law.hpp"
#include "ops/kernels/learned/learned_law.hpp"

namespace uniphy::kernels {
namespace {

struct LawInfo {
  const char* name;
  std::vector<std::string> parameters;
};

const LawInfo& info(LawId id) {
  // In the order of LawId.
  static const std::array<LawInfo, 8> all{{{"elastic", {"mu", "lambda"}},
                                           {"newtonian", {"mu", "lambda"}},
                                           {"plasticine", {"mu", "lambda", "tau_y"}},
                                           {"sand", {"mu", "lambda", "theta"}},
                                           {"non_newtonian", {"mu", "lambda", "tau_y", "eta"}},
                                           {"fixed_corotated", {"mu", "lambda"}},
                                           {"water", {"lambda"}},
                                           {"learned", {}}}};
  return all.at(static_cast<std::size_t>(id));
}

}  // namespace

const char* law_name(LawId id) { return info(id).name; }

LawId law_id(const std::string& name) {
  std::string known;
  for (int i = 0; i <= static_cast<int>(LawId::learned); ++i) {
    const LawId id = static_cast<LawId>(i);
    if (name == law_name(id)) return id;
    known += (i == 0 ? "" : ", ") + std::string(law_name(id));
  }
  throw Error("law: expected one of " + known + "; found \"" + name + "\"");
}

const std::vector<std::string>& parameter_names(LawId id) { return info(id).parameters; }

template <class T>
std::shared_ptr<const LawKernel<T>> make_law(const LawDescription& description) {
  if (description.id == LawId::learned) return make_learned_law<T>(description);
  return make_analytic_law<T>(description);
}

template std::shared_ptr<const LawKernel<float>> make_law<float>(const LawDescription&);
template std::shared_ptr<const LawKernel<double>> make_law<double>(const LawDescription&);

}  // namespace uniphy::kernels
