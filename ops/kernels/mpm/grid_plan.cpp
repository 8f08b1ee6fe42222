#include "ops/kernels/mpm/grid_plan.hpp"

#include <algorithm>
#include <cstring>

namespace uniphy::kernels {

template <class T>
void GridPlan::build(const TransferChunk<T>* chunks, int chunk_count, int n) {
  box_.assign(n + 1, LayerBox{});
  offset_.resize(n + 2);
  work_.assign(n + 1, 0);
  layer_begin_ = n;
  layer_end_ = 0;
  for (int c = 0; c < chunk_count; ++c) {
    const TransferChunk<T>& chunk = chunks[c];
    const int begin = chunk.base_min[0], end = chunk.base_max[0] + 3;
    layer_begin_ = std::min(layer_begin_, begin);
    layer_end_ = std::max(layer_end_, end);
    // Measured: a particle costs about three times as much in a layer as a node does.
    const std::ptrdiff_t share = (3 * 3 * chunk.count + end - begin - 1) / (end - begin);
    for (int i = begin; i < end; ++i) {
      LayerBox& box = box_[i];
      if (box.empty()) box = {n, 0, n, 0};
      box.y_begin = std::min(box.y_begin, chunk.base_min[1]);
      box.y_end = std::max(box.y_end, chunk.base_max[1] + 3);
      box.z_begin = std::min(box.z_begin, chunk.base_min[2]);
      box.z_end = std::max(box.z_end, chunk.base_max[2] + 3);
      work_[i] += share;
    }
  }
  std::ptrdiff_t offset = 0, work = 0;
  for (int i = layer_begin_; i < layer_end_; ++i) {
    offset_[i] = offset;
    offset += box_[i].nodes();
    work += work_[i] + box_[i].nodes();
    work_[i] = work;
  }
  offset_[layer_end_] = offset;
}

int GridPlan::cut(int part, int parts) const {
  if (part <= 0) return layer_begin_;
  if (part >= parts) return layer_end_;
  // The layer border nearest to the ideal share.
  const std::ptrdiff_t target = work_[layer_end_ - 1] * part / parts;
  const auto first = work_.begin() + layer_begin_, last = work_.begin() + layer_end_;
  const auto above = std::lower_bound(first, last, target);
  const std::ptrdiff_t below = above == first ? 0 : *(above - 1);
  const int layer = layer_begin_ + static_cast<int>(above - first);
  return target - below <= *above - target ? layer : layer + 1;
}

template <class T>
void clear_layer(const GridView<T>& grid, int layer, const LayerBox& box) {
  const std::size_t bytes = (box.z_end - box.z_begin + 1) * 4 * sizeof(T);
  T* row = grid.data + layer * grid.layer_stride + box.y_begin * grid.row_stride + box.z_begin * 4;
  for (int j = box.y_begin; j < box.y_end; ++j, row += grid.row_stride) std::memset(row, 0, bytes);
}

template <class T>
void save_layer(const GridView<T>& grid, int layer, const LayerBox& box, T* packed) {
  const std::ptrdiff_t length = (box.z_end - box.z_begin) * 4;
  const T* row =
      grid.data + layer * grid.layer_stride + box.y_begin * grid.row_stride + box.z_begin * 4;
  for (int j = box.y_begin; j < box.y_end; ++j, row += grid.row_stride, packed += length) {
    std::memcpy(packed, row, length * sizeof(T));
  }
}

template <class T>
void restore_layer(const GridView<T>& grid, int layer, const LayerBox& box, const T* packed) {
  const std::ptrdiff_t length = (box.z_end - box.z_begin) * 4;
  T* row = grid.data + layer * grid.layer_stride + box.y_begin * grid.row_stride + box.z_begin * 4;
  for (int j = box.y_begin; j < box.y_end; ++j, row += grid.row_stride, packed += length) {
    std::memcpy(row, packed, length * sizeof(T));
    std::memset(row + length, 0, 4 * sizeof(T));
  }
}

#define UNIPHY_INSTANTIATE(T)                                                \
  template void GridPlan::build<T>(const TransferChunk<T>*, int, int);       \
  template void clear_layer<T>(const GridView<T>&, int, const LayerBox&);    \
  template void save_layer<T>(const GridView<T>&, int, const LayerBox&, T*); \
  template void restore_layer<T>(const GridView<T>&, int, const LayerBox&, const T*);
UNIPHY_INSTANTIATE(float)
UNIPHY_INSTANTIATE(double)
#undef UNIPHY_INSTANTIATE

}  // namespace uniphy::kernels
