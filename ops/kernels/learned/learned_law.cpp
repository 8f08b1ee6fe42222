#include "ops/kernels/learned/learned_law.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <string>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/learned/packed_networks.hpp"
#include "ops/kernels/simd/aligned_buffer.hpp"

namespace uniphy::kernels {

namespace {

/// Grows to the largest request of its thread and stays: the kernels' scratch.
template <class T>
T* scratch_of_thread(std::ptrdiff_t size) {
  struct Buffer {
    T* data = nullptr;
    std::ptrdiff_t size = 0;
    ~Buffer() { ::operator delete(data, std::align_val_t(64)); }
  };
  thread_local Buffer buffer;
  if (buffer.size < size) {
    ::operator delete(buffer.data, std::align_val_t(64));
    buffer.data = nullptr;
    buffer.size = 0;
    buffer.data =
        static_cast<T*>(::operator new(std::size_t(size) * sizeof(T), std::align_val_t(64)));
    buffer.size = size;
    std::fill_n(buffer.data, size, T(0));
  }
  return buffer.data;
}

/// The kernels read planes of a tile, [9, kTile], straight from memory; from rows they would pick
/// number by number into vectors that then wait for the last of them. So rows are turned into
/// planes tile by tile, in memory that stays in the cache.
template <class T>
View<const T> planes_of(View<const T> from, std::ptrdiff_t count, T* copy) {
  if (!from || from.particle_stride == 1) return from;
  for (std::ptrdiff_t p = 0; p < count; ++p)
    for (int k = 0; k < 9; ++k) copy[k * kTile + p] = from(p, k);
  return {copy, 1, kTile};
}
/// Where the kernels write what belongs into `to`; finish() brings it there.
template <class T>
class PlaneOutput {
 public:
  PlaneOutput(View<T> to, T* copy) : to_(to), copy_(copy) {}
  bool direct() const { return !to_ || to_.particle_stride == 1; }
  View<T> view() const { return direct() ? to_ : View<T>{copy_, 1, kTile}; }
  void finish(std::ptrdiff_t count) const {
    if (direct()) return;
    for (std::ptrdiff_t p = 0; p < count; ++p)
      for (int k = 0; k < 9; ++k) to_(p, k) = copy_[k * kTile + p];
  }

 private:
  View<T> to_;
  T* copy_;
};
constexpr std::ptrdiff_t kPlanesOfTile = 9 * kTile;

template <class T>
class LearnedLawKernel final : public LawKernel<T> {
 public:
  explicit LearnedLawKernel(const LawDescription& d)
      : latent_size_(d.weights->latent_size),
        table_(learned_law_table<T>()),
        packed_(d.weights->packed<T>()),
        projection_({packed_, &packed_->projection}, d.z),
        stress_({packed_, &packed_->stress}, d.z) {
    const double z0 = latent_size_ > 0 ? d.z[0] : 0, z1 = latent_size_ > 1 ? d.z[1] : 0;
    law_ = {d.weights->form,
            projection_.mlp(),
            stress_.mlp(),
            T(kStressScale * std::exp(kStressRate * z0)),
            T(kStrainScale * std::exp(kStrainRate * z1)),
            T(0),
            T(0),
            nullptr,
            nullptr};
    if (law_.form == LawForm::isotropic) {
      rest_projection_ = at_rest(law_.projection);
      rest_stress_ = at_rest(law_.stress);
      law_.rest_cap = std::min(rest_projection_[kTraceCap * kTile], T(0));
      law_.rest_pressure = rest_stress_[kPressure * kTile];
      if (packed_->projection_ignores_state) law_.constant_projection = rest_projection_.data();
      if (packed_->stress_ignores_state) law_.constant_stress = rest_stress_.data();
    }
  }

  std::ptrdiff_t parameter_size() const override { return latent_size_; }
  std::ptrdiff_t accumulator_size() const override { return law_.accumulator_size(); }

