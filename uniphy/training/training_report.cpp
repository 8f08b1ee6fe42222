#include "uniphy/training/training_report.hpp"

#include <fmt/format.h>

#include <cmath>

#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/plot.hpp"

namespace uniphy {

void write_training_curves(const RunDirectory& out, const std::vector<TrainingPoint>& history) {
  const bool heldout = !history.empty() && std::isfinite(history.back().heldout_stress_error);
  const auto line = [](const char* label) {
    Series series;
    series.label = label;
    return series;
  };
  std::vector<Series> curves{line("loss"), line("stress error"), line("projection error")};
  std::string csv = "step,loss,stress_error,projection_error";
  if (heldout) {
    csv += ",heldout_stress_error,heldout_projection_error";
    curves.push_back(line("stress error, held out"));
    curves.push_back(line("projection error, held out"));
  }
  csv += "\n";
  for (const TrainingPoint& p : history) {
    const double values[] = {p.loss, p.stress_error, p.projection_error, p.heldout_stress_error,
                             p.heldout_projection_error};
    csv += fmt::format("{}", p.step);
    for (std::size_t k = 0; k < curves.size(); ++k) {
      csv += fmt::format(",{:.9g}", values[k]);
      curves[k].x.push_back(double(p.step));
      curves[k].y.push_back(values[k]);
    }
    csv += "\n";
  }
  write_text_file(out.file("history.csv"), csv);
  Chart chart;
  chart.title = "Training (medians over trajectories)";
  chart.x_label = "step";
  chart.y_label = "relative error";
  chart.log_y = true;
  chart.series = curves;
  out.draw("training.png", chart);
}

void plot_latents(const RunDirectory& out, const models::LatentCodes& codes) {
  const torch::Tensor x = codes->z.detach().to(torch::kFloat64);
  const torch::Tensor centred = x - x.mean(0, true);
  if (centred.size(1) < 2 || centred.size(0) < 2) return;
  const torch::Tensor axes = std::get<1>(torch::linalg_eigh(centred.t().mm(centred)));
  const torch::Tensor plane = centred.mm(axes.narrow(1, axes.size(1) - 2, 2)).contiguous();
  const double* at = plane.data_ptr<double>();
  Chart by_material, by_mu;
  by_material.title = "Latent codes, by material";
  by_mu.title = "Latent codes, by shear modulus";
  for (Chart* chart : {&by_material, &by_mu}) {
    chart->x_label = "first principal component";
    chart->y_label = "second";
  }
  by_mu.colour_label = "log10 of mu in Pa (newtonian: viscosity in Pa s)";
  by_mu.series.emplace_back();
  by_mu.series.back().points = true;
  Series& all = by_mu.series.back();
  for (std::size_t i = 0; i < codes->materials().size(); ++i) {
    const std::string& material = codes->materials()[i];
    if (by_material.series.empty() || by_material.series.back().label != material) {
      by_material.series.emplace_back();
      by_material.series.back().label = material;
      by_material.series.back().points = true;
    }
    for (Series* series : {&by_material.series.back(), &all}) {
      series->x.push_back(at[2 * i + 1]);
      series->y.push_back(at[2 * i]);
    }
    all.colour.push_back(
        std::log10(codes->material_parameters()[i][0]));  // not finite where there is none
  }
  out.draw("latents.png", by_material);
  out.draw("latents_mu.png", by_mu);
}

}  // namespace uniphy
