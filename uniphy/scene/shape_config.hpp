#pragma once

#include <functional>

#include "uniphy/config/config.hpp"
#include "uniphy/scene/body.hpp"

namespace uniphy {

/// Completes a body with its shape: solid, or cloud. Opens files, so it runs after all keys are
/// read.
using ShapeLoader = std::function<void(BodyDescription*)>;

/// Declares and reads the keys of a shape: `type` and, beside it, the parameters of that shape.
/// Lengths are in the shape's own units, scaled by the body's `size`.
ShapeLoader read_shape(Section& shape);

/// Declares and reads the keys of a filling.
Filling read_filling(Section& filling);

}  // namespace uniphy