  void parameter_gradient(const T* accumulator, T* gradient) const override {
    const int projection_width = law_.projection.layer[0].out;
    const int stress_width = law_.stress.layer[0].out;
    const T* tail = accumulator + law_.scale_sums();
    std::vector<double> z(latent_size_, 0.0);
    projection_.packed().add_latent_gradient(accumulator, z);
    stress_.packed().add_latent_gradient(accumulator + projection_width, z);
    if (law_.form == LawForm::isotropic) {
      std::vector<T> bias(stress_width, T(0));
      at_rest(law_.stress, stress_outputs(accumulator).data(), bias.data(), nullptr);
      stress_.packed().add_latent_gradient(bias.data(), z);
      bias.assign(projection_width, T(0));
      at_rest(law_.projection, projection_outputs(accumulator).data(), bias.data(), nullptr);
      projection_.packed().add_latent_gradient(bias.data(), z);
    }
    if (latent_size_ > 1) z[1] += kStrainRate * double(tail[1]);
    if (latent_size_ > 0) z[0] += kStressRate * double(tail[0]);
    std::copy(z.begin(), z.end(), gradient);
  }

  std::ptrdiff_t weight_size() const override {
    return projection_.packed().weight_size() + stress_.packed().weight_size();
  }
  std::ptrdiff_t weight_sums_size() const override { return law_.weight_sums_size(); }

  void weight_gradient(const T* accumulator, const T* weight_sums, T* gradient) const override {
    AlignedBuffer<T> sums(law_.weight_sums_size());
    std::copy_n(weight_sums, sums.size(), sums.data());
    T *of_projection = sums.data(), *of_stress = of_projection + law_.stress_weight_sums();
    if (law_.form == LawForm::isotropic) {
      at_rest(law_.projection, projection_outputs(accumulator).data(), nullptr, of_projection);
      at_rest(law_.stress, stress_outputs(accumulator).data(), nullptr, of_stress);
      if (law_.constant_projection)
        add_features(law_.projection, weight_sums + law_.projection_feature_sums(), of_projection);
      if (law_.constant_stress)
        add_features(law_.stress, weight_sums + law_.stress_feature_sums(), of_stress);
    }
    std::fill_n(gradient, weight_size(), T(0));
    projection_.add_weight_gradient(of_projection, gradient);
    stress_.add_weight_gradient(of_stress, gradient + projection_.packed().weight_size());
  }

  void evaluate(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C, View<T> F_proj,
                View<T> tau, const LawMemory<T>&) const override {
    T* planes = scratch_of_thread<T>(4 * kPlanesOfTile + table_.scratch(law_));
    T* scratch = planes + 4 * kPlanesOfTile;
    for (std::ptrdiff_t p = 0; p < count; p += kTile) {
      const std::ptrdiff_t n = std::min(kTile, count - p);
      const PlaneOutput<T> F_out(F_proj.from(p), planes + 2 * kPlanesOfTile);
      const PlaneOutput<T> tau_out(tau.from(p), planes + 3 * kPlanesOfTile);
      table_.evaluate(law_, flow_time(dt), n, planes_of<T>(F_trial.from(p), n, planes),
                      planes_of<T>(C.from(p), n, planes + kPlanesOfTile), F_out.view(),
                      tau_out.view(), scratch);
      F_out.finish(n);
      tau_out.finish(n);
    }
  }

  void adjoint(std::ptrdiff_t count, T dt, View<const T> F_trial, View<const T> C,
               View<const T> grad_F_proj, View<const T> grad_tau, View<T> grad_F_trial,
               View<T> grad_C, T* accumulator, T* weight_sums,
               const LawMemoryAdjoint<T>&) const override {
    T* planes = scratch_of_thread<T>(6 * kPlanesOfTile + table_.scratch(law_));
    T* scratch = planes + 6 * kPlanesOfTile;
    for (std::ptrdiff_t p = 0; p < count; p += kTile) {
      const std::ptrdiff_t n = std::min(kTile, count - p);
      const auto of = [planes](int k) { return planes + k * kPlanesOfTile; };
      const PlaneOutput<T> F_out(grad_F_trial.from(p), of(4)), C_out(grad_C.from(p), of(5));
      if (!C_out.direct()) planes_of<T>(grad_C.from(p), n, of(5));  // it is added to
      table_.adjoint(law_, flow_time(dt), n, planes_of<T>(F_trial.from(p), n, of(0)),
                     planes_of<T>(C.from(p), n, of(1)), planes_of<T>(grad_F_proj.from(p), n, of(2)),
                     planes_of<T>(grad_tau.from(p), n, of(3)), F_out.view(), C_out.view(),
                     accumulator, weight_sums, scratch);
      F_out.finish(n);
      C_out.finish(n);
    }
  }

