#include "ops/base/plain_tensors.hpp"

namespace uniphy::ops {
namespace {

thread_local bool plain = false;

}  // namespace

PlainTensors::PlainTensors() : before_(plain) { plain = true; }
PlainTensors::~PlainTensors() { plain = before_; }
bool PlainTensors::asked_for() { return plain; }

}  // namespace uniphy::ops
