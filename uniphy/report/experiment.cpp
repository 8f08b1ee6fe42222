#include "uniphy/report/experiment.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>

#include "ops/kernels/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/interrupt.hpp"

namespace uniphy {
namespace {

constexpr int kMaximumThreads = 1024;

struct CommandLine {
  std::string config;
  std::vector<std::string> overrides;
  std::string out;
  int threads = 0;
  bool help = false;
};

void add_lines(std::string& text, const char* title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  text += fmt::format("\n{}:\n", title);
  for (const std::string& line : lines) text += fmt::format("  {}\n", line);
}

std::string default_directory(const ExperimentInfo& info, const std::string& config) {
  const std::string prefix = "uniphy_";
  const std::string stage =
      info.name.rfind(prefix, 0) == 0 ? info.name.substr(prefix.size()) : info.name;
  return (std::filesystem::path("out") / stage / std::filesystem::path(config).stem()).string();
}

std::string help_text(const ExperimentInfo& info, const DeclareFunction& declare) {
  Config config = Config::describe();
  Section root = config.root();
  declare(root);
  std::string text = fmt::format(
      "{}: {}\n\nUsage: {} CONFIG.yaml [--set key.path=value]... [--out DIR] [--threads N]\n",
      info.name, info.summary, info.name);
  add_lines(text, "Reads", info.reads);
  std::vector<std::string> writes = info.writes;
  writes.push_back("DIR/config.yaml     the configuration with every default filled in");
  writes.push_back("DIR/metrics.json    name -> number, with wall_s and peak_memory_mb");
  add_lines(text, "Writes", writes);
  add_lines(text, "Options",
            {"--set KEY=VALUE  sets a key over the file, value in YAML (bodies.0.density=500)",
             fmt::format("--out DIR        output directory, default {}",
                         default_directory(info, "CONFIG")),
             "--threads N      threads, default what OpenMP takes (OMP_NUM_THREADS)",
             "--help           this text"});
  add_lines(text, "Examples", info.examples);
  return text + "\nKeys of CONFIG.yaml:\n" + config.table();
}

/// Throws Error for a malformed command line.
CommandLine parse_command_line(int argc, const char* const* argv, const ExperimentInfo& info) {
  CommandLine line;
  CLI::App app(info.summary, info.name);
  app.set_help_flag();
  app.add_flag("-h,--help", line.help);
  app.add_option("CONFIG", line.config);
  app.add_option("--set", line.overrides)->type_size(1)->allow_extra_args(false);
  app.add_option("--out", line.out);
  const auto* threads = app.add_option("--threads", line.threads);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    throw Error(fmt::format("command line: {}; see {} --help", error.what(), info.name));
  }
  if (line.help) return line;
  if (line.config.empty()) {
    throw Error(fmt::format("command line: expected CONFIG.yaml, found no argument; see {} --help",
                            info.name));
  }
  if (threads->count() > 0 && (line.threads < 1 || line.threads > kMaximumThreads)) {
    throw Error(fmt::format("command line: --threads: expected an integer in [1, {}], found {}",
                            kMaximumThreads, line.threads));
  }
  if (line.out.empty()) line.out = default_directory(info, line.config);
  return line;
}

void run(const CommandLine& line, const ExperimentInfo& info, const DeclareFunction& declare,
         std::chrono::steady_clock::time_point start) {
  const Config config = Config::load(line.config, line.overrides);
  Section root = config.root();
  const RunFunction work = declare(root);
  config.finish();

  if (line.threads > 0) omp_set_num_threads(line.threads);
  make_directory(line.out);
  const std::string resolved = config.resolved();
  RunDirectory out(line.out, resolved, omp_get_max_threads());
  write_text_file(out.file("config.yaml"),
                  fmt::format("# {} {}\n{}", info.name, line.config, resolved));
  // Numbers of an earlier run would pass for those of this one if it fails.
  std::error_code ignored;
  std::filesystem::remove(out.file("metrics.json"), ignored);

  catch_interrupts();
  Metrics metrics;
  work(out, metrics);
  metrics.add_resources(start);
  metrics.write(out.file("metrics.json"));
}

}  // namespace

RunDirectory::RunDirectory(std::filesystem::path root, std::string config_yaml, int threads)
    : root_(std::move(root)), config_yaml_(std::move(config_yaml)), threads_(threads) {}

int run_experiment(int argc, const char* const* argv, const ExperimentInfo& info,
                   const DeclareFunction& declare) {
  const auto start = std::chrono::steady_clock::now();
  try {
    const CommandLine line = parse_command_line(argc, argv, info);
    if (line.help) {
      std::fputs(help_text(info, declare).c_str(), stdout);
      return 0;
    }
    run(line, info, declare, start);
    return 0;
  } catch (const Interrupted& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 130;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "error: out of memory\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
  } catch (...) {
    std::fprintf(stderr, "error: unknown error\n");
  }
  return 1;
}

}  // namespace uniphy
