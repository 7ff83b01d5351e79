#pragma once

#include <cstdint>
#include <functional>

namespace glyphs {

/// How work over many glyphs is spread and watched.
struct JobOptions {
  int jobs = 0;  ///< threads; 0: all cores
  std::function<void(int done, int total)>
      progress;  ///< called from the calling thread, and at the end with done = total
};

/// Calls `work(0)` to `work(count - 1)`, each once, on several threads; returns when all are done.
///
/// Work that writes to its own place gives the same result for every number of threads. If some of it throws, all the
/// rest is still done, and the exception of the lowest index is thrown: the same one for every number of threads.
///
/// Throws  InvalidInput if `jobs` is negative; whatever `work` throws.
void run_jobs(int count, const JobOptions& options, const std::function<void(int)>& work);

/// The same within a budget: `work` says what it has cost. Returns the first index before which the costs, added up in
/// order, are over `most`, or `count`; what lies at it and behind may have been done or not. A thread takes `share`
/// indices at a time: many where each is soon done.
int run_jobs_within(std::int64_t most, int count, const JobOptions& options,
                    const std::function<std::int64_t(int)>& work, int share = 64);

}  // namespace glyphs
