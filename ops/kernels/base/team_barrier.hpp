#pragma once

#include <atomic>
#include <thread>

#if defined(__linux__)
#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <climits>
#endif

namespace uniphy::kernels {

/// A barrier for the threads of one parallel region that meets thousands of times a second. It
/// spins for some 25 µs, which is longer than the threads of a balanced step wait for each other,
/// and then sleeps. The barrier of libgomp spins for milliseconds: on a machine that runs anything
/// else besides, the waiting thread takes the time slice of the one it waits for, and every step
/// costs a scheduling period (measured: 300 times slower).
class TeamBarrier {
 public:
  /// Returns once `parties` threads have called; memory written before is visible after.
  void wait(int parties) {
    if (parties == 1) return;
    const int generation = generation_.load(std::memory_order_acquire);
    if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == parties) {
      arrived_.store(0, std::memory_order_relaxed);
      generation_.fetch_add(1);
      if (sleepers_.load() > 0) wake();
      return;
    }
    for (int spin = 0; spin < kSpins; ++spin) {
      if (generation_.load(std::memory_order_acquire) != generation) return;
#if defined(__x86_64__) || defined(__i386__)
      __builtin_ia32_pause();
#endif
    }
    sleepers_.fetch_add(1);
    while (generation_.load() == generation) sleep(generation);
    sleepers_.fetch_sub(1);
  }

 private:
  static constexpr int kSpins = 500;

#if defined(__linux__)
  static_assert(sizeof(std::atomic<int>) == sizeof(int));
  void sleep(int seen) {
    syscall(SYS_futex, &generation_, FUTEX_WAIT_PRIVATE, seen, nullptr, nullptr, 0);
  }
  void wake() {
    syscall(SYS_futex, &generation_, FUTEX_WAKE_PRIVATE, INT_MAX, nullptr, nullptr, 0);
  }
#else
  void sleep(int) { std::this_thread::yield(); }
  void wake() {}
#endif

  alignas(64) std::atomic<int> generation_{0};
  alignas(64) std::atomic<int> arrived_{0};
  std::atomic<int> sleepers_{0};
};

}  // namespace uniphy::kernels
