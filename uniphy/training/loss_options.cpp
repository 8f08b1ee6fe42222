#include "uniphy/training/loss_options.hpp"

namespace uniphy {

void read_loss_options(Section& config, LossOptions& o) {
  o.latent_sigma =
      config.real("latent_sigma", o.latent_sigma, Range{1e-6, 1e6}, "", "width of the prior of z");
  o.prior_weight = config.real("prior_weight", o.prior_weight, between(0, 1e6), "",
                               "of the prior (|z| / latent_sigma)^2 beside a trajectory's errors");
  o.error_floor = config.real("error_floor", o.error_floor, Range{0, 1e6, true}, "",
                              "errors are relative to a sample's own size plus this share of "
                              "the trajectory's RMS");
  o.squared = config.choice("loss", o.squared ? "squared" : "logarithm", {"logarithm", "squared"},
                            "logarithm: log(1 + error/delta) of a sample's relative squared error; "
                            "squared (published form): squared errors over their mean square in "
                            "the trajectory") == "squared";
  o.delta = config.real("delta", o.delta, Range{1e-12, 1e12}, "",
                        "squared relative error below which the logarithm is linear");
}

}  // namespace uniphy
