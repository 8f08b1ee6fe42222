#include <fmt/format.h>

#include <limits>

#include "ops/kernels/error.hpp"
#include "uniphy/inference/fit.hpp"
#include "uniphy/io/hdf5.hpp"

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

std::vector<double> flat(const FitCandidate& c) {
  std::vector<double> row{static_cast<double>(c.start), c.loss, c.mse};
  for (const auto* v : {&c.motion.centre, &c.motion.linear, &c.motion.angular}) {
    row.insert(row.end(), v->data(), v->data() + 3);
  }
  row.insert(row.end(), c.u.begin(), c.u.end());
  return row;
}

FitCandidate candidate(const double* row, std::size_t size) {
  FitCandidate c;
  c.start = static_cast<int>(row[0]);
  c.loss = row[1];
  c.mse = row[2];
  std::copy_n(row + 3, 3, c.motion.centre.data());
  std::copy_n(row + 6, 3, c.motion.linear.data());
  std::copy_n(row + 9, 3, c.motion.angular.data());
  c.u.assign(row + 12, row + size);
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
  Table candidates, optimizers, history;
  for (const FitCandidate& c : state.candidates) candidates.add(flat(c));
  for (const auto& packed : state.optimizers) optimizers.add(packed);
  for (const FitRecord& r : state.history) {
    history.add({double(r.stage), double(r.candidate), double(r.epoch), r.horizon, r.mse});
  }
  writer.write("candidates", candidates.data, candidates.shape,
               {"1", "start, loss, mse, centre, linear, angular, u"});
  writer.write("optimizers", optimizers.data, optimizers.shape, {"1", "packed optimizers"});
  writer.write("history", history.data, history.shape,
               {"1", "stage, candidate, epoch, horizon (s), mse (m^2)"});
  writer.commit();
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
  rows("candidates", 13, [&](const double* row, std::size_t size) {
    state.candidates.push_back(candidate(row, size));
  });
  rows("optimizers", 1, [&](const double* row, std::size_t size) {
    state.optimizers.emplace_back(row, row + size);
  });
  rows("history", 5, [&](const double* row, std::size_t) {
    state.history.push_back(
        {std::int32_t(row[0]), std::int32_t(row[1]), std::int32_t(row[2]), row[3], row[4]});
  });
  return state;
}

}  // namespace uniphy