 private:
  static T flow_time(T dt) { return dt > 0 ? T(kFlowStep / double(dt)) : T(1); }

  /// The outputs of a network at rest, [out, kTile], from the very kernel that the roll-out uses,
  /// so that what is taken off is exact there.
  AlignedBuffer<T> at_rest(const PackedMlp<T>& net) const {
    const std::ptrdiff_t plane = std::ptrdiff_t(net.max_width) * kTile;
    T* in = scratch_of_thread<T>(net.forward_scratch() + plane);
    std::fill_n(in, plane, T(0));
    AlignedBuffer<T> out(padded(net.out()) * kTile);
    const T* result = table_.mlp_forward(net, in, in + plane);
    std::copy_n(result, out.size(), out.data());
    return out;
  }
  /// Its adjoint, given the gradient of the outputs [out]: adds that of the folded first bias and
  /// those of the weights (PackedMlp::weight_sums); each may be null.
  void at_rest(const PackedMlp<T>& net, const T* outputs, T* bias, T* weight_sums) const {
    const std::ptrdiff_t plane = std::ptrdiff_t(net.max_width) * kTile;
    T* in = scratch_of_thread<T>(net.tape_scratch() + 2 * plane);
    T *grad = in + plane, *tape = grad + plane;
    std::fill_n(in, 2 * plane, T(0));
    table_.mlp_tape(net, in, tape);
    for (int o = 0; o < net.out(); ++o) grad[o * kTile] = outputs[o];  // one particle of the tile
    table_.mlp_backward(net, in, tape, grad, nullptr, bias, weight_sums);
  }
  /// What the two networks at rest receive: what is taken off at rest and, of networks that answer
  /// to z alone, everything.
  std::vector<T> stress_outputs(const T* accumulator) const {
    std::vector<T> outputs(accumulator + law_.coefficient_sums(),
                           accumulator + law_.accumulator_size());
    outputs[kPressure] += accumulator[law_.scale_sums() + 2];
    return outputs;
  }
  std::vector<T> projection_outputs(const T* accumulator) const {
    std::vector<T> outputs(accumulator + law_.cap_sums(), accumulator + law_.coefficient_sums());
    if (law_.rest_cap < 0) outputs[kTraceCap] += accumulator[law_.scale_sums() + 3];
    return outputs;
  }
  /// Adds the gradient of the first weight of a network that answers to z alone: that of its first
  /// bias for each feature, whose column of features [out, in] is what the outputs receive.
  void add_features(const PackedMlp<T>& net, const T* features, T* weight_sums) const {
    const std::ptrdiff_t stride = weight_stride(net.in());
    std::vector<T> outputs(net.out()), bias;
    for (int i = 0; i < net.in(); ++i) {
      for (int o = 0; o < net.out(); ++o) outputs[o] = features[o * net.in() + i];
      bias.assign(net.layer[0].out, T(0));
      at_rest(net, outputs.data(), bias.data(), nullptr);
      for (int o = 0; o < net.layer[0].out; ++o) weight_sums[o * stride + i] += bias[o];
    }
  }

  std::ptrdiff_t latent_size_;
  const LearnedLawTable<T>& table_;
  std::shared_ptr<const PackedNetworks<T>> packed_;
  FoldedMlp<T> projection_, stress_;
  AlignedBuffer<T> rest_projection_, rest_stress_;
  LearnedLaw<T> law_{};
};

}  // namespace

template <class T>
std::shared_ptr<const LawKernel<T>> make_learned_law(const LawDescription& description) {
  if (!description.weights) throw Error("law learned: expected a trained model, found none");
  description.weights->packed<T>();  // what does not fit is found here
  const std::size_t expected = std::size_t(description.weights->latent_size);
  if (description.z.size() != expected)
    throw Error("law learned: expected a latent of " + std::to_string(expected) +
                " numbers, found " + std::to_string(description.z.size()));
  for (const double z : description.z)
    if (!std::isfinite(z))
      throw Error("law learned: expected a finite latent, found " + std::to_string(z));
  return std::make_shared<LearnedLawKernel<T>>(description);
}
template std::shared_ptr<const LawKernel<float>> make_learned_law(const LawDescription&);
template std::shared_ptr<const LawKernel<double>> make_learned_law(const LawDescription&);

}  // namespace uniphy::kernels
