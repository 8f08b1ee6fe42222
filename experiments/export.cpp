// uniphy_export: a trained model for other programs.
//   uniphy_export configs/export/unified.yaml --out out/export
//   python3 -c "import torch; m = torch.jit.load('out/export/law.pt')
//   print(m.project(1.1 * torch.eye(3)[None], m.code_of('sand')))"

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "models/script_check.hpp"
#include "models/torchscript.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/io/model_file.hpp"
#include "uniphy/report/experiment.hpp"

namespace {

struct Options {
  std::filesystem::path model;
  std::string dtype;
};

double parameter_count(const uniphy::kernels::LearnedLawWeights& weights) {
  double count = 0;
  for (const auto* network : {&weights.projection, &weights.stress})
    for (const auto& layer : network->layers)
      count += double(layer.weight.size() + layer.bias.size());
  return count;
}

/// Loads what was written and holds it against the kernels.
void check(const std::filesystem::path& file, const uniphy::ModelFile& model, bool single,
           uniphy::Metrics& metrics) {
  const auto dtype = single ? torch::kFloat32 : torch::kFloat64;
  const auto script = uniphy::models::load_script_law(file, dtype);
  std::vector<std::vector<double>> codes;
  const std::int64_t step = std::max<std::int64_t>(1, model.codes() / 16);
  for (std::int64_t i = 0; i < model.codes(); i += step) codes.push_back(model.code(i));
  if (codes.empty()) codes.emplace_back(std::size_t(model.weights.latent_size), 0.0);
  const auto difference = uniphy::models::compare_with_kernels(
      script, model.weights, codes, uniphy::models::probe_states(256, 1));
  metrics.set("projection_difference", difference.projection);
  metrics.set("stress_difference", difference.stress);
  const double tolerance = single ? 1e-3 : 1e-6;
  if (!(difference.projection <= tolerance) || !(difference.stress <= tolerance))
    throw uniphy::Error(file.string() + ": expected the answers of the model within " +
                        std::to_string(tolerance) + ", found differences of " +
                        std::to_string(difference.projection) + " (projection) and " +
                        std::to_string(difference.stress) + " (stress)");
}

}  // namespace

int main(int argc, char** argv) {
  const uniphy::ExperimentInfo info{
      "uniphy_export",
      "Writes a trained model as a TorchScript file that runs without this project, and its "
      "weights and latent codes in the documented HDF5 layout; then loads both and checks the "
      "answers.",
      {"CONFIG.yaml         the model and the dtype",
       "model.h5            a model of uniphy_train (layout: uniphy/io/model_file.hpp)"},
      {"DIR/law.pt          TorchScript with project(F, z), stress(F_proj, C, z), differentiable, "
       "and the training codes with their materials (layout: models/torchscript.hpp)",
       "DIR/weights.h5      the same numbers (layout: uniphy/io/model_file.hpp)"},
      {"uniphy_export configs/export/unified.yaml --set dtype=float32 --out out/export"}};
  return uniphy::run_experiment(
      argc, argv, info, [](uniphy::Section& config) -> uniphy::RunFunction {
        Options options;
        options.model = config.input_file("model", uniphy::required, "the trained model");
        options.dtype =
            config.choice("dtype", "float64", {"float32", "float64"}, "the numbers of both files");
        return [options](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
          const uniphy::ModelFile model = uniphy::read_model(options.model);
          const bool single = options.dtype == "float32";
          const auto law = out.file("law.pt"), weights = out.file("weights.h5");
          uniphy::write_text_file(law,
                                  uniphy::models::script_law_bytes(
                                      model.weights, single ? torch::kFloat32 : torch::kFloat64,
                                      {model.latents, model.materials, model.parameters}));
          uniphy::write_model(weights, model, single);
          uniphy::read_model(weights);
          metrics.set("parameters", parameter_count(model.weights));
          metrics.set("latent_size", model.weights.latent_size);
          metrics.set("codes", double(model.codes()));
          metrics.set("law_bytes", double(std::filesystem::file_size(law)));
          metrics.set("weights_bytes", double(std::filesystem::file_size(weights)));
          check(law, model, single, metrics);
          std::printf(
              "%.0f parameters and %lld codes; law.pt answers like the model to %.1e\n",
              *metrics.find("parameters"), static_cast<long long>(model.codes()),
              std::max(*metrics.find("projection_difference"), *metrics.find("stress_difference")));
        };
      });
}
