#include "uniphy/training/training_checkpoint.hpp"

#include <fmt/format.h>

#include <sstream>

#include "ops/kernels/base/error.hpp"
#include "ops/kernels/base/hash.hpp"
#include "uniphy/io/seal.hpp"

namespace uniphy {
namespace {

constexpr std::int64_t kHistoryColumns = 6;

std::string fingerprint(const Dataset& data, const TrainingOptions& o, HeldoutCurve* heldout) {
  kernels::Hash hash;
  hash.add(data.samples.F);
  hash.add(data.samples.F_proj);
  hash.add(data.samples.C);
  hash.add(data.samples.tau);
  hash.add(data.first);
  // The first codes of the held-out set follow from its samples.
  std::string beside;
  if (heldout) {
    kernels::Hash codes;
    const torch::Tensor z = heldout->z().detach().contiguous();
    codes.add(z.data_ptr(), z.nbytes());
    beside = " heldout " + codes.text();
  }
  return fmt::format("{} data {}{}", o.text(), hash.text(), beside);
}

}  // namespace

TrainingCheckpoint::TrainingCheckpoint(std::filesystem::path file, const Dataset& data,
                                       const TrainingOptions& options, TrainingResult& state,
                                       torch::optim::AdamW& optimizer, HeldoutCurve* heldout)
    : file_(std::move(file)),
      fingerprint_(fingerprint(data, options, heldout)),
      state_(state),
      optimizer_(optimizer),
      heldout_(heldout) {}

void TrainingCheckpoint::save(std::int64_t step) const {
  torch::serialize::OutputArchive archive;
  archive.write("format", c10::IValue("uniphy-training"));
  archive.write("fingerprint", c10::IValue(fingerprint_));
  archive.write("step", c10::IValue(step));
  archive.write("seconds", c10::IValue(state_.seconds));
  archive.write("z", state_.model.codes->z.detach());
  for (const auto& parameter : state_.model.law->named_parameters())
    archive.write(parameter.key(), parameter.value().detach());
  torch::Tensor history =
      torch::empty({std::int64_t(state_.history.size()), kHistoryColumns}, torch::kFloat64);
  double* at = history.data_ptr<double>();
  for (const TrainingPoint& p : state_.history) {
    *at++ = double(p.step);
    *at++ = p.loss;
    *at++ = p.stress_error;
    *at++ = p.projection_error;
    *at++ = p.heldout_stress_error;
    *at++ = p.heldout_projection_error;
  }
  archive.write("history", history);
  torch::serialize::OutputArchive moments;
  optimizer_.save(moments);
  archive.write("optimizer", moments);
  if (heldout_) {
    archive.write("heldout_z", heldout_->z().detach());
    torch::serialize::OutputArchive heldout_moments;
    heldout_->optimizer().save(heldout_moments);
    archive.write("heldout_optimizer", heldout_moments);
  }
  // To memory first: LibTorch's own file writer ends the program where the disk is full.
  std::ostringstream bytes;
  archive.save_to(bytes);
  write_sealed_file(file_, bytes.str());
}

std::int64_t TrainingCheckpoint::load() {
  if (!std::filesystem::exists(file_)) return 0;
  const std::string bytes = read_sealed_file(file_);
  torch::serialize::InputArchive archive;
  c10::IValue format, fingerprint, step;
  try {
    archive.load_from(bytes.data(), bytes.size());
    archive.read("format", format);
    archive.read("fingerprint", fingerprint);
    archive.read("step", step);
  } catch (const std::exception&) {
    throw Error(file_.string() +
                ": expected a training checkpoint, found something else; remove it to start anew");
  }
  if (!format.isString() || format.toStringRef() != "uniphy-training" || !fingerprint.isString() ||
      !step.isInt())
    throw Error(file_.string() + ": expected a training checkpoint, found another archive");
  if (fingerprint.toStringRef() != fingerprint_)
    throw Error(file_.string() + ": the checkpoint belongs to another run: expected \"" +
                fingerprint_ + "\", found \"" + fingerprint.toStringRef() +
                "\"; remove it or choose another --out");
  try {
    torch::NoGradGuard no_grad;
    const auto restore = [&archive](const std::string& name, torch::Tensor into) {
      torch::Tensor value;
      archive.read(name, value);
      if (value.sizes() != into.sizes()) throw Error(name + " has another shape");
      into.copy_(value);
    };
    restore("z", state_.model.codes->z);
    for (const auto& parameter : state_.model.law->named_parameters())
      restore(parameter.key(), parameter.value());
    torch::Tensor history;
    archive.read("history", history);
    if (history.dim() != 2 || history.size(1) != kHistoryColumns) {
      throw Error("history has another shape");
    }
    state_.history.clear();
    for (std::int64_t k = 0; k < history.size(0); ++k) {
      const double* row = history.data_ptr<double>() + kHistoryColumns * k;
      state_.history.push_back({std::int64_t(row[0]), row[1], row[2], row[3], row[4], row[5]});
    }
    torch::serialize::InputArchive moments;
    archive.read("optimizer", moments);
    optimizer_.load(moments);
    if (heldout_) {
      restore("heldout_z", heldout_->z());
      torch::serialize::InputArchive heldout_moments;
      archive.read("heldout_optimizer", heldout_moments);
      heldout_->optimizer().load(heldout_moments);
    }
    c10::IValue seconds;
    archive.read("seconds", seconds);
    state_.seconds = seconds.toDouble();
  } catch (const std::exception& e) {
    throw Error(file_.string() + ": damaged training checkpoint (" +
                std::string(e.what()).substr(0, 120) + "); remove it to start anew");
  }
  return step.toInt();
}

}  // namespace uniphy
