#include "uniphy/scene/continued_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "ops/kernels/laws/law_parameters.hpp"
#include "uniphy/config/document.hpp"

namespace uniphy {
namespace {

void add_network(const kernels::MlpWeights& network, kernels::Hash& hash) {
  for (const auto& layer : network.layers) {
    hash.add(std::vector<int>{layer.in, layer.out}).add(layer.weight).add(layer.bias);
  }
}

void add_law(const kernels::LawDescription& law, kernels::Hash& hash) {
  hash.add(kernels::law_name(law.id));
  hash.add(kernels::parameter_values(law));  // of a learned law: z
  if (law.weights == nullptr) return;
  hash.add(kernels::form_name(law.weights->form));
  hash.add(kernels::activation_name(law.weights->activation));
  add_network(law.weights->projection, hash);
  add_network(law.weights->stress, hash);
}

/// Keys that say how long the run is and what it stores, not what happens in it.
bool may_differ(const std::string& path) {
  static const char* const keys[] = {"output", "scene.continue", "scene.duration",
                                     "scene.frame_stride", "scene.steps"};
  return std::find(std::begin(keys), std::end(keys), path) != std::end(keys);
}

struct Difference {
  std::string path, before, now;
};

std::string shown(const Node* node) {
  if (node == nullptr) return "nothing";
  return node->kind == Node::Kind::scalar ? node->text : node->found();
}

/// The first difference of two configurations.
std::optional<Difference> difference(const std::string& path, const Node* before, const Node* now) {
  if (may_differ(path)) return {};
  const auto below = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (before == nullptr || now == nullptr || before->kind != now->kind ||
      before->text != now->text || before->items.size() != now->items.size()) {
    return Difference{path, shown(before), shown(now)};
  }
  for (std::size_t i = 0; i < before->items.size(); ++i) {
    auto found = difference(below(std::to_string(i)), before->items[i].get(), now->items[i].get());
    if (found) return found;
  }
  for (const auto& [key, value] : before->entries) {
    auto found = difference(below(key), value.get(), now->find(key).get());
    if (found) return found;
  }
  for (const auto& [key, value] : now->entries) {
    if (before->find(key) || may_differ(below(key))) continue;
    return Difference{below(key), "nothing", shown(value.get())};
  }
  return {};
}

}  // namespace

std::string scene_hash(const SceneDescription& scene, const PlacedScene& placed) {
  const kernels::GridSettings& grid = placed.grid;
  kernels::Hash hash;
  hash.add(std::vector<int>{grid.n, static_cast<int>(grid.wall), grid.bound,
                            scene.single_precision ? 1 : 0});
  hash.add(std::vector<double>{grid.dt, grid.gravity[0], grid.gravity[1], grid.gravity[2]});
  hash.add(placed.mass).add(placed.volume).add(placed.body);
  for (const BodyDescription& body : scene.bodies) add_law(body.law, hash);
  return hash.text();
}

void continue_run(const std::filesystem::path& file, const std::string& yaml,
                  const SceneDescription& scene, PlacedScene* placed) {
  RunState state = read_run_state(file);
  const auto before = parse_document(state.scene, file.string() + ": attribute scene");
  const auto now = parse_document(yaml, "the configuration");
  if (const auto found = difference("", before.get(), now.get())) {
    throw Error(fmt::format(
        "scene.continue: {}: expected the scene that its run began with, {}: {}, found {}",
        file.string(), found->path, found->before, found->now));
  }
  const std::string hash = scene_hash(scene, *placed);
  if (hash != state.point.scene_hash) {
    throw Error(
        fmt::format("scene.continue: {}: expected the masses, volumes and laws that its run began "
                    "with (hash {}), found others ({}); a mesh, particles, a model or a code that "
                    "the scene names has changed",
                    file.string(), state.point.scene_hash, hash));
  }
  placed->start = std::move(state);
}

}  // namespace uniphy
