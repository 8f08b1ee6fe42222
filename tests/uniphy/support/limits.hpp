#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <exception>
#include <string>

namespace uniphy::testing {

/// What `work` throws in a process of its own with a limit on a resource ("" where it throws
/// nothing). The process leaves through its exit handlers; one that ends otherwise fails the test.
template <class Resource, class Work>
std::string error_with_limit(Resource resource, rlim_t amount, const Work& work) {
  int ends[2];
  if (::pipe(ends) != 0) {
    ADD_FAILURE() << "no pipe";
    return "";
  }
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(ends[0]);
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{amount, amount};
    ::setrlimit(resource, &limit);
    std::string message;
    try {
      work();
    } catch (const std::exception& error) {
      message = error.what();
    }
    const bool told = ::write(ends[1], message.data(), message.size()) == ssize_t(message.size());
    std::exit(told ? 0 : 1);
  }
  ::close(ends[1]);
  std::string message;
  char buffer[4096];
  for (ssize_t count; (count = ::read(ends[0], buffer, sizeof buffer)) > 0;) {
    message.append(buffer, std::size_t(count));
  }
  ::close(ends[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status)) << "limit " << amount << ", signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0) << "limit " << amount;
  return message;
}

/// The same where files may be at most `bytes` long, as on a disk with so much room.
template <class Work>
std::string error_with_room_for(rlim_t bytes, const Work& work) {
  return error_with_limit(RLIMIT_FSIZE, bytes, work);
}

}  // namespace uniphy::testing
