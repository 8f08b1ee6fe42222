#include "uniphy/geometry/mesh_part.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "uniphy/geometry/winding_number.hpp"

namespace uniphy {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kProbes = 64;  ///< places where a part is looked at

bool is_within(const Bounds& inner, const Bounds& outer) {
  return (inner.min.array() >= outer.min.array()).all() &&
         (inner.max.array() <= outer.max.array()).all();
}

bool is_within(const MeshPart& part, const WindingNumber& winding) {
  const auto& [vertices, triangles] = part.mesh;
  const std::size_t step = std::max<std::size_t>(1, triangles.size() / kProbes);
  for (std::size_t k = 0; k < triangles.size(); k += step) {
    const auto& [a, b, c] = triangles[k];
    if (std::abs(winding((vertices[a] + vertices[b] + vertices[c]) / 3)) < 0.5) return false;
  }
  return true;
}

/// Of each part the largest one that it lies within, or itself.
std::vector<std::size_t> outermost_parts(const std::vector<MeshPart>& parts) {
  const auto larger = [&](std::size_t a, std::size_t b) {
    return std::abs(parts[a].volume) > std::abs(parts[b].volume);
  };
  std::vector<std::size_t> outermost(parts.size());
  std::iota(outermost.begin(), outermost.end(), std::size_t{0});
  for (std::size_t outer = 0; outer < parts.size(); ++outer) {
    std::unique_ptr<WindingNumber> winding;  // made where it is needed
    for (std::size_t inner = 0; inner < parts.size(); ++inner) {
      if (!larger(outer, outermost[inner]) || !is_within(parts[inner].bounds, parts[outer].bounds))
        continue;
      if (!winding) winding = std::make_unique<WindingNumber>(parts[outer].mesh);
      if (is_within(parts[inner], *winding)) outermost[inner] = outer;
    }
  }
  return outermost;
}

/// Whether the other parts, oriented, fill the space that a part stands in.
bool is_filled(const std::vector<MeshPart>& parts, std::size_t k) {
  const Vector3d p = parts[k].mesh.vertices[0];
  double sum = 0;
  for (std::size_t other = 0; other < parts.size(); ++other) {
    if (other == k || !is_within(Bounds{p, p}, parts[other].bounds)) continue;
    sum += WindingNumber(parts[other].mesh).exact(p);
  }
  return sum > 0.5;
}

}  // namespace

void orient_parts(std::vector<MeshPart>& parts,
                  const std::function<void(const MeshPart&, const std::string&)>& warn) {
  const std::vector<std::size_t> outermost = outermost_parts(parts);
  bool all_inwards = true;
  std::vector<bool> cavity;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    cavity.push_back(parts[k].volume * parts[outermost[k]].volume < 0);
    if (outermost[k] == k) all_inwards = all_inwards && parts[k].volume < 0;
  }
  for (std::size_t k = 0; k < parts.size(); ++k) {
    MeshPart& part = parts[k];
    if ((part.volume < 0) == cavity[k]) continue;
    for (auto& triangle : part.mesh.triangles) std::swap(triangle[1], triangle[2]);
    if (outermost[k] == k && !all_inwards) warn(part, "looks inwards and was turned");
  }
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (outermost[k] == k || cavity[k] || !is_filled(parts, k)) continue;
    warn(parts[k],
         "lies within another and is oriented alike: it adds nothing (turn its faces for a "
         "cavity)");
  }
}

}  // namespace uniphy
