#include "uniphy/report/experiment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "tests/uniphy/support/scratch.hpp"
#include "uniphy/io/atomic_file.hpp"
#include "uniphy/report/interrupt.hpp"
#include "uniphy/report/progress.hpp"

namespace uniphy {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const ExperimentInfo kInfo{"uniphy_example",
                           "Adds numbers.",
                           {"CONFIG.yaml  the numbers"},
                           {"DIR/sum.txt  their sum"},
                           {"uniphy_example configs/example/one.yaml --set a=2"}};

struct Result {
  int code = 0;
  std::string out;
  std::string err;
};

RunFunction add(Section& config) {
  const double a = config.real("a", 1, any_number(), "m", "the first number");
  const double b = config.real("b", required, any_number(), "m", "the second number");
  return [=](RunDirectory& out, Metrics& metrics) {
    if (a + b > 1000) throw Error("the sum is too large");
    if (a + b == 999) {
      write_text_file(out.file("half.txt"), "half");
      throw Error("half of it");
    }
    if (a + b < -1000) throw std::runtime_error("not even an Error");
    write_text_file(out.file("sum.txt"), std::to_string(a + b));
    metrics.set("sum", a + b);
    if (a + b == 777) out.set_no_answer();
    metrics.set("threads", out.threads());
  };
}

/// Runs with the arguments; "@" stands for the scratch directory.
Result run(const testing::Scratch& scratch, std::vector<std::string> arguments,
           const DeclareFunction& declare = add) {
  arguments.insert(arguments.begin(), "uniphy_example");
  std::vector<const char*> argv;
  for (std::string& argument : arguments) {
    const std::size_t at = argument.find('@');
    if (at != std::string::npos) argument.replace(at, 1, scratch.path().string());
    argv.push_back(argument.c_str());
  }
  argv.push_back(nullptr);
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  Result result;
  result.code = run_experiment(static_cast<int>(argv.size()) - 1, argv.data(), kInfo, declare);
  result.out = ::testing::internal::GetCapturedStdout();
  result.err = testing::without_directory(::testing::internal::GetCapturedStderr(), scratch.path());
  return result;
}

TEST(Experiment, WritesProductResolvedConfigurationAndMetrics) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  const Result result =
      run(scratch, {"@/c.yaml", "--set", "a=5", "--out", "@/new/out", "--threads", "1"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(read_text_file(scratch.file("new/out/sum.txt")), "7.000000");
  const Metrics metrics = Metrics::read(scratch.file("new/out/metrics.json"));
  EXPECT_EQ(metrics.find("sum"), 7);
  EXPECT_EQ(metrics.find("threads"), 1);
  EXPECT_GT(*metrics.find("wall_s"), 0);
  EXPECT_GT(*metrics.find("peak_memory_mb"), 1);
  const Config again = Config::load(scratch.file("new/out/config.yaml"));
  EXPECT_EQ(again.root().real("a", 1, any_number(), "", ""), 5);
  // The resolved configuration is a configuration: the run can be repeated from it.
  EXPECT_EQ(run(scratch, {"@/new/out/config.yaml", "--out", "@/again"}).code, 0);
  EXPECT_EQ(read_text_file(scratch.file("again/sum.txt")), "7.000000");
}

TEST(Experiment, TheLastLineSaysWhatCameOutAndWhereItLies) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  const std::string out = scratch.file("out").string();
  const std::string whole = out + ": sum.txt, metrics.json, config.yaml\n";
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).out, whole);
  // What another program left there is not of this run.
  scratch.write("out/other.txt", "");
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).out, whole);
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out", "--set", "b=776"}).out, whole);
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out", "--set", "b=9999"}).out, "");

  const DeclareFunction many = [](Section& config) -> RunFunction {
    config.real("b", required, any_number(), "m", "unused");
    return [](RunDirectory& directory, Metrics&) {
      std::printf("all of them\n");
      for (int i = 0; i < 9; ++i)
        write_text_file(directory.file("part" + std::to_string(i) + ".txt"), "");
      make_directory(directory.file("fits"));
      write_text_file(directory.file("fits/a"), "");
      write_text_file(directory.file("fits/b"), "");
    };
  };
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}, many).out,
            "all of them\n" + out +
                ": fits/ (2 files), part0.txt, part1.txt, part2.txt, part3.txt, part4.txt, "
                "part5.txt, part6.txt and 2 more, metrics.json, config.yaml\n");
}

TEST(Experiment, ARunWithoutAnAnswerWritesAllAndHasACodeOfItsOwn) {
  const testing::Scratch scratch;
  write_text_file(scratch.file("c.yaml"), "b: 776\n");
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).code, kNoAnswer);
  EXPECT_EQ(Metrics::read(scratch.file("out/metrics.json")).find("sum"), 777);
}

