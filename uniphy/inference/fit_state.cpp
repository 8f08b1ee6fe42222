#include <fmt/format.h>

#include <algorithm>

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

constexpr std::size_t kHeader = 14;  // columns of a candidate before u

std::vector<double> flat(const FitCandidate& c) {
  std::vector<double> row{static_cast<double>(c.start), c.loss, c.mse, c.reference,
                          static_cast<double>(c.stalled)};
  for (const auto* v : {&c.motion.centre, &c.motion.linear, &c.motion.angular}) {
    row.insert(row.end(), v->data(), v->data() + 3);
  }
  row.insert(row.end(), c.u.begin(), c.u.end());
  row.insert(row.end(), c.optimizer.begin(), c.optimizer.end());
  return row;
}

FitCandidate candidate(const double* row, std::size_t columns, std::size_t variables) {
  FitCandidate c;
  c.start = static_cast<int>(row[0]);
  c.loss = row[1];
  c.mse = row[2];
  c.reference = row[3];
  c.stalled = static_cast<int>(row[4]);
  std::copy_n(row + 5, 3, c.motion.centre.data());
  std::copy_n(row + 8, 3, c.motion.linear.data());
  std::copy_n(row + 11, 3, c.motion.angular.data());
  c.u.assign(row + kHeader, row + kHeader + variables);
  c.optimizer.assign(row + kHeader + variables, row + columns);
  return c;
}

}  // namespace

void write_fit_state(const std::filesystem::path& file, const FitState& state,
                     const std::string& fingerprint) {
  hdf5::Writer writer(file);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", 1);
  writer.attribute("/", "fingerprint", fingerprint);
  writer.attribute("/", "stage", state.stage);
  writer.attribute("/", "epoch", state.epoch);
  writer.write("start_mse", state.start_mse, {static_cast<std::int64_t>(state.start_mse.size())},
               {"m^2", "of every start at the stages' horizons"});
  writer.attribute("/", "variables",
                   state.candidates.empty() ? 0 : static_cast<int>(state.candidates[0].u.size()));
  Table candidates, history;
  for (const FitCandidate& c : state.candidates) candidates.add(flat(c));
  for (const FitRecord& r : state.history) {
    history.add({double(r.stage), double(r.candidate), double(r.epoch), r.horizon, r.mse});
  }
  writer.write(
      "candidates", candidates.data, candidates.shape,
      {"1", "start, loss, mse, reference, stalled, centre, linear, angular, u, optimizer"});
  writer.write("history", history.data, history.shape,
               {"1", "stage, candidate, epoch, horizon (s), mse (m^2)"});
  writer.commit_sealed();
}

FitState read_fit_state(const std::filesystem::path& file, const std::string& fingerprint) {
  const hdf5::Reader reader(file);
  reader.check_format(kFormat, 1);
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
  state.epoch = static_cast<int>(reader.attribute_integer("/", "epoch"));
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
  const auto variables = static_cast<std::size_t>(
      std::clamp<std::int64_t>(reader.attribute_integer("/", "variables"), 0, 1 << 20));
  rows("candidates", static_cast<std::int64_t>(kHeader + variables),
       [&](const double* row, std::size_t columns) {
         state.candidates.push_back(candidate(row, columns, variables));
       });
  rows("history", 5, [&](const double* row, std::size_t) {
    state.history.push_back(
        {std::int32_t(row[0]), std::int32_t(row[1]), std::int32_t(row[2]), row[3], row[4]});
  });
  return state;
}

}  // namespace uniphy
