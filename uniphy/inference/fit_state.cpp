#include <fmt/format.h>
#include <torch/torch.h>

#include <cstring>

#include "ops/kernels/base/error.hpp"
#include "uniphy/inference/fit.hpp"
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

constexpr std::size_t kHeader = 9;  // columns of a candidate before u

std::vector<double> flat(const FitCandidate& c) {
  std::vector<double> row{static_cast<double>(c.start), c.loss, c.mse};
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
  c.motion = tensor(row + 3, kHeader - 3);
  c.u = tensor(row + kHeader, columns - kHeader);
  return c;
}

/// The archives of the optimizers one after the other, eight bytes in a word.
std::vector<std::int64_t> words(const std::string& bytes) {
  std::vector<std::int64_t> result((bytes.size() + 7) / 8, 0);
  if (!bytes.empty()) std::memcpy(result.data(), bytes.data(), bytes.size());
  return result;
}

void write_optimizers(hdf5::Writer& writer, const std::vector<FitCandidate>& candidates) {
  std::string bytes;
  std::vector<std::int64_t> sizes;
  for (const FitCandidate& c : candidates) {
    bytes += c.optimizer;
    sizes.push_back(static_cast<std::int64_t>(c.optimizer.size()));
  }
  const std::vector<std::int64_t> all = words(bytes);
  writer.write("optimizers", all, {static_cast<std::int64_t>(all.size())},
               {"1", "Torch archives of the candidates' optimizers, one after the other"});
  writer.write("optimizer_sizes", sizes, {static_cast<std::int64_t>(sizes.size())},
               {"1", "bytes of each"});
}

void read_optimizers(const hdf5::Reader& reader, std::vector<FitCandidate>& candidates) {
  const auto sizes =
      reader.read<std::int64_t>("optimizer_sizes", {static_cast<std::int64_t>(candidates.size())});
  const auto all = reader.read<std::int64_t>("optimizers", {-1});
  const std::string bytes(reinterpret_cast<const char*>(all.data()), 8 * all.size());
  std::size_t at = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (sizes[i] < 0 || static_cast<std::size_t>(sizes[i]) > bytes.size() - at) {
      reader.fail("/optimizer_sizes", "expected sizes that /optimizers has room for");
    }
    candidates[i].optimizer = bytes.substr(at, static_cast<std::size_t>(sizes[i]));
    at += static_cast<std::size_t>(sizes[i]);
  }
}

}  // namespace

void write_fit_state(const std::filesystem::path& file, const FitState& state,
                     const std::string& fingerprint) {
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 2);
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
               {"1", "start, loss, mse, change of the linear and angular velocity, u"});
  write_optimizers(writer, state.candidates);
  writer.write("history", history.data, history.shape,
               {"1", "stage, candidate, epoch, horizon (s), mse (m^2)"});
  writer.commit_sealed();
}

FitState read_fit_state(const std::filesystem::path& file, const std::string& fingerprint) {
  const hdf5::Reader reader(file);
  if (reader.check_format(kFormat, 2) < 2) {
    reader.fail("attribute version of /", "expected 2; remove the file to start anew");
  }
  const std::string found = reader.attribute_text("/", "fingerprint");
  if (found != fingerprint) {
    reader.fail("attribute fingerprint of /",
                fmt::format("expected {}, found {}: the observation, the model or the "
                            "configuration has changed since; remove the file to start anew",
                            fingerprint, found));
  }
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
  read_optimizers(reader, state.candidates);
  rows("history", 5, [&](const double* row, std::size_t) {
    state.history.push_back(
        {std::int32_t(row[0]), std::int32_t(row[1]), std::int32_t(row[2]), row[3], row[4]});
  });
  return state;
}

}  // namespace uniphy
