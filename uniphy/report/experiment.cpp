#include "uniphy/report/experiment.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <omp.h>
#include <sys/file.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <optional>

#include "ops/kernels/base/error.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/directory_listing.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/report_writer.hpp"

namespace uniphy {
namespace {

constexpr int kMaximumThreads = 1024;

struct CommandLine {
  std::string config;
  std::vector<std::string> overrides;
  std::string out;
  int threads = 0;
  bool report = false;
  bool help = false;
  bool schema = false;
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
      "{}: {}\n\nUsage: {} CONFIG.yaml [--set key.path=value]... [--out DIR] [--threads N] "
      "[--report]\n",
      info.name, info.summary, info.name);
  add_lines(text, "Reads", info.reads);
  std::vector<std::string> writes = info.writes;
  writes.push_back("DIR/config.yaml     the configuration with every default filled in");
  writes.push_back("DIR/metrics.json    name -> number, with wall_s and peak_memory_mb");
  writes.push_back(
      "DIR/report.html     with --report: tables, charts, motions, all of it to look at");
  add_lines(text, "Writes", writes);
  add_lines(
      text, "Options",
      {"--set KEY=VALUE  sets a key over the file, value in YAML (bodies.0.density=500);",
       "                 KEY=null takes it back, as if the file did not give it; also a whole",
       "                 section, and an entry of a list (bodies.1=null)",
       fmt::format("--out DIR        output directory, default {}",
                   default_directory(info, "CONFIG")),
       "--threads N      threads, default what OpenMP takes (OMP_NUM_THREADS)",
       "--report         also writes report.html, one file that opens in a browser; needs",
       fmt::format("                 libjs-three, or {} set to three.min.js;", kThreeJsVariable),
       "                 --no-report takes it back",
       "--schema         prints a JSON Schema of CONFIG.yaml, by which editors complete and check "
       "it",
       "--help           this text"});
  add_lines(text, "Examples", info.examples);
  return text + "\nKeys of CONFIG.yaml:\n" + config.table();
}

std::string schema_text(const ExperimentInfo& info, const DeclareFunction& declare) {
  Config config = Config::describe();
  Section root = config.root();
  declare(root);
  return config.schema(info.name, info.summary);
}

/// Throws Error for a malformed command line.
CommandLine parse_command_line(int argc, const char* const* argv, const ExperimentInfo& info) {
  CommandLine line;
  CLI::App app(info.summary, info.name);
  app.set_help_flag();
  app.add_flag("-h,--help", line.help);
  app.add_flag("--schema", line.schema);
  app.add_option("CONFIG", line.config);
  app.add_option("--set", line.overrides)->type_size(1)->allow_extra_args(false);
  app.add_option("--out", line.out);
  app.add_flag("--report,!--no-report", line.report);
  const auto* threads = app.add_option("--threads", line.threads);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    throw Error(fmt::format("command line: {}; see {} --help", error.what(), info.name));
  }
  if (line.help || line.schema) return line;
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

/// Puts a directory back where a run failed before it had written anything: its configuration next
/// to the products of an earlier one would be a lie, and so would a directory without any.
class Undo {
 public:
  explicit Undo(std::filesystem::path directory) : directory_(std::move(directory)) {
    for (auto d = std::filesystem::absolute(directory_).lexically_normal();
         !std::filesystem::exists(d, ignored_) && d.has_relative_path(); d = d.parent_path()) {
      made_.push_back(d);
    }
    for (const char* name : {kConfig, kMetrics, kReport}) {
      if (std::filesystem::is_regular_file(directory_ / name, ignored_))
        kept_.emplace_back(name, read_text_file(directory_ / name));
    }
  }
  /// Call when the frame's own files have been written, and the work begins.
  void begin() { before_.emplace(directory_); }

  void run() const {
    // Where there are products, they need their configuration.
    if (!before_ || !(DirectoryListing(directory_) == *before_)) return;
    std::filesystem::remove(directory_ / kConfig, ignored_);
    for (const auto& [name, text] : kept_) write_text_file(directory_ / name, text);
    for (const auto& d : made_) std::filesystem::remove(d, ignored_);  // if empty
  }

  /// What the work has written, in a line.
  std::string products() const {
    std::vector<std::string> names;
    if (before_) names = DirectoryListing(directory_).changed_since(*before_);
    const bool report = std::filesystem::exists(directory_ / kReport, ignored_);
    for (const char* own : {kReport, kMetrics, kConfig}) {
      names.erase(std::remove(names.begin(), names.end(), own), names.end());
    }
    std::string text = joined_names(names, kProducts);
    for (const char* own : {report ? kReport : "", kMetrics, kConfig}) {
      if (*own) text += (text.empty() ? "" : ", ") + std::string(own);
    }
    return text;
  }

