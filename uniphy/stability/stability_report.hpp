#pragma once

#include <string>
#include <vector>

#include "uniphy/report/metrics.hpp"
#include "uniphy/report/plot.hpp"
#include "uniphy/stability/stability_cell.hpp"

namespace uniphy::stability {

/// stability.md: a row a stressor, a column a method: cells that hold of all, and the worst number
/// that the row is judged by; beneath it the gradient through U Vᵀ on its own and what the methods
/// stand for. Rows and methods without a cell are not there.
std::string survival_table(const std::vector<Cell>& cells);
/// stability.csv: stressor, method, setting, verdict, number, value; every number of every cell.
std::string numbers_csv(const std::vector<Cell>& cells);
/// failures.csv: every cell that fails or stops, with step, particle and cause.
std::string failures_csv(const std::vector<Cell>& cells);
/// survival.png: the share that holds of every row and column.
ValueMap survival_map(const std::vector<Cell>& cells);

/// survives.STRESSOR.METHOD and gradient_error.STRESSOR.METHOD (the largest); of every method
/// cells.METHOD, cells_survived.METHOD, gradient_finite_share.METHOD, gradient_error_max.METHOD;
/// cells_default, cells_default_survived, gradient_finite_share, gradient_error_max of what is
/// ours and has the defaults: analytic, isotropic and exported in every row but time_step_beyond.
void add_stability_metrics(const std::vector<Cell>& cells, Metrics& metrics);

}  // namespace uniphy::stability
