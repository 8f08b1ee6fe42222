#pragma once

// The frame of every binary:
//
//   NAME CONFIG.yaml [--set key.path=value]... [--out DIR] [--threads N] [--report] [--help]
//   NAME --schema
//
//   int main(int argc, char** argv) {
//     return uniphy::run_experiment(argc, argv, {"uniphy_simulate", "Simulates ...", ...},
//       [](uniphy::Section& config) -> uniphy::RunFunction {
//         const SimulateOptions options = read_options(config);   // declares and reads keys only
//         return [options](uniphy::RunDirectory& out, uniphy::Metrics& metrics) {
//           ...                                                    // the work
//         };
//       });
//   }
//
// DIR receives config.yaml (resolved: every default filled in) before the work starts, the
// products, and metrics.json (with wall_s and peak_memory_mb) when it ends well; with --report also
// report.html (report.hpp), of a run that fails, too, where it has something to show. The last line
// on stdout names DIR and what the run has written there. A run that fails before it has written
// anything leaves DIR as it found it. A DIR belongs to one run at a time.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "uniphy/config/config.hpp"
#include "uniphy/report/metrics.hpp"
#include "uniphy/report/report.hpp"

namespace uniphy {

struct ExperimentInfo {
  std::string name;                   ///< "uniphy_simulate"
  std::string summary;                ///< what it does, a sentence or two
  std::vector<std::string> reads;     ///< a line each
  std::vector<std::string> writes;    ///< a line each, besides config.yaml and metrics.json
  std::vector<std::string> examples;  ///< sample command lines
};

/// The output directory of one run.
class RunDirectory {
 public:
  /// `report`: what --report shows, or null.
  RunDirectory(std::filesystem::path root, std::string config_yaml, int threads,
               std::shared_ptr<Report> report = nullptr);
  const std::filesystem::path& root() const { return root_; }
  /// The path of a product.
  std::filesystem::path file(const std::string& name) const { return root_ / name; }
  /// The resolved configuration, to store inside products.
  const std::string& config_yaml() const { return config_yaml_; }
  /// OpenMP threads of this run (already set for OpenMP).
  int threads() const { return threads_; }
  /// Says that the run did all it could and wrote its products, and yet has no answer: its exit
  /// code is kNoAnswer.
  void set_no_answer() { no_answer_ = true; }
  bool no_answer() const { return no_answer_; }

  /// Draws a chart as a PNG (plot_chart), and into the report where there is one.
  void draw(const std::string& name, const Chart& chart) const;
  /// Writes a table in Markdown (or a text), and shows it in the report where there is one, in
  /// place of one of the same title.
  void write_table(const std::string& name, const std::string& title,
                   const std::string& text) const;
  /// What --report shows; null without it, so that nothing is made for it in vain.
  Report* report() const { return report_.get(); }

 private:
  std::filesystem::path root_;
  std::string config_yaml_;
  int threads_;
  bool no_answer_ = false;
  std::shared_ptr<Report> report_;
};
inline constexpr int kNoAnswer = 3;

/// The second phase: does the work.
using RunFunction = std::function<void(RunDirectory& out, Metrics& metrics)>;
/// The first phase: declares and reads the keys, opens nothing, and returns the second phase. For
/// --help it runs without a document (config.describing() is true) and its result is dropped.
using DeclareFunction = std::function<RunFunction(Section& config)>;

/// Returns the exit code: 0, 1 after `error: ...` on stderr, kNoAnswer, 130 when interrupted.
/// Without --out the directory is out/<name without uniphy_>/<stem of CONFIG>.
int run_experiment(int argc, const char* const* argv, const ExperimentInfo& info,
                   const DeclareFunction& declare);

}  // namespace uniphy
