#pragma once

#include <string>

#include "uniphy/inference/fit_variables.hpp"
#include "uniphy/inference/material_belief.hpp"

namespace uniphy {

/// How far a model's law is from the analytic one that it stands for, in what is read off it: of
/// the codes of a material, |log(read off the code/read off the law behind it)| at kReadingShare of
/// them, both by read_material at this time step and strain. Relative, not in SI units. NaN where
/// neither has such a number, and all NaN where no law is known behind a code, as in analytic fits.
MaterialReading reading_error(const FitVariables& variables, const std::string& material, double dt,
                              double strain_seen);

/// The same share that an interval holds.
inline constexpr double kReadingShare = 0.9;

/// The belief with such errors in its intervals, as independent of those of the fit.
MaterialBelief with_reading_error(const MaterialBelief& belief, const MaterialReading& error);

}  // namespace uniphy
