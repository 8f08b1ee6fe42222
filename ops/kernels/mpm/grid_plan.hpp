#pragma once

#include <cstddef>
#include <vector>

#include "ops/kernels/mpm/grid.hpp"
#include "ops/kernels/mpm/particle_chunk.hpp"

namespace uniphy::kernels {

/// The touched part of the grid in one step, layer by layer, and how the layers are shared between
/// threads. Only this part is cleared, updated and stored.
class GridPlan {
 public:
  /// From the base nodes of all chunks on a grid of n nodes a side.
  template <class T>
  void build(const TransferChunk<T>* chunks, int chunk_count, int n);

  int layer_begin() const { return layer_begin_; }
  int layer_end() const { return layer_end_; }
  const LayerBox& box(int layer) const { return box_[layer]; }
  /// Where the nodes of a layer start in a dense copy of the touched nodes; offset(layer_end()) is
  /// the number of all of them.
  std::ptrdiff_t offset(int layer) const { return offset_[layer]; }
  std::ptrdiff_t nodes() const { return offset_[layer_end_]; }

  /// First layer of thread `part` of `parts`: contiguous ranges of about equal work. The result of
  /// a step does not depend on the cut (see p2g.hpp).
  int cut(int part, int parts) const;

 private:
  int layer_begin_ = 0, layer_end_ = 0;
  std::vector<LayerBox> box_;
  std::vector<std::ptrdiff_t> offset_, work_;
};

/// Sets the touched nodes of a layer to zero, and one node more at the end of each row, which the
/// widest vectors read.
template <class T>
void clear_layer(const GridView<T>& grid, int layer, const LayerBox& box);

/// The touched nodes of a layer, densely packed, and back (with the zero node behind each row).
template <class T>
void save_layer(const GridView<T>& grid, int layer, const LayerBox& box, T* packed);
template <class T>
void restore_layer(const GridView<T>& grid, int layer, const LayerBox& box, const T* packed);

}  // namespace uniphy::kernels