TEST(Experiment, OptionsMayComeInAnyOrderAndRepeat) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  const Result result =
      run(scratch, {"--set", "a=5", "--out=@/o", "--set=b=6", "--threads=1", "@/c.yaml"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(read_text_file(scratch.file("o/sum.txt")), "11.000000");
  const Result list = run(scratch, {"@/c.yaml", "--set", "b=[1, 2]", "--out", "@/o"});
  EXPECT_EQ(list.err,
            "error: --set b=[1, 2]: b: expected a finite number (m), found a list of 2\n");
}

TEST(Experiment, HelpTellsWhatItDoesReadsWritesAndEveryKey) {
  const testing::Scratch scratch;
  for (const char* flag : {"--help", "-h"}) {
    const Result result = run(scratch, {flag});
    EXPECT_EQ(result.code, 0);
    for (const char* part :
         {"Adds numbers.", "Usage: uniphy_example CONFIG.yaml [--set key.path=value]...",
          "CONFIG.yaml  the numbers", "DIR/sum.txt  their sum", "metrics.json", "config.yaml",
          "--set a=2", "the first number", "finite number (m), default 1",
          "finite number (m), required"}) {
      EXPECT_THAT(result.out, HasSubstr(part));
    }
  }
}

TEST(Experiment, SchemaIsPrintedWithoutAConfiguration) {
  const testing::Scratch scratch;
  const Result result = run(scratch, {"--schema"});
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.err, "");
  for (const char* part :
       {"\"title\": \"uniphy_example\"", "\"description\": \"the first number (m)\"",
        "\"default\": 1", "\"required\": [\n    \"b\"\n  ]"}) {
    EXPECT_THAT(result.out, HasSubstr(part));
  }
}

TEST(Experiment, BadCommandLinesAreRefused) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  scratch.write("wrong.yaml", "a: 1\nb: 2\nd: 3\n");
  scratch.write("file", "");
  struct Case {
    std::vector<std::string> arguments;
    const char* message;
  };
  const Case cases[] = {
      {{},
       "error: command line: expected CONFIG.yaml, found no argument; see uniphy_example "
       "--help\n"},
      {{"@/none.yaml"}, "error: none.yaml: expected a file, found nothing of that name\n"},
      {{"@/c.yaml", "--threads", "0"},
       "error: command line: --threads: expected an integer in [1, 1024], found 0\n"},
      {{"@/c.yaml", "--threads", "-3"},
       "error: command line: --threads: expected an integer in [1, 1024], found -3\n"},
      {{"@/c.yaml", "--set", "a"}, "error: --set a: expected key.path=value\n"},
      {{"@/c.yaml", "--set", "c=1"}, "error: --set c=1: c: unknown key; known keys here: a, b\n"},
      {{"@/c.yaml", "--set", "b=x"},
       "error: --set b=x: b: expected a finite number (m), found \"x\"\n"},
      {{"@/c.yaml", "--out", "@/file"},
       "error: file: expected a directory, found a file of that name\n"},
      {{"@/wrong.yaml", "--out", "@/o"},
       "error: wrong.yaml:3: d: unknown key; known keys here: a, b\n"},
      {{"@/c.yaml", "--set", "a=999", "--out", "@/o"}, "error: the sum is too large\n"},
      {{"@/c.yaml", "--set", "a=-9999", "--out", "@/o"}, "error: not even an Error\n"},
  };
  for (const Case& c : cases) {
    const Result result = run(scratch, c.arguments);
    EXPECT_EQ(result.code, 1);
    EXPECT_EQ(result.err, c.message);
    EXPECT_EQ(result.out, "");
  }
  // What CLI11 itself refuses comes in its own words.
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"@/c.yaml", "--colour"},
        {"@/c.yaml", "two.yaml"},
        {"@/c.yaml", "--set"},
        {"@/c.yaml", "--threads", "many"},
        {"@/c.yaml", "--out"}}) {
    const Result result = run(scratch, arguments);
    EXPECT_EQ(result.code, 1) << arguments.back();
    EXPECT_THAT(result.err, ::testing::StartsWith("error: command line: "));
    EXPECT_THAT(result.err, HasSubstr("see uniphy_example --help\n"));
  }
}

TEST(Experiment, RefusedConfigurationLeavesNoDirectory) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: x\n");
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(scratch.file("out")));
}

TEST(Experiment, ARunThatFailsAfterItWroteLeavesNoMetricsOfAnEarlierOne) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).code, 0);
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out", "--set", "a=997"}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(scratch.file("out/metrics.json")));
  EXPECT_THAT(read_text_file(scratch.file("out/config.yaml")), HasSubstr("a: 997"));
}

