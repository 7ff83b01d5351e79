#include "glyphs/safe_file.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
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

// ---- removal

/// Removes a file or a folder with all that is in it, following no links; true if it is gone. Async-signal-safe:
/// nothing is allocated, and only system calls are made.
bool remove_tree(int parent, const char* name, int depth = 0) noexcept {
  if (::unlinkat(parent, name, 0) == 0) return true;
  constexpr int deepest = 64;
  const bool is_folder = errno == EISDIR || errno == EPERM;
  const int folder =
      is_folder && depth < deepest ? ::openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC) : -1;
  if (folder < 0) return false;
  // Removing entries may move those not yet listed, so the list is begun again until nothing more goes.
  for (bool has_removed = true; has_removed && ::lseek(folder, 0, SEEK_SET) == 0;) {
    has_removed = false;
    std::array<char, 2048> buffer;
    for (long got = 0; (got = ::syscall(SYS_getdents64, folder, buffer.data(), buffer.size())) > 0;) {
      unsigned short length = 0;
      for (long at = 0; at < got; at += length) {
        // struct linux_dirent64: inode and offset of 8 bytes each, a length of 2, a type of 1, the name
        const char* entry = buffer.data() + at;
        std::memcpy(&length, entry + 16, sizeof length);
        const char* entry_name = entry + 19;
        if (std::strcmp(entry_name, ".") == 0 || std::strcmp(entry_name, "..") == 0) continue;
        has_removed = remove_tree(folder, entry_name, depth + 1) || has_removed;
      }
    }
  }
  ::close(folder);
  return ::unlinkat(parent, name, AT_REMOVEDIR) == 0;
}

// ---- signals

