#include "glyphs/jobs.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "fontcore/error.h"

namespace glyphs {

namespace {

/// How often the caller hears of progress: often enough for a bar that seems to move.
constexpr std::chrono::milliseconds progress_interval(100);

/// More threads than this only cost memory.
constexpr int most_threads = 256;

}  // namespace

void run_jobs(int count, const JobOptions& options, const std::function<void(int)>& work) {
  if (options.jobs < 0) throw fontcore::InvalidInput(fontcore::text("run_jobs: ", options.jobs, " threads"));
  const int wanted = options.jobs > 0 ? options.jobs : static_cast<int>(std::thread::hardware_concurrency());
  const int threads = std::clamp(wanted, 1, std::clamp(count, 1, most_threads));

  std::mutex mutex;
  std::condition_variable ended;
  std::atomic<int> next{0};
  int done = 0;
  int running = threads;
  int first_failed = count;
  std::exception_ptr failure;
  const auto run = [&] {
    for (int i = next++; i < count; i = next++) {
      std::exception_ptr thrown;
      try {
        work(i);
      } catch (...) {
        thrown = std::current_exception();
      }
      const std::lock_guard lock(mutex);
      ++done;
      if (thrown && i < first_failed) {
        first_failed = i;
        failure = thrown;
      }
    }
    const std::lock_guard lock(mutex);
    if (--running == 0) ended.notify_one();
  };

  {
    std::vector<std::jthread> pool;
    for (int t = 0; t < threads; ++t) pool.emplace_back(run);
    std::unique_lock lock(mutex);
    while (!ended.wait_for(lock, progress_interval, [&] { return running == 0; })) {
      if (!options.progress) continue;
      const int so_far = done;
      lock.unlock();
      options.progress(so_far, count);
      lock.lock();
    }
  }
  if (failure) std::rethrow_exception(failure);
  if (options.progress) options.progress(count, count);
}

int run_jobs_within(std::int64_t most, int count, const JobOptions& options,
                    const std::function<std::int64_t(int)>& work, int share) {
  // Costs are counted up to the first index not yet done: it is left undone only where those before it have spent all,
  // whatever the threads do; the last count, in order, decides.
  constexpr int worth_threads = 16;
  const int shares = (count + share - 1) / share;
  std::vector<std::int64_t> costs(static_cast<std::size_t>(count));
  std::vector<std::int64_t> spent(static_cast<std::size_t>(shares), -1);
  std::mutex mutex;
  std::size_t counted = 0;
  std::int64_t total = 0;
  JobOptions by_share = options;
  if (shares < worth_threads) by_share.jobs = 1;
  run_jobs(shares, by_share, [&](int s) {
    {
      const std::lock_guard lock(mutex);
      for (; counted < spent.size() && spent[counted] >= 0; ++counted) total += spent[counted];
      if (total > most) return;
    }
    std::int64_t sum = 0;
    for (int i = s * share; i < std::min(count, (s + 1) * share) && sum <= most; ++i) {
      sum += costs[static_cast<std::size_t>(i)] = work(i);
    }
    const std::lock_guard lock(mutex);
    spent[static_cast<std::size_t>(s)] = sum;
  });
  total = 0;
  for (int i = 0; i < count; ++i) {
    if (total > most) return i;
    total += costs[static_cast<std::size_t>(i)];
  }
  return count;
}

}  // namespace glyphs
