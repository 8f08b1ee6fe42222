#include "uniphy/inference/adaptation_state.hpp"

#include <algorithm>
#include <vector>

#include "uniphy/inference/optimizer_bytes.hpp"
#include "uniphy/io/hdf5.hpp"
#include "uniphy/io/seal.hpp"
#include "uniphy/report/interrupt.hpp"

namespace uniphy {
namespace {

constexpr const char* kFormat = "uniphy-adaptation-state";
constexpr int kVersion = 2;
constexpr std::int64_t kCounts = 3;  // columns of /counts

}  // namespace

std::filesystem::path adaptation_state_file(const std::filesystem::path& state_file) {
  if (state_file.empty()) return {};
  std::filesystem::path file = state_file;
  return file.replace_filename("adaptation_" + state_file.filename().string());
}

AdaptationState::AdaptationState(const std::filesystem::path& file, const FitHooks& hooks)
    : file_(file), hooks_(hooks) {
  if (!file_.empty() && std::filesystem::exists(file_)) read();
}

RungTask& AdaptationState::task(const std::string& name) {
  const auto found = std::find_if(tasks_.begin(), tasks_.end(),
                                  [&](const RungTask& task) { return task.name == name; });
  if (found != tasks_.end()) return *found;
  tasks_.emplace_back().name = name;
  return tasks_.back();
}

void AdaptationState::checkpoint(bool now) {
  const auto clock = std::chrono::steady_clock::now();
  const bool due = std::chrono::duration<double>(clock - saved_).count() >= hooks_.save_seconds;
  if (!file_.empty() && (now || due || interrupt_requested())) {
    write();
    saved_ = clock;
  }
  throw_if_interrupted();
}

void AdaptationState::write() const {
  std::vector<std::string> names, optimizers;
  std::vector<std::int64_t> counts;
  std::vector<double> seconds;
  for (const RungTask& task : tasks_) {
    names.push_back(task.name);
    optimizers.push_back(task.optimizer);
    for (const int count : {task.steps, int(task.done), task.roll_outs}) counts.push_back(count);
    seconds.push_back(task.seconds);
  }
  const auto count = static_cast<std::int64_t>(names.size());
  hdf5::Writer writer(file_);
  writer.attribute("/", "format", kFormat);
  writer.attribute("/", "version", kVersion);
  writer.attribute("/", "fingerprint", hooks_.fingerprint);
  writer.write_strings("names", names, {"1", "rung and start"});
  writer.write("counts", counts, {count, kCounts}, {"1", "steps, done, roll-outs"});
  writer.write("seconds", seconds, {count}, {"s", "that the task took"});
  write_optimizers(writer, optimizers);
  writer.commit_sealed();
}

void AdaptationState::read() {
  const hdf5::Reader reader(file_);
  reader.check_format(kFormat, kVersion);
  check_fingerprint(reader, hooks_.fingerprint);
  check_seal(file_);
  const auto names = reader.read_strings("names");
  const auto count = static_cast<std::int64_t>(names.size());
  const auto counts = reader.read<std::int64_t>("counts", {count, kCounts});
  const auto seconds = reader.read<double>("seconds", {count});
  const auto optimizers = read_optimizers(reader, count);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::int64_t* row = counts.data() + i * kCounts;
    tasks_.push_back({names[i], optimizers[i], static_cast<int>(row[0]), row[1] != 0,
                      static_cast<int>(row[2]), seconds[i]});
  }
}

}  // namespace uniphy