/// A temporary file's name where a signal handler can find it. Names stay allocated and are used again, so the list
/// only grows to as many as were ever open at once.
struct TemporaryName {
  std::atomic<bool> is_taken{false};
  std::atomic<bool> is_live{false};
  std::atomic<bool> is_shared{false};  ///< a folder that others may use: it goes only if it is empty
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

/// How many threads are putting files in place; a signal that comes meanwhile waits in `late_signal`.
std::atomic<int> commits{0};
std::atomic<int> late_signal{0};
static_assert(std::atomic<int>::is_always_lock_free);

/// Removes the temporary files and lets the signal do what it would have done. Async-signal-safe.
extern "C" void glyphwave_remove_temporaries(int signal) {
  if (commits.load() > 0) {
    late_signal = signal;
    return;
  }
  const int saved = errno;
  for (TemporaryName* name = temporary_names.load(); name; name = name->next) {
    if (name->is_live.load() && !name->is_shared.load()) remove_tree(AT_FDCWD, name->path);
  }
  for (bool has_removed = true; has_removed;) {  // one shared folder may be in another
    has_removed = false;
    for (TemporaryName* name = temporary_names.load(); name; name = name->next) {
      const bool is_shared = name->is_live.load() && name->is_shared.load();
      if (is_shared && ::rmdir(name->path) == 0) has_removed = true;
    }
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

/// While one lives, signals of a `SignalGuard` wait.
class Commit {
 public:
  Commit() { ++commits; }
  Commit(const Commit&) = delete;
  Commit& operator=(const Commit&) = delete;
  ~Commit() {
    if (--commits > 0) return;
    if (const int signal = late_signal.exchange(0)) std::raise(signal);
  }
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
  bool is_folder = false;  ///< a folder is to be there
  std::optional<struct stat> old;
};

Target find_target(const std::string& path) {
  if (path.empty()) fail("output", "the path is empty");
  Target target{.path = path, .file = path};
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

using CString = std::unique_ptr<char, decltype(&std::free)>;
CString real_path(const std::string& path) { return {::realpath(path.c_str(), nullptr), &std::free}; }

/// Whether something may give way to a folder: a regular file, or a UFO by its metainfo.plist. Links are neither.
bool is_replaceable(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return false;
  if (S_ISREG(status.st_mode)) return true;
  return S_ISDIR(status.st_mode) && ::lstat((path + "/metainfo.plist").c_str(), &status) == 0 &&
         S_ISREG(status.st_mode);
}
constexpr const char* not_a_ufo = "there is a folder that is no UFO (it has no metainfo.plist), which is not replaced";

/// Where a folder is to go; slashes behind its name mean nothing.
Target find_folder_target(const std::string& path) {
  std::string name = path;
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  if (name.empty()) fail("output", "the path is empty");
  Target target{.path = path, .file = name, .is_folder = true};
  struct stat status {};
  if (::stat(name.c_str(), &status) != 0) {
    if (errno != ENOENT) fail(path, errno);
    target.file = follow_links(name);
    return target;
  }
  target.old = status;
  const CString real = real_path(name);
  if (!real) fail(path, errno);
  target.file = real.get();
  const bool is_device = target.file.starts_with("/dev/") || target.file.starts_with("/proc/");
  if (is_device || (!S_ISDIR(status.st_mode) && !S_ISREG(status.st_mode))) fail(path, ENOTDIR);
  if (!is_replaceable(target.file)) fail(path, not_a_ufo);
  if (::access(name.c_str(), W_OK) != 0) fail(path, errno);
  return target;
}

void write_directly(const Target& target, const Bytes& data) {
  Descriptor file(::open(target.path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | O_NOCTTY));
  if (file.number() < 0) fail(target.path, errno);
  if (const int error = write_all(file.number(), data)) fail(target.path, error);
  if (const int error = flush(file.number())) fail(target.path, error);
  if (const int error = file.close()) fail(target.path, error);
}

/// Gives a new file the owner, where that is allowed, and the mode of an old one. 0, or the error.
int adopt(int file, const struct stat& old) {
  mode_t mode = old.st_mode & 07777;
  if (::fchown(file, old.st_uid, old.st_gid) != 0) mode &= 0777;
  return ::fchmod(file, mode) != 0 ? errno : 0;
}

/// A file or a folder beside its target, flushed and closed, that goes away unless it is put in place.
class Staged {
 public:
  template <typename Content>
  Staged(const Target& target, const Content& content) : target_(target), name_(&take_name()) {
    try {
      stage(content);
    } catch (...) {
      remove();
      throw;
    }
  }
  Staged(const Staged&) = delete;
  Staged& operator=(const Staged&) = delete;
  ~Staged() { remove(); }

  /// Whether what was there can be put back.
  enum class WayBack { Open, Closed };
  void put_in_place(WayBack way_back) {
    if (target_.is_folder || way_back == WayBack::Open) {
      exchange();
    } else if (::rename(name_->path, place()) != 0) {
      fail(target_.path, errno);
    } else {
      holds_ = Holds::Nothing;
      name_->is_live = false;
    }
  }

  /// Empty, or what could not be put back and where it is.
  std::string put_back() {
    int result = 0;
    if (holds_ == Holds::Old) {
      result = ::renameat2(AT_FDCWD, name_->path, AT_FDCWD, place(), RENAME_EXCHANGE);
      if (result != 0 && cannot_exchange(errno)) {
        if (target_.is_folder) remove_tree(AT_FDCWD, place());  // ours; a folder takes the place of an empty one only
        result = rename_back();
      }
    } else if (holds_ == Holds::Nothing) {
      result = ::rename(place(), name_->path);
      name_->is_live = result == 0;
    }
    if (result == 0) {
      holds_ = Holds::New;
      return "";
    }
    const std::string why = std::generic_category().message(errno);
    if (holds_ == Holds::Nothing) return text(target_.path, " could not be taken out again: ", why);
    name_->is_live = false;  // the only copy
    return text(target_.path, " could not be put back: ", why, ", what it was is in ", name_->path);
  }

  /// If the folder cannot be flushed, a crash may bring the old file back, whole: that is no reason to say that nothing
  /// was written.
  void settle() const {
    const Descriptor folder(::open(folder_of(target_.file).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.number() >= 0) flush(folder.number());
  }

 private:
  /// Finds a name that `make` can make something of; it returns 0 or more, or -1 and the error in errno.
  template <typename Make>
  int create(TemporaryName& name, Make make) const {
    const std::string folder = folder_of(target_.file);
    constexpr int attempts = 100;
    for (int i = 0; i < attempts; ++i) {
      std::uint64_t number = 0;
      if (::getrandom(&number, sizeof number, 0) != sizeof number) fail(target_.path, errno);
      const std::string path = text(folder, "/.glyphwave-", std::hex, number, ".tmp");
      if (path.size() >= sizeof name.path) fail(target_.path, ENAMETOOLONG);
      std::memcpy(name.path, path.c_str(), path.size() + 1);
      name.is_live = true;  // before it exists, so that a signal in between cannot leave it behind
      const int made = make(name.path);
      if (made >= 0) return made;
      name.is_live = false;
      if (errno != EEXIST && errno != EINTR) fail(target_.path, errno);
    }
    fail(target_.path, EEXIST);
  }

  void stage(const Bytes& data) {
    // A new file gets its mode from the umask; one that replaces an old file is private until it has the old mode.
    const mode_t mode = target_.old ? 0600 : 0666;
    Descriptor file(create(*name_, [&](const char* path) {
      return ::open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOCTTY, mode);
    }));
    if (const int error = write_all(file.number(), data)) fail(target_.path, error);
    if (const int error = target_.old ? adopt(file.number(), *target_.old) : 0) fail(target_.path, error);
    if (const int error = flush(file.number())) fail(target_.path, error);
    if (const int error = file.close()) fail(target_.path, error);
  }

  [[noreturn]] void fail_inside(const std::string& inside, int error) const {
    fail(target_.path, text(inside, ": ", std::generic_category().message(error)));
  }

  void stage(const Folder& files) {
    const bool has_old = target_.old && S_ISDIR(target_.old->st_mode);
    const mode_t mode = has_old ? 0700 : 0777;
    create(*name_, [&](const char* path) { return ::mkdir(path, mode); });
    constexpr int as_folder = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;
    const Descriptor root(::open(name_->path, as_folder));
    if (root.number() < 0) fail(target_.path, errno);
    const Descriptor old(has_old ? ::open(target_.file.c_str(), as_folder) : -1);
    const auto old_status = [&](const std::string& inside) -> std::optional<struct stat> {
      struct stat status {};
      const bool is_there =
          old.number() >= 0 && ::fstatat(old.number(), inside.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0;
      return is_there ? std::optional(status) : std::nullopt;
    };
    std::vector<std::string> folders;  // every one after the one it is in
    std::set<std::string> made;
    for (const auto& [path, data] : files) {
      require_inside(path);
      for (std::size_t slash = path.find('/'); slash != std::string::npos; slash = path.find('/', slash + 1)) {
        const std::string folder = path.substr(0, slash);
        if (!made.insert(folder).second) continue;
        if (::mkdirat(root.number(), folder.c_str(), 0777) != 0) fail_inside(folder, errno);
        folders.push_back(folder);
      }
      if (path.ends_with('/')) continue;
      Descriptor file(
          ::openat(root.number(), path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC | O_NOCTTY, 0666));
      if (file.number() < 0) fail_inside(path, errno);
      if (const int error = write_all(file.number(), data)) fail_inside(path, error);
      if (const auto status = old_status(path); status && S_ISREG(status->st_mode)) {
        if (const int error = adopt(file.number(), *status)) fail_inside(path, error);
      }
      if (const int error = file.close()) fail_inside(path, error);
    }
    for (auto folder = folders.rbegin(); folder != folders.rend(); ++folder) {
      const Descriptor opened(::openat(root.number(), folder->c_str(), as_folder));
      if (opened.number() < 0) fail_inside(*folder, errno);
      if (const auto status = old_status(*folder); status && S_ISDIR(status->st_mode)) {
        if (const int error = adopt(opened.number(), *status)) fail_inside(*folder, error);
      }
    }
    if (const int error = has_old ? adopt(root.number(), *target_.old) : 0) fail(target_.path, error);
    // The file system at once: to flush thousands of small files one by one takes a journal's commit each.
    if (::syncfs(root.number()) != 0) fail(target_.path, errno);
    if (const int error = flush(root.number())) fail(target_.path, error);
  }

  /// Refuses a path that would lead out of the folder.
  void require_inside(const std::string& path) const {
    bool is_inside = !path.empty() && path.find('\0') == std::string::npos;
    for (std::size_t at = 0; is_inside && at < path.size();) {
      const std::size_t end = std::min(path.find('/', at), path.size());
      const std::string part = path.substr(at, end - at);
      is_inside = !part.empty() && part != "." && part != "..";
      at = end + 1;
    }
    if (!is_inside) fail(target_.path, text("\"", path, "\" is no path within it"));
  }

  const char* place() const { return target_.file.c_str(); }
  static bool cannot_exchange(int error) { return error == EINVAL || error == ENOSYS || error == ENOTSUP; }

  /// Whether what is there may give way.
  bool may_give_way(const char* path) const {
    if (target_.is_folder) return is_replaceable(path);
    struct stat status {};
    return ::lstat(path, &status) == 0 && S_ISREG(status.st_mode);
  }
  [[noreturn]] void refuse_place() const {
    fail(target_.path, target_.is_folder ? not_a_ufo : "what is there is no longer a regular file");
  }

  /// Puts what is staged in its place, and what was there in its.
  void exchange() {
    bool is_taken = target_.old.has_value();
    constexpr int attempts = 100;  // others may write there, too
    for (int i = 0; i < attempts; ++i, is_taken = !is_taken) {
      if (is_taken && !may_give_way(place()) && ::access(place(), F_OK) == 0) refuse_place();
      const unsigned how = is_taken ? RENAME_EXCHANGE : RENAME_NOREPLACE;
      if (::renameat2(AT_FDCWD, name_->path, AT_FDCWD, place(), how) == 0) {
        if (!is_taken) {
          holds_ = Holds::Nothing;
          name_->is_live = false;
        } else if (may_give_way(name_->path)) {
          holds_ = Holds::Old;
        } else {
          // Something else was put there meanwhile: back with it.
          ::renameat2(AT_FDCWD, name_->path, AT_FDCWD, place(), RENAME_EXCHANGE);
          refuse_place();
        }
        return;
      }
      if (cannot_exchange(errno)) return rename_aside();
      if (errno != (is_taken ? ENOENT : EEXIST)) fail(target_.path, errno);
    }
    fail(target_.path, EBUSY);
  }

  /// The same where a file system cannot exchange. Without links nothing is in the place for a moment.
  void rename_aside() {
    if (::access(place(), F_OK) == 0 && !may_give_way(place())) refuse_place();
    const auto set_aside = [&](const char* path) {
      if (!target_.is_folder) {
        if (::link(place(), path) == 0) return true;
        if (errno == EEXIST || errno == ENOENT) return false;
      }
      return ::rename(place(), path) == 0;
    };
    TemporaryName* aside = &take_name();
    bool has_old = false;
    try {
      create(*aside, [&](const char* path) {
        has_old = set_aside(path);
        return has_old || errno == ENOENT ? 0 : -1;
      });
    } catch (...) {
      aside->is_taken = false;
      throw;
    }
    std::swap(name_, aside);  // what is staged is under the other name now
    std::string failure;
    if (::rename(aside->path, place()) != 0) {
      failure = std::generic_category().message(errno);
      if (has_old && rename_back() != 0) failure += text(", and what it was is in ", name_->path);
      std::swap(name_, aside);
    } else {
      holds_ = has_old ? Holds::Old : Holds::Nothing;
      name_->is_live = has_old;
    }
    aside->is_live = false;
    aside->is_taken = false;
    if (!failure.empty()) fail(target_.path, failure);
  }

  /// What is under the temporary name back in the place; 0, or -1 and the error in errno.
  int rename_back() const {
    if (::rename(name_->path, place()) != 0) return -1;
    ::unlink(name_->path);  // two links of one file both stay
    return 0;
  }

  void remove() {
    if (name_->is_live) remove_tree(AT_FDCWD, name_->path);
    name_->is_live = false;
    name_->is_taken = false;
  }

  enum class Holds { New, Old, Nothing };

  const Target& target_;
  TemporaryName* name_;
  Holds holds_ = Holds::New;  // what lies under the temporary name
};

/// Refuses two outputs that are one file, and one that lies in a folder that is written.
void require_distinct(const std::vector<Target>& targets) {
  std::map<std::string, const Target*> seen;
  for (const Target& target : targets) {
    if (target.is_direct) continue;
    const CString real = real_path(folder_of(target.file));
    if (!real) fail(target.path, errno);
    const std::size_t slash = target.file.rfind('/');
    const std::string name = slash == std::string::npos ? target.file : target.file.substr(slash + 1);
    if (!seen.emplace(text(real.get(), "/", name), &target).second) fail(target.path, "it is written twice");
  }
  for (const auto& [path, target] : seen) {
    for (const auto& [folder, holder] : seen) {
      if (holder->is_folder && path.starts_with(folder + "/")) {
        fail(target->path, text("it lies in ", holder->path, ", which is written as a whole"));
      }
    }
  }
}

}  // namespace

struct OutputBatch::State {
  std::vector<Target> targets;
  std::optional<SignalGuard> guard;
  std::vector<std::unique_ptr<Staged>> staged;
  std::vector<std::pair<const Target*, Bytes>> direct;
};

OutputBatch::OutputBatch(const std::vector<Output>& outputs) : state_(std::make_unique<State>()) {
  for (const Output& output : outputs) {
    state_->targets.push_back(output.is_folder ? find_folder_target(output.path) : find_target(output.path));
  }
  require_distinct(state_->targets);
  for (const Target& target : state_->targets) {
    // Told now, and not when the work is done.
    const bool is_writable = target.is_direct || ::access(folder_of(target.file).c_str(), W_OK | X_OK) == 0;
    if (!is_writable) fail(target.path, errno);
  }
  state_->guard.emplace();
}

OutputBatch::~OutputBatch() = default;

void OutputBatch::stage(std::size_t output, Bytes data) {
  const Target& target = state_->targets.at(output);
  if (target.is_direct) {
    state_->direct.emplace_back(&target, std::move(data));
  } else {
    state_->staged.push_back(std::make_unique<Staged>(target, data));
  }
}

void OutputBatch::stage(std::size_t output, const Folder& folder) {
  state_->staged.push_back(std::make_unique<Staged>(state_->targets.at(output), folder));
}

void OutputBatch::put_in_place() {
  for (const auto& [target, data] : state_->direct) write_directly(*target, data);
  const Commit commit;
  auto& staged = state_->staged;
  for (std::size_t i = 0; i < staged.size(); ++i) {
    try {
      const bool is_last = i + 1 == staged.size();  // nothing can fail behind it
      staged[i]->put_in_place(is_last ? Staged::WayBack::Closed : Staged::WayBack::Open);
    } catch (const FontWriteError& error) {
      std::string lost;
      while (i-- > 0) {
        if (const std::string why = staged[i]->put_back(); !why.empty()) lost += "; " + why;
      }
      if (lost.empty()) throw;
      throw FontWriteError(error.what() + lost);
    }
  }
  for (const auto& one : staged) one->settle();
  staged.clear();  // with them what was there before
}

void write_files(const std::vector<PendingFile>& files) {
  std::vector<Output> outputs;
  outputs.reserve(files.size());
  for (const PendingFile& file : files) outputs.push_back({file.path, file.folder.has_value()});
  OutputBatch batch(outputs);
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (files[i].folder) {
      batch.stage(i, *files[i].folder);
    } else {
      batch.stage(i, files[i].data);
    }
  }
  batch.put_in_place();
}

struct OutputFolder::State {
  SignalGuard guard;
  std::vector<TemporaryName*> made;

  void make(const std::string& path) {
    if (::access(path.c_str(), F_OK) == 0) return;
    TemporaryName& name = take_name();
    const auto forget = [&] {
      name.is_live = false;
      name.is_shared = false;
      name.is_taken = false;
    };
    if (path.size() >= sizeof name.path) {
      forget();
      fail(path, ENAMETOOLONG);
    }
    std::memcpy(name.path, path.c_str(), path.size() + 1);
    name.is_shared = true;
    name.is_live = true;  // before it exists, so that a signal in between cannot leave it behind
    if (::mkdir(path.c_str(), 0777) == 0) {
      made.push_back(&name);
      return;
    }
    const int error = errno;
    forget();
    if (error != EEXIST) fail(path, error);
  }

  ~State() {
    for (auto name = made.rbegin(); name != made.rend(); ++name) {
      ::rmdir((*name)->path);
      (*name)->is_live = false;
      (*name)->is_shared = false;
      (*name)->is_taken = false;
    }
  }
};

OutputFolder::OutputFolder(const std::string& path) : state_(std::make_unique<State>()) {
  if (path.empty()) fail("output", "the path is empty");
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) {
    if (!S_ISDIR(status.st_mode)) fail(path, ENOTDIR);
    return;
  }
  if (errno != ENOENT) fail(path, errno);
  for (std::size_t at = 1; at != std::string::npos;) {
    at = path.find('/', at);
    state_->make(path.substr(0, at));
    if (at != std::string::npos) at = path.find_first_not_of('/', at);
  }
  if (::stat(path.c_str(), &status) != 0) fail(path, errno);
  if (!S_ISDIR(status.st_mode)) fail(path, ENOTDIR);
}

OutputFolder::~OutputFolder() = default;

void write_file(const std::string& path, const Bytes& data) { write_files({{path, data}}); }

void write_file(const std::string& path, const std::string& text) { write_file(path, Bytes(text.begin(), text.end())); }

void secure_standard_descriptors() {
  for (int number = 0; number <= 2; ++number) {
    // The lowest free number is the one that is closed.
    if (::fcntl(number, F_GETFD) == -1 && errno == EBADF && ::open("/dev/null", O_RDWR) != number) return;
  }
}

}  // namespace glyphs
