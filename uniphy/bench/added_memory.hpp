#pragma once

namespace uniphy::bench {

/// The peak of resident memory since the construction, above what was resident then (MiB). Free
/// memory of the heap is given back first, so that it does not hide anything. Where the kernel does
/// not let a process reset its peak (/proc/self/clear_refs), growth of the peak of the whole
/// process, a lower bound.
class AddedMemory {
 public:
  AddedMemory();
  double peak_mb() const;

 private:
  double before_;
};

}  // namespace uniphy::bench
