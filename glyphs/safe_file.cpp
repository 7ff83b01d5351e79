#include "glyphs/safe_file.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <system_error>

#include "fontcore/error.h"
#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::text;

[[noreturn]] void fail(const std::string& path, const std::string& why) {
  throw FontWriteError(text(path, ": cannot be written: ", why));
}
[[noreturn]] void fail(const std::string& path, int error) { fail(path, std::generic_category().message(error)); }

// ---- signals

/// A temporary file's name where a signal handler can find it. Names stay allocated and are used again, so the list
/// only grows to as many as were ever open at once.
struct TemporaryName {
  std::atomic<bool> is_taken{false};
  std::atomic<bool> is_live{false};
  char path[PATH_MAX] = "";
  TemporaryName* next = nullptr;
};
std::atomic<TemporaryName*> temporary_names{nullptr};
static_assert(std::atomic<TemporaryName*>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

TemporaryName& take_name() {
  for (TemporaryName* name = temporary_names.load(); name; name = name->next) {
    if (!name->is_taken.exchange(true)) return *name;
  }
  auto* fresh = new TemporaryName;  // never freed: a handler may be reading it
  fresh->is_taken = true;
  fresh->next = temporary_names.load();
  while (!temporary_names.compare_exchange_weak(fresh->next, fresh)) {
  }
  return *fresh;
}

/// Removes the temporary files and lets the signal do what it would have done. Async-signal-safe.
extern "C" void glyphwave_remove_temporaries(int signal) {
  const int saved = errno;
  for (TemporaryName* name = temporary_names.load(); name; name = name->next) {
    if (name->is_live.load()) ::unlink(name->path);
  }
  std::signal(signal, SIG_DFL);
  std::raise(signal);
  errno = saved;
}

/// While one lives, signals that would end the program remove its temporary files first. Signals that the program
/// ignores or handles itself are left to it.
class SignalGuard {
 public:
  SignalGuard() {
    const std::lock_guard lock(mutex_);
    if (count_++ > 0) return;
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      is_ours_[i] = ::sigaction(signals_[i], nullptr, &previous_[i]) == 0 &&
                    (previous_[i].sa_flags & SA_SIGINFO) == 0 && previous_[i].sa_handler == SIG_DFL;
      if (!is_ours_[i]) continue;
      struct sigaction action {};
      action.sa_handler = glyphwave_remove_temporaries;
      ::sigfillset(&action.sa_mask);
      is_ours_[i] = ::sigaction(signals_[i], &action, nullptr) == 0;
    }
  }
  SignalGuard(const SignalGuard&) = delete;
  SignalGuard& operator=(const SignalGuard&) = delete;
  ~SignalGuard() {
    const std::lock_guard lock(mutex_);
    if (--count_ > 0) return;
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      struct sigaction now {};
      if (!is_ours_[i] || ::sigaction(signals_[i], nullptr, &now) != 0) continue;
      if (now.sa_handler == glyphwave_remove_temporaries) ::sigaction(signals_[i], &previous_[i], nullptr);
    }
  }

 private:
  static constexpr std::array signals_{SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGXFSZ, SIGQUIT};
  static inline std::mutex mutex_;
  static inline int count_ = 0;
  static inline std::array<struct sigaction, signals_.size()> previous_{};
  static inline std::array<bool, signals_.size()> is_ours_{};
};

// ---- files

class Descriptor {
 public:
  explicit Descriptor(int opened = -1) : number_(opened) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { close(); }

  int number() const { return number_; }
  /// 0, or the error. The descriptor is gone either way; on Linux also after EINTR.
  int close() {
    const int error = number_ >= 0 && ::close(number_) != 0 && errno != EINTR ? errno : 0;
    number_ = -1;
    return error;
  }

 private:
  int number_;
};

