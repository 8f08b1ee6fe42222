#pragma once

#include "models/trained_model.hpp"
#include "ops/base/torch.hpp"
#include "uniphy/io/dataset.hpp"
#include "uniphy/training/law_columns.hpp"

namespace uniphy {

/// z before training, [trajectories, latent_size]. The scale coordinates start at the trajectory's
/// own stress and strain, so that both networks see numbers near one from the first step; the
/// others start small, from the generator.
torch::Tensor initial_latents(const LawColumns& columns, std::int64_t latent_size,
                              torch::Generator& generator);

/// The law and the codes that a training begins with: weights from the generator, then
/// initial_latents. columns: those of the data, in the form of the law.
models::TrainedModel initial_model(const Dataset& data, const LawColumns& columns,
                                   const models::LearnedLawOptions& options,
                                   torch::Generator& generator);

}  // namespace uniphy
