// How long the threads of OpenMP spin while they wait for each other.
//
// libgomp spins 300,000 times, some 15 ms, before it sleeps. On a machine that runs anything else
// besides, the waiting thread then takes the time slice of the one it waits for, again and again:
// 1000 steps of uniphy_train on two threads, beside two busy loops on two cores, took 59 s. The
// number can only be set by the environment, and only before libgomp is loaded. So a program that
// finds it unset starts itself anew with it, before the constructors of its libraries have run
// (20 ms with LibTorch).

#if defined(__linux__)

#include <alloca.h>
#include <unistd.h>

#include <cstddef>
#include <cstring>

namespace {

/// Some 1 ms: more than the threads of a training step wait for each other. Of 2000 steps on a
/// quiet machine and 1000 beside two busy loops, in seconds: 100 spins 6.0 and 5.2 (a short loop
/// sleeps in every step), 5000 4.5 and 7.3, 10,000 4.3 and 8.6, 20,000 4.0 and 11.3, libgomp's
/// 300,000 4.0 and 59.5; one thread 5.9 and 6.5.
char kSpins[] = "GOMP_SPINCOUNT=20000";

bool sets(const char* entry, const char* name) {
  const std::size_t length = std::strlen(name);
  return std::strncmp(entry, name, length) == 0 && entry[length] == '=';
}

void bound_waits(int, char** argv, char** environment) {
  std::size_t count = 0;
  for (; environment[count] != nullptr; ++count) {
    // The user's own choice stands; after the new start this ends here, too.
    if (sets(environment[count], "GOMP_SPINCOUNT")) return;
    if (sets(environment[count], "OMP_WAIT_POLICY")) return;
  }
  char self[4096];
  const ssize_t length = ::readlink("/proc/self/exe", self, sizeof self - 1);
  if (length <= 0) return;
  self[length] = '\0';
  // On the stack, for this runs before the C library is set up.
  auto** extended = static_cast<char**>(alloca((count + 2) * sizeof(char*)));
  std::memcpy(extended, environment, count * sizeof(char*));
  extended[count] = kSpins;
  extended[count + 1] = nullptr;
  ::execve(self, argv, extended);
  // It only returns where it fails; then the program goes on as it is.
}

[[gnu::section(".preinit_array"), gnu::used]] void (*const entry)(int, char**,
                                                                  char**) = bound_waits;

}  // namespace

#endif
