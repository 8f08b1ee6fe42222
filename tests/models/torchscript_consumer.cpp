// Loads an exported law with nothing of this project linked: what another program would do.
//   uniphy_torchscript_consumer LAW.pt CASES.pt
// CASES.pt holds the tensors F, C, z, F_proj, tau. Prints the largest relative differences and
// returns 0 where both are at most 1e-6 (1e-3 for a float32 law).

#include <torch/script.h>
#include <torch/serialize.h>

#include <cstdio>
#include <exception>
#include <vector>

namespace {

double relative(const torch::Tensor& a, const torch::Tensor& b) {
  return ((a - b).norm() / b.norm()).item<double>();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: uniphy_torchscript_consumer LAW.pt CASES.pt\n");
    return 2;
  }
  try {
    torch::jit::Module law = torch::jit::load(argv[1]);
    std::vector<torch::Tensor> cases;
    torch::load(cases, argv[2]);
    const auto &F = cases.at(0), &C = cases.at(1), &z = cases.at(2);
    const auto F_proj = law.run_method("project", F, z).toTensor();
    const auto tau = law.run_method("stress", cases.at(3), C, z).toTensor();
    const double projection = relative(F_proj, cases.at(3)), stress = relative(tau, cases.at(4));
    std::printf("%s version %d, %s, %s, latent_size %d: projection %.2g, stress %.2g\n",
                law.attr("format").toStringRef().c_str(), int(law.attr("version").toInt()),
                law.attr("form").toStringRef().c_str(), law.attr("dtype").toStringRef().c_str(),
                int(law.attr("latent_size").toInt()), projection, stress);
    const double tolerance = law.attr("dtype").toStringRef() == "float64" ? 1e-6 : 1e-3;
    return projection <= tolerance && stress <= tolerance ? 0 : 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "error: %s\n", e.what());
    return 2;
  }
}
