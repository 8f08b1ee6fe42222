// uniphy_train: Algorithm 1.
//   uniphy_train configs/train/unified.yaml --out out/train

#include "uniphy/io/dataset.hpp"
#include "uniphy/report/experiment.hpp"
#include "uniphy/training/train_stage.hpp"

int main(int argc, char** argv) {
  return uniphy::run_experiment(
      argc, argv,
      {"uniphy_train",
       "Trains one constitutive law for all trajectories of a data set (Algorithm 1): the weights "
       "of the projection and the stress network and one latent code per trajectory. An "
       "interrupted run resumes where it stopped, to the same bits.",
       {"data: a data set of uniphy_generate (HDF5)",
        "heldout: a second one whose latents follow the training and are fitted after it "
        "(optional)"},
       {"model.h5: weights and latent codes", "checkpoint.pt: the state of the training",
        "history.csv, training.png: the curves, with those of the held-out set",
        "latents.png, latents_mu.png: the codes in their first two principal components, coloured "
        "by material and by log mu"},
       {"uniphy_train configs/train/unified.yaml --set training.steps=2000 --out out/train"}},
      [](uniphy::Section& config) { return uniphy::train_stage(config); });
}