  static constexpr std::size_t kProducts = 8;  ///< named in the line
  static constexpr const char* kConfig = "config.yaml";
  static constexpr const char* kMetrics = "metrics.json";
  static constexpr const char* kReport = "report.html";

 private:
  std::filesystem::path directory_;
  std::vector<std::filesystem::path> made_;  ///< innermost first
  std::vector<std::pair<std::string, std::string>> kept_;
  std::optional<DirectoryListing> before_;
  mutable std::error_code ignored_;
};

/// Held while a run writes to its directory: two of them would take each other's files.
class DirectoryLock {
 public:
  explicit DirectoryLock(const std::filesystem::path& directory)
      : file_(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    // Some network file systems know no locks; that is no reason to refuse them.
    if (file_ < 0 || ::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    ::close(file_);
    throw Error(directory.string() +
                ": expected a directory of this run alone, found another process at work there");
  }
  ~DirectoryLock() {
    if (file_ >= 0) ::close(file_);
  }
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  int file_;
};

int run(const CommandLine& line, const ExperimentInfo& info, const DeclareFunction& declare,
        std::chrono::steady_clock::time_point start) {
  const Config config = Config::load(line.config, line.overrides);
  Section root = config.root();
  const RunFunction work = declare(root);
  config.finish();
  ReportWriter report(line.report, info.name, info.summary, line.config);

  if (line.threads > 0) omp_set_num_threads(line.threads);
  Undo undo(line.out);
  make_directory(line.out);
  const DirectoryLock lock(line.out);
  const std::string resolved = config.resolved();
  RunDirectory out(line.out, resolved, omp_get_max_threads(), report.report());
  write_text_file(out.file(Undo::kConfig),
                  fmt::format("# {} {}\n{}", info.name, line.config, resolved));
  // Numbers of an earlier run would pass for those of this one if it fails.
  std::error_code ignored;
  std::filesystem::remove(out.file(Undo::kMetrics), ignored);
  std::filesystem::remove(out.file(Undo::kReport), ignored);
  undo.begin();

  catch_interrupts();
  Metrics metrics;
  try {
    work(out, metrics);
  } catch (...) {
    report.write_failed(out.file(Undo::kReport), resolved, metrics);
    try {
      undo.run();
    } catch (const Error&) {  // what ended the run is what the user has to hear of
    }
    throw;
  }
  metrics.add_resources(start);
  metrics.write(out.file(Undo::kMetrics));
  report.write(out.file(Undo::kReport), resolved, metrics);
  std::fflush(stderr);
  std::printf("%s: %s\n", line.out.c_str(), undo.products().c_str());
  return out.no_answer() ? kNoAnswer : 0;
}

}  // namespace

RunDirectory::RunDirectory(std::filesystem::path root, std::string config_yaml, int threads,
                           std::shared_ptr<Report> report)
    : root_(std::move(root)),
      config_yaml_(std::move(config_yaml)),
      threads_(threads),
      report_(std::move(report)) {}

void RunDirectory::draw(const std::string& name, const Chart& chart) const {
  plot_chart(file(name), chart);
  if (report_) report_->charts.push_back(chart);
}

void RunDirectory::write_table(const std::string& name, const std::string& title,
                               const std::string& text) const {
  write_text_file(file(name), text);
  if (report_) report_->set_table(title, text);
}

int run_experiment(int argc, const char* const* argv, const ExperimentInfo& info,
                   const DeclareFunction& declare) {
  const auto start = std::chrono::steady_clock::now();
  // A file beyond the limit on file sizes (ulimit -f) is an error of its writer, not the end.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    const CommandLine line = parse_command_line(argc, argv, info);
    if (line.help) {
      std::fputs(help_text(info, declare).c_str(), stdout);
      return 0;
    }
    if (line.schema) {
      std::fputs(schema_text(info, declare).c_str(), stdout);
      return 0;
    }
    return run(line, info, declare, start);
  } catch (const Interrupted& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 130;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "error: out of memory\n");
  } catch (const std::exception& error) {
    // LibTorch's errors go on with a stack trace, a frame a line.
    const std::string text = error.what();
    std::fprintf(stderr, "error: %s\n", text.substr(0, text.find('\n')).c_str());
  } catch (...) {
    std::fprintf(stderr, "error: unknown error\n");
  }
  return 1;
}

}  // namespace uniphy