TEST(Experiment, ARunThatFailsBeforeItWroteLeavesTheDirectoryAsItWas) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).code, 0);
  const std::string config = read_text_file(scratch.file("out/config.yaml"));
  const std::string metrics = read_text_file(scratch.file("out/metrics.json"));
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out", "--set", "a=9999"}).code, 1);
  EXPECT_EQ(read_text_file(scratch.file("out/config.yaml")), config);
  EXPECT_EQ(read_text_file(scratch.file("out/metrics.json")), metrics);
  // And one that was not there is not there.
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/new/deep", "--set", "a=9999"}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(scratch.file("new")));
}

TEST(Experiment, ADirectoryBelongsToOneRunAtATime) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  int inner = 0;
  std::string config;
  EXPECT_EQ(
      run(scratch, {"@/c.yaml", "--out", "@/out"},
          [&](Section& section) -> RunFunction {
            section.real("b", required, any_number(), "m", "unused");
            return [&](RunDirectory& out, Metrics&) {
              config = read_text_file(out.file("config.yaml"));
              const std::string file = scratch.file("c.yaml").string();
              const char* argv[] = {"uniphy_example", file.c_str(), "--out", out.root().c_str()};
              inner = run_experiment(4, argv, kInfo, add);
              EXPECT_EQ(read_text_file(out.file("config.yaml")), config);
            };
          })
          .code,
      0);
  EXPECT_EQ(inner, 1);
  EXPECT_EQ(run(scratch, {"@/c.yaml", "--out", "@/out"}).code, 0);
}

/// Starts a run that never ends on its own, sends the signals, and returns its wait status.
int status_after(const testing::Scratch& scratch, const std::vector<int>& signals, bool polls) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::freopen("/dev/null", "w", stderr);
    const std::string config = scratch.file("c.yaml").string();
    const std::string out = scratch.file("out").string();
    const char* argv[] = {"uniphy_example", config.c_str(), "--out", out.c_str()};
    ::_exit(run_experiment(4, argv, kInfo, [&](Section& section) -> RunFunction {
      section.real("b", required, any_number(), "m", "unused");
      return [&](RunDirectory& directory, Metrics&) {
        write_text_file(directory.file("finished.txt"), "whole");
        Progress progress("wait", 0);
        for (int i = 0;; ++i) {
          if (polls) progress.update(i);
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
      };
    }));
  }
  while (!std::filesystem::exists(scratch.file("out/finished.txt"))) ::usleep(2000);
  for (const int signal : signals) {
    ::usleep(50000);
    ::kill(child, signal);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return status;
}

TEST(Experiment, SignalStopsAtTheNextStepAndKeepsFinishedFiles) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const testing::Scratch scratch;
    scratch.write("c.yaml", "b: 2\n");
    const int status = status_after(scratch, {signal}, true);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 130);
    EXPECT_EQ(read_text_file(scratch.file("out/finished.txt")), "whole");
    EXPECT_TRUE(std::filesystem::exists(scratch.file("out/config.yaml")));
    EXPECT_FALSE(std::filesystem::exists(scratch.file("out/metrics.json")));
  }
}

TEST(Experiment, SecondSignalEndsARunThatDoesNotListen) {
  const testing::Scratch scratch;
  scratch.write("c.yaml", "b: 2\n");
  const int status = status_after(scratch, {SIGINT, SIGINT}, false);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(WTERMSIG(status), SIGINT);
}

TEST(Experiment, AFileBeyondTheLimitIsAnError) {
  const testing::Scratch scratch;
  const std::string config = scratch.write("c.yaml", "b: 2\n"), out = scratch.file("out");
  for (const rlim_t room : {0, 1000}) {  // for config.yaml, and for what the run writes
    const pid_t child = ::fork();
    if (child == 0) {
      std::signal(SIGXFSZ, SIG_DFL);
      const rlimit limit{room, room};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      const char* argv[] = {"uniphy_example", config.c_str(), "--out", out.c_str()};
      ::_exit(run_experiment(4, argv, kInfo, [&](Section& section) -> RunFunction {
        section.real("b", required, any_number(), "m", "unused");
        return [](RunDirectory& directory, Metrics&) {
          write_text_file(directory.file("large.txt"), std::string(10000, 'x'));
        };
      }));
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status)) << room;
    EXPECT_EQ(WEXITSTATUS(status), 1) << room;
    EXPECT_FALSE(std::filesystem::exists(scratch.file("out/large.txt"))) << room;
  }
}

}  // namespace
}  // namespace uniphy
