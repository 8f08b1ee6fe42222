#include <fmt/format.h>

#include <algorithm>

#include "ops/base/torch.hpp"
#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/fit.hpp"
#include "uniphy/inference/optimizer_bytes.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/seal.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-fit-state";

/// Rows of equal length as one array.
struct Table {
  std::vector<double> data;
  hdf5::Shape shape{0, 0};

  void add(const std::vector<double>& row) {
    data.insert(data.end(), row.begin(), row.end());
    ++shape[0];
    shape[1] = static_cast<std::int64_t>(row.size());
  }
};

constexpr std::size_t kHeader = 4;  // columns of a candidate before its initial state and u

std::vector<double> flat(const FitCandidate& c) {
  std::vector<double> row{double(c.start), c.loss, c.mse, double(c.motion.numel())};
  for (const torch::Tensor* t : {&c.motion, &c.u}) {
    row.insert(row.end(), t->data_ptr<double>(), t->data_ptr<double>() + t->numel());
  }
  return row;
}

torch::Tensor tensor(const double* numbers, std::size_t count) {
  return torch::tensor(std::vector<double>(numbers, numbers + count), torch::kFloat64);
}

FitCandidate candidate(const double* row, std::size_t columns) {
  FitCandidate c;
  c.start = static_cast<int>(row[0]);
  c.loss = row[1];
  c.mse = row[2];
  const std::size_t most = columns - kHeader;
  const auto motion = static_cast<std::size_t>(std::clamp(row[3], 0.0, double(most)));
  c.motion = tensor(row + kHeader, motion);
  c.u = tensor(row + kHeader + motion, most - motion);
  return c;
}

}  // namespace

void check_fingerprint(const hdf5::Reader& reader, const std::string& fingerprint) {
  const std::string found = reader.attribute_text("/", "fingerprint");
  if (found == fingerprint) return;
  reader.fail("attribute fingerprint of /",
              fmt::format("expected {}, found {}: the observation, the model or the configuration "
                          "has changed since; remove the file to start anew",
                          fingerprint, found));
}

void write_fit_state(const std::filesystem::path& file, const FitState& state,
                     const std::string& fingerprint) {
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 3);
  writer.attribute("/", "fingerprint", fingerprint);
  writer.attribute("/", "stage", state.stage);
  writer.attribute("/", "steps", state.steps);
  writer.write("start_mse", state.start_mse, {static_cast<std::int64_t>(state.start_mse.size())},
               {"m^2", "of every start at the stages' horizons"});
  Table candidates, history;
  for (const FitCandidate& c : state.candidates) candidates.add(flat(c));
  for (const FitRecord& r : state.history) {
    history.add({double(r.stage), double(r.candidate), double(r.epoch), r.horizon, r.mse});
  }
  writer.write("candidates", candidates.data, candidates.shape,
               {"1", "start, loss, mse, numbers of the initial state, change of those, u"});
  std::vector<std::string> optimizers;
  for (const FitCandidate& c : state.candidates) optimizers.push_back(c.optimizer);
  write_optimizers(writer, optimizers);
  writer.write("history", history.data, history.shape,
               {"1", "stage, candidate, epoch, horizon (s), mse (m^2)"});
  writer.commit_sealed();
}

FitState read_fit_state(const std::filesystem::path& file, const std::string& fingerprint) {
  const hdf5::Reader reader(file);
  if (reader.check_format(kFormat, 3) < 3) {
    reader.fail("attribute version of /", "expected 3; remove the file to start anew");
  }
  check_fingerprint(reader, fingerprint);
  check_seal(file);
  FitState state;
  state.stage = static_cast<int>(reader.attribute_integer("/", "stage"));
  state.steps = static_cast<int>(reader.attribute_integer("/", "steps"));
  state.start_mse = reader.read<double>("start_mse", {-1});
  const auto rows = [&](const char* name, std::int64_t least, const auto& visit) {
    const auto data = reader.read<double>(name, {-1, -1});
    const hdf5::Shape shape = reader.shape(name);
    if (shape[0] > 0 && shape[1] < least) {
      reader.fail(std::string("/") + name,
                  fmt::format("expected at least {} columns, found {}", least, shape[1]));
    }
    for (std::int64_t i = 0; i < shape[0]; ++i) {
      visit(data.data() + i * shape[1], static_cast<std::size_t>(shape[1]));
    }
  };
  rows("candidates", kHeader + 1, [&](const double* row, std::size_t columns) {
    state.candidates.push_back(candidate(row, columns));
  });
  const auto optimizers =
      read_optimizers(reader, static_cast<std::int64_t>(state.candidates.size()));
  for (std::size_t i = 0; i < optimizers.size(); ++i) state.candidates[i].optimizer = optimizers[i];
  rows("history", 5, [&](const double* row, std::size_t) {
    state.history.push_back(
        {std::int32_t(row[0]), std::int32_t(row[1]), std::int32_t(row[2]), row[3], row[4]});
  });
  return state;
}

}  // namespace uniphy
