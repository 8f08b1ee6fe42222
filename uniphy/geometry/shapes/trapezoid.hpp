#pragma once

namespace uniphy {

/// Signed distance (exact, m) from the point (x, y) to the trapezoid symmetric about the y axis
/// with half widths `bottom` at y = −half_height and `top` at y = +half_height.
double trapezoid_distance(double x, double y, double bottom, double top, double half_height);

}  // namespace uniphy
