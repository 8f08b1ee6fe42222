#pragma once

namespace uniphy::kernels {

// The rate at which an excess over a cap flows off as a power p of it (return_caps.hpp).

/// The excess, in units of the strain scale, of which a law keeps the share v/(1 + v) whatever its
/// power: what one step of the training motions exceeds a cap by (rates of about 10/s, time steps
/// of 2e-4 s, strain scales of 0.01 to 0.5). Far from it, a power that is not known yet would hide
/// that a law keeps nothing.
inline constexpr double kFlowExcess = 0.01;
/// Largest |log p|: flow indices 1/p from 0.37 to 2.7. With far larger powers what is kept hardly
/// depends on the excess, and a training takes a cap that is too low for a law that flows.
inline constexpr double kFlowPowerLimit = 1.0;

}  // namespace uniphy::kernels