/// 0, or the error.
int write_all(int file, std::span<const unsigned char> data) {
  while (!data.empty()) {
    const ssize_t written = ::write(file, data.data(), data.size());
    if (written < 0 && errno != EINTR) return errno;
    if (written == 0) return EIO;
    if (written > 0) data = data.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

/// 0, or the error. What cannot be flushed (a pipe, some file systems) is none.
int flush(int file) {
  while (::fsync(file) != 0) {
    if (errno == EINVAL || errno == ENOTSUP || errno == ENOSYS || errno == EROFS) return 0;
    if (errno != EINTR) return errno;
  }
  return 0;
}

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

/// The file that a path names, links followed; a link may name a file that does not exist yet.
std::string follow_links(const std::string& path) {
  constexpr int most_links = 40;  // as the kernel
  std::string target = path;
  for (int i = 0; i < most_links; ++i) {
    char link[PATH_MAX];
    const ssize_t length = ::readlink(target.c_str(), link, sizeof link);
    if (length < 0) return target;  // not a link, or not there: opening it will tell
    const std::string next(link, static_cast<std::size_t>(length));
    target = next.front() == '/' ? next : folder_of(target) + "/" + next;
  }
  fail(path, ELOOP);
}

/// Where a file's bytes are to go.
struct Target {
  std::string path;        ///< as asked, for messages
  std::string file;        ///< links followed
  bool is_direct = false;  ///< a device, a pipe, or an open descriptor: written in place
  std::optional<struct stat> old;
};

Target find_target(const std::string& path) {
  if (path.empty()) fail("output", "the path is empty");
  Target target{.path = path, .file = path, .is_direct = false, .old = {}};
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) {
    if (S_ISDIR(status.st_mode)) fail(path, EISDIR);
    // What lies under /dev and /proc belongs to who opened it, even where it is a regular file (> out).
    target.is_direct = !S_ISREG(status.st_mode) || path.starts_with("/dev/") || path.starts_with("/proc/");
    target.old = status;
  } else if (errno != ENOENT) {
    fail(path, errno);
  }
  if (target.is_direct) return target;
  target.file = follow_links(path);
  if (target.file.ends_with('/')) fail(path, ENOTDIR);
  if (target.old && ::access(path.c_str(), W_OK) != 0) fail(path, errno);
  return target;
}

void write_directly(const Target& target, const Bytes& data) {
  Descriptor file(::open(target.path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | O_NOCTTY));
  if (file.number() < 0) fail(target.path, errno);
  if (const int error = write_all(file.number(), data)) fail(target.path, error);
  if (const int error = flush(file.number())) fail(target.path, error);
  if (const int error = file.close()) fail(target.path, error);
}

/// A file beside its target, flushed and closed, that goes away unless it is renamed.
class TemporaryFile {
 public:
  TemporaryFile(const Target& target, const Bytes& data) : target_(target), name_(take_name()) {
    try {
      // A new file gets its mode from the umask; one that replaces an old file is private until it has the old mode.
      Descriptor file(create(target.old ? 0600 : 0666));
      if (const int error = write_all(file.number(), data)) fail(target.path, error);
      if (target.old) {
        mode_t mode = target.old->st_mode & 07777;
        if (::fchown(file.number(), target.old->st_uid, target.old->st_gid) != 0) mode &= 0777;
        if (::fchmod(file.number(), mode) != 0) fail(target.path, errno);
      }
      if (const int error = flush(file.number())) fail(target.path, error);
      if (const int error = file.close()) fail(target.path, error);
    } catch (...) {
      remove();
      throw;
    }
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() { remove(); }

  void rename() {
    // Opened first, so that what can fail fails before the old file is gone. If the folder cannot be flushed, a crash
    // may bring the old file back, whole: that is no reason to say that nothing was written.
    const Descriptor folder(::open(folder_of(target_.file).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (::rename(name_.path, target_.file.c_str()) != 0) fail(target_.path, errno);
    name_.is_live = false;
    if (folder.number() >= 0) flush(folder.number());
  }

 private:
  int create(mode_t mode) {
    const std::string folder = folder_of(target_.file);
    constexpr int attempts = 100;
    for (int i = 0; i < attempts; ++i) {
      std::uint64_t number = 0;
      if (::getrandom(&number, sizeof number, 0) != sizeof number) fail(target_.path, errno);
      const std::string path = text(folder, "/.glyphwave-", std::hex, number, ".tmp");
      if (path.size() >= sizeof name_.path) fail(target_.path, ENAMETOOLONG);
      std::memcpy(name_.path, path.c_str(), path.size() + 1);
      name_.is_live = true;  // before it exists, so that a signal in between cannot leave it behind
      const int file = ::open(name_.path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOCTTY, mode);
      if (file >= 0) return file;
      name_.is_live = false;
      if (errno != EEXIST && errno != EINTR) fail(target_.path, errno);
    }
    fail(target_.path, EEXIST);
  }

  void remove() {
    if (name_.is_live) ::unlink(name_.path);
    name_.is_live = false;
    name_.is_taken = false;
  }

  const Target& target_;
  TemporaryName& name_;
};

/// Refuses two outputs that are one file.
void require_distinct(const std::vector<Target>& targets) {
  std::set<std::string> seen;
  for (const Target& target : targets) {
    if (target.is_direct) continue;
    const std::string folder = folder_of(target.file);
    const std::unique_ptr<char, decltype(&std::free)> real(::realpath(folder.c_str(), nullptr), &std::free);
    if (!real) fail(target.path, errno);
    const std::size_t slash = target.file.rfind('/');
    const std::string name = slash == std::string::npos ? target.file : target.file.substr(slash + 1);
    if (!seen.insert(text(real.get(), "/", name)).second) fail(target.path, "it is written twice");
  }
}

}  // namespace

void write_files(const std::vector<PendingFile>& files) {
  std::vector<Target> targets;
  targets.reserve(files.size());
  for (const PendingFile& file : files) targets.push_back(find_target(file.path));
  require_distinct(targets);
  const SignalGuard guard;
  std::vector<std::unique_ptr<TemporaryFile>> prepared;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (!targets[i].is_direct) prepared.push_back(std::make_unique<TemporaryFile>(targets[i], files[i].data));
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (targets[i].is_direct) write_directly(targets[i], files[i].data);
  }
  for (const auto& file : prepared) file->rename();
}

void write_file(const std::string& path, const Bytes& data) { write_files({{path, data}}); }

void write_file(const std::string& path, const std::string& text) { write_file(path, Bytes(text.begin(), text.end())); }

void secure_standard_descriptors() {
  for (int number = 0; number <= 2; ++number) {
    // The lowest free number is the one that is closed.
    if (::fcntl(number, F_GETFD) == -1 && errno == EBADF && ::open("/dev/null", O_RDWR) != number) return;
  }
}

}  // namespace glyphs
