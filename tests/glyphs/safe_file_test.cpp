#include "glyphs/safe_file.h"

#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <thread>

#include "glyphs/error.h"
#include "tests/catch.h"
#include "tests/folder.h"

namespace {

namespace fs = std::filesystem;
using glyphs::Bytes;
using glyphs::FontWriteError;
using glyphs::write_file;
using glyphs::write_files;

using Folder = TestFolder;

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

unsigned mode(const std::string& path) {
  struct stat status {};
  REQUIRE(::stat(path.c_str(), &status) == 0);
  return status.st_mode & 07777u;
}

/// How a child that does the work ended: its exit status, or 1000 and the signal.
template <typename Work>
int run_child(Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    try {
      work();
    } catch (const FontWriteError&) {
      ::_exit(2);
    }
    ::_exit(0);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

TEST_CASE("a file is written whole, and nothing is left beside it", "[safe_file]") {
  const Folder folder;
  const std::string path = folder / "a";
  write_file(path, std::string("first"));
  CHECK(content(path) == "first");
  const Bytes large(3'000'000, 7);
  write_file(path, large);
  CHECK(content(path) == std::string(large.begin(), large.end()));
  write_file(path, std::string());
  CHECK(content(path).empty());
  CHECK(folder.count() == 1);
}

TEST_CASE("an old file keeps its mode, a new one gets it from the umask", "[safe_file]") {
  const Folder folder;
  write_file(folder / "old", std::string("1"));
  for (const unsigned wanted : {0600u, 0644u, 0640u, 0755u}) {
    REQUIRE(::chmod((folder / "old").c_str(), wanted) == 0);
    write_file(folder / "old", std::string("2"));
    CHECK(mode(folder / "old") == wanted);
  }
  const mode_t before = ::umask(027);
  write_file(folder / "new", std::string("1"));
  ::umask(before);
  CHECK(mode(folder / "new") == 0640u);
}

TEST_CASE("a link is followed to the file it names, which may not exist yet", "[safe_file]") {
  const Folder folder;
  write_file(folder / "target", std::string("old"));
  fs::create_symlink("target", folder / "link");
  fs::create_symlink(folder / "link", folder / "link to link");
  write_file(folder / "link to link", std::string("new"));
  CHECK(content(folder / "target") == "new");
  CHECK(fs::is_symlink(folder / "link"));
  CHECK(fs::is_symlink(folder / "link to link"));
  fs::create_symlink("later", folder / "dangling");
  write_file(folder / "dangling", std::string("here"));
  CHECK(content(folder / "later") == "here");
  fs::create_symlink("loop", folder / "loop");
  CHECK(message_of<FontWriteError>([&] {
          write_file(folder / "loop", std::string("x"));
        }).starts_with(folder / "loop: cannot be written: "));
}

TEST_CASE("a file that cannot be written is named with the reason, and the old one is as it was", "[safe_file]") {
  const Folder folder;
  write_file(folder / "file", std::string("old"));
  CHECK(message_of<FontWriteError>([&] { write_file(folder / "file/below", std::string("x")); }) ==
        folder / "file/below: cannot be written: Not a directory");
  CHECK(message_of<FontWriteError>([&] { write_file(folder / "none/below", std::string("x")); }) ==
        folder / "none/below: cannot be written: No such file or directory");
  CHECK(message_of<FontWriteError>([&] { write_file(folder / ".", std::string("x")); }) ==
        folder / ".: cannot be written: Is a directory");
  CHECK(message_of<FontWriteError>([] { write_file("/dev/full", std::string("x")); }) ==
        "/dev/full: cannot be written: No space left on device");
  CHECK(message_of<FontWriteError>([] { write_file("", std::string("x")); }) ==
        "output: cannot be written: the path is empty");
  CHECK(message_of<FontWriteError>([&] {
          write_file(folder / std::string(300, 'n'), std::string("x"));
        }).ends_with("File name too long"));
  CHECK(content(folder / "file") == "old");
  CHECK(folder.count() == 1);
  write_file("/dev/null", std::string("x"));
}

TEST_CASE("of several files none is replaced unless all can be", "[safe_file]") {
  const Folder folder;
  write_file(folder / "a", std::string("old a"));
  write_file(folder / "b", std::string("old b"));
  const Bytes fresh{'n', 'e', 'w'};
  const auto refused = [&](const std::string& second) {
    const std::string error = message_of<FontWriteError>([&] {
      write_files({{folder / "a", fresh}, {second, fresh}});
    });
    CHECK(content(folder / "a") == "old a");
    CHECK(folder.count() == 2);
    return error;
  };
  CHECK(refused(folder / "none/b").ends_with("No such file or directory"));
  CHECK(refused("/dev/full").ends_with("No space left on device"));
  CHECK(refused(folder / "./a") == folder / "./a: cannot be written: it is written twice");
  write_files({{folder / "a", fresh}, {folder / "b", fresh}, {folder / "c", fresh}});
  for (const std::string name : {"a", "b", "c"}) CHECK(content(folder / name) == "new");
  CHECK(folder.count() == 3);
  write_files({});
}

TEST_CASE("a pipe is written directly", "[safe_file]") {
  const Folder folder;
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  std::string received;
  std::thread reader([&] { received = content(folder / "pipe"); });
  write_file(folder / "pipe", std::string(200'000, 'p'));
  reader.join();
  CHECK(received == std::string(200'000, 'p'));
}

TEST_CASE("a limit on the size of files leaves the old file and nothing beside it", "[safe_file]") {
  const Folder folder;
  write_file(folder / "file", std::string("old"));
  const auto limited = [&](void (*handler)(int)) {
    return run_child([&] {
      std::signal(SIGXFSZ, handler);
      const rlimit limit{100'000, 100'000};
      ::setrlimit(RLIMIT_FSIZE, &limit);
      write_file(folder / "file", Bytes(1'000'000, 1));
    });
  };
  CHECK(limited(SIG_IGN) == 2);
  CHECK(limited(SIG_DFL) == 1000 + SIGXFSZ);
  CHECK(content(folder / "file") == "old");
  CHECK(folder.count() == 1);
}

TEST_CASE("a signal that ends the program takes its temporary files along", "[safe_file]") {
  const Folder folder;
  write_file(folder / "file", std::string("old"));
  // The second file is a pipe that nobody reads: the first is prepared and waits.
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) {
    const pid_t child = ::fork();
    if (child == 0) {
      const rlimit no_core{0, 0};
      ::setrlimit(RLIMIT_CORE, &no_core);
      std::signal(signal, SIG_DFL);
      write_files({{folder / "file", {1, 2, 3}}, {folder / "pipe", {1}}});
      ::_exit(0);
    }
    for (int i = 0; i < 2000 && folder.count() < 3; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    CHECK(folder.count() == 3);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    ::kill(child, signal);
    int status = 0;
    ::waitpid(child, &status, 0);
    CHECK(WIFSIGNALED(status));
    CHECK(WTERMSIG(status) == signal);
    CHECK(content(folder / "file") == "old");
    CHECK(folder.count() == 2);
  }
}

TEST_CASE("signal handling is as it was after a file is written", "[safe_file]") {
  const Folder folder;
  std::signal(SIGHUP, SIG_IGN);
  write_file(folder / "file", std::string("x"));
  CHECK(std::signal(SIGHUP, SIG_DFL) == SIG_IGN);
  write_file(folder / "file", std::string("x"));
  CHECK(std::signal(SIGHUP, SIG_DFL) == SIG_DFL);
}

TEST_CASE("many writers at once leave one whole file", "[safe_file]") {
  const Folder folder;
  std::vector<std::thread> writers;
  for (char c = 'a'; c < 'i'; ++c) {
    writers.emplace_back([&folder, c] {
      for (int i = 0; i < 5; ++i) write_file(folder / "file", std::string(100'000, c));
    });
  }
  for (std::thread& writer : writers) writer.join();
  const std::string written = content(folder / "file");
  CHECK(written == std::string(100'000, written.at(0)));
  CHECK(folder.count() == 1);
}

namespace {

const glyphs::Folder small_ufo{{"metainfo.plist", {'m'}}, {"glyphs/a.glif", {'a'}}, {"data/empty/", {}}};

std::set<std::string> tree(const std::string& path) {
  std::set<std::string> found;
  for (const auto& entry : fs::recursive_directory_iterator(path)) {
    found.insert(fs::relative(entry.path(), path).string() +
                 (entry.is_directory() ? "/" : "=" + content(entry.path())));
  }
  return found;
}

}  // namespace

TEST_CASE("a folder is written whole, in place of an old one or of a file, and nothing is left beside it",
          "[safe_file]") {
  const Folder folder;
  const std::string path = folder / "a.ufo";
  const std::set<std::string> wanted{"metainfo.plist=m", "glyphs/", "glyphs/a.glif=a", "data/", "data/empty/"};
  write_files({{path, {}, small_ufo}});
  CHECK(tree(path) == wanted);
  write_files({{path + "//", {}, glyphs::Folder{{"metainfo.plist", {'n'}}}}});
  CHECK(tree(path) == std::set<std::string>{"metainfo.plist=n"});
  fs::remove_all(path);
  write_file(path, std::string("a file"));
  write_files({{path, {}, small_ufo}});
  CHECK(tree(path) == wanted);
  CHECK(folder.count() == 1);
}

TEST_CASE("a folder keeps its mode and those of the files that are written again", "[safe_file]") {
  const Folder folder;
  const std::string path = folder / "a.ufo";
  write_files({{path, {}, small_ufo}});
  for (const auto& [inside, wanted] :
       std::map<std::string, unsigned>{{"", 0750}, {"/glyphs", 0710}, {"/glyphs/a.glif", 0640}}) {
    REQUIRE(::chmod((path + inside).c_str(), wanted) == 0);
  }
  write_files({{path, {}, small_ufo}});
  CHECK(mode(path) == 0750u);
  CHECK(mode(path + "/glyphs") == 0710u);
  CHECK(mode(path + "/glyphs/a.glif") == 0640u);
}

TEST_CASE("a link to a folder is followed, and links within the old one are not", "[safe_file]") {
  const Folder folder;
  write_files({{folder / "a.ufo", {}, small_ufo}});
  fs::create_directory(folder / "other");
  write_file(folder / "other/precious", std::string("x"));
  fs::create_directory_symlink("../other", folder / "a.ufo/link");
  fs::create_directory_symlink("a.ufo", folder / "b.ufo");
  write_files({{folder / "b.ufo", {}, small_ufo}});
  CHECK(fs::is_symlink(folder / "b.ufo"));
  CHECK_FALSE(fs::exists(folder / "a.ufo/link"));
  CHECK(content(folder / "a.ufo/glyphs/a.glif") == "a");
  CHECK(content(folder / "other/precious") == "x");
  CHECK(folder.count() == 3);
}

TEST_CASE("a folder that is no UFO is not replaced, nor anything when another output fails", "[safe_file]") {
  const Folder folder;
  fs::create_directory(folder / "home");
  write_file(folder / "home/precious", std::string("x"));
  const auto refused = [&](const std::string& path) {
    return message_of<FontWriteError>([&] { write_files({{path, {}, small_ufo}}); });
  };
  CHECK(refused(folder / "home").find("no metainfo.plist") != std::string::npos);
  CHECK(refused(folder / "home/..").find("no metainfo.plist") != std::string::npos);
  CHECK(refused("/").find("no metainfo.plist") != std::string::npos);
  CHECK(refused("/dev/null") == "/dev/null: cannot be written: Not a directory");
  CHECK(refused(folder / "none/a.ufo") == folder / "none/a.ufo: cannot be written: No such file or directory");
  CHECK(refused("") == "output: cannot be written: the path is empty");
  write_files({{folder / "a.ufo", {}, small_ufo}});
  const glyphs::Folder other{{"metainfo.plist", {'n'}}};
  const auto both = [&](const std::string& second) {
    return message_of<FontWriteError>([&] { write_files({{folder / "a.ufo", {}, other}, {second, {1}}}); });
  };
  CHECK_FALSE(both(folder / "none/report").empty());
  CHECK_FALSE(both("/dev/full").empty());
  CHECK(both(folder / "a.ufo/report").find("it lies in") != std::string::npos);
  CHECK(content(folder / "a.ufo/metainfo.plist") == "m");
  CHECK(content(folder / "home/precious") == "x");
  CHECK(folder.count() == 2);
  for (const std::string bad : {"../x", "/x", "a//b", "a/../../x", "", "."}) {
    CHECK(message_of<FontWriteError>([&] {
            write_files({{folder / "b.ufo", {}, glyphs::Folder{{bad, {1}}}}});
          }).find("is no path within it") != std::string::npos);
  }
  CHECK(folder.count() == 2);
  CHECK_FALSE(fs::exists(folder / "x"));
}

TEST_CASE("a signal that ends the program takes its staged folder along", "[safe_file]") {
  const Folder folder;
  write_files({{folder / "a.ufo", {}, small_ufo}});
  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGTERM, SIG_DFL);
    glyphs::Folder large = small_ufo;
    for (int i = 0; i < 200; ++i) large["glyphs/" + std::string(40, 'g') + std::to_string(i)] = {1};
    write_files({{folder / "a.ufo", {}, large}, {folder / "pipe", {1}}});
    ::_exit(0);
  }
  for (int i = 0; i < 2000 && folder.count() < 3; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  CHECK(folder.count() == 3);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  ::kill(child, SIGTERM);
  int status = 0;
  ::waitpid(child, &status, 0);
  CHECK(WIFSIGNALED(status));
  CHECK(content(folder / "a.ufo/glyphs/a.glif") == "a");
  CHECK(folder.count() == 2);
}

TEST_CASE("many writers of one folder leave a whole one", "[safe_file]") {
  const Folder folder;
  std::vector<std::thread> writers;
  for (char c = 'a'; c < 'g'; ++c) {
    writers.emplace_back([&folder, c] {
      const Bytes data(1000, static_cast<unsigned char>(c));
      for (int i = 0; i < 5; ++i) {
        write_files({{folder / "a.ufo", {}, glyphs::Folder{{"metainfo.plist", data}, {"glyphs/b", data}}}});
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  const std::string written = content(folder / "a.ufo/metainfo.plist");
  CHECK(written == std::string(1000, written.at(0)));
  CHECK(content(folder / "a.ufo/glyphs/b") == written);
  CHECK(folder.count() == 1);
}

namespace {

/// The system calls of this process fail from now on with that error.
void forbid(const std::vector<long>& calls, int error) {
  ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  for (const long call : calls) {
    const auto number = static_cast<unsigned>(call);
    const auto verdict = SECCOMP_RET_ERRNO | static_cast<unsigned>(error);
    std::array<sock_filter, 4> filter{{BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
                                       BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, number, 0, 1),
                                       BPF_STMT(BPF_RET | BPF_K, verdict),
                                       BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)}};
    const sock_fprog program{filter.size(), filter.data()};
    if (::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) ::_exit(9);
  }
}

/// What a file system may lack: nothing, an exchange of two names, links too.
const std::vector<std::vector<long>> lacking{{},
                                             {SYS_renameat2},
                                             {SYS_renameat2, SYS_linkat
#ifdef SYS_link
                                              ,
                                              SYS_link
#endif
                                             }};

}  // namespace

TEST_CASE("outputs are staged one by one and then put in place together", "[safe_file]") {
  for (const auto& calls : lacking) {
    const Folder folder;
    write_file(folder / "a", std::string("old a"));
    write_files({{folder / "u.ufo", {}, small_ufo}});
    CHECK(run_child([&] {
            forbid(calls, EINVAL);
            glyphs::OutputBatch batch({{folder / "a"}, {folder / "b"}, {folder / "u.ufo", true}, {folder / "c"}});
            batch.stage(0, Bytes{'n', 'e', 'w'});
            batch.stage(1, Bytes{'n', 'e', 'w'});
            batch.stage(2, glyphs::Folder{{"metainfo.plist", {'n'}}});
            batch.stage(3, Bytes{'n', 'e', 'w'});
            if (content(folder / "a") != "old a" || fs::exists(folder / "b")) ::_exit(3);
            batch.put_in_place();
          }) == 0);
    for (const char* name : {"a", "b", "c"}) CHECK(content(folder / name) == "new");
    CHECK(tree(folder / "u.ufo") == std::set<std::string>{"metainfo.plist=n"});
    CHECK(folder.count() == 4);
  }
}

TEST_CASE("if one output cannot be put in place, those before it are as they were", "[safe_file]") {
  for (const auto& calls : lacking) {
    for (const std::size_t failing : {0u, 1u, 2u, 3u, 4u}) {
      CAPTURE(calls.size(), failing);
      const Folder folder;
      const std::vector<glyphs::Output> outputs{
          {folder / "a"}, {folder / "b"}, {folder / "u.ufo", true}, {folder / "v.ufo", true}, {folder / "c"}};
      write_file(folder / "a", std::string("old a"));
      write_files({{folder / "u.ufo", {}, small_ufo}});
      const std::set<std::string> old_ufo = tree(folder / "u.ufo");
      // While the work goes on, another program puts a folder of its own in the place.
      const std::string obstacle = outputs[failing].path;
      CHECK(run_child([&] {
              forbid(calls, EINVAL);
              glyphs::OutputBatch batch(outputs);
              for (std::size_t k = 0; k < outputs.size(); ++k) {
                if (outputs[k].is_folder) {
                  batch.stage(k, glyphs::Folder{{"metainfo.plist", {'n'}}});
                } else {
                  batch.stage(k, Bytes{'n', 'e', 'w'});
                }
              }
              fs::remove_all(obstacle);
              fs::create_directory(obstacle);
              std::ofstream(obstacle + "/theirs") << "x";
              batch.put_in_place();
            }) == 2);
      CHECK(content(obstacle + "/theirs") == "x");
      if (failing != 0) CHECK(content(folder / "a") == "old a");
      if (failing != 2) CHECK(tree(folder / "u.ufo") == old_ufo);
      for (const char* absent : {"b", "v.ufo", "c"})
        CHECK((folder / absent == obstacle) == fs::exists(folder / absent));
      CHECK(folder.count() == (failing == 0 || failing == 2 ? 2 : 3));
    }
  }
}

namespace {

/// Does the work in a child that gets a signal as it is about to exchange two names for the nth time; how it ended.
template <typename Work>
int interrupt_at(int nth, int signal, Work work) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGTERM, SIG_DFL);
    if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) ::_exit(7);
    std::raise(SIGSTOP);
    work();
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  REQUIRE(WIFSTOPPED(status));
  REQUIRE(::ptrace(PTRACE_SETOPTIONS, child, nullptr, PTRACE_O_TRACESYSGOOD | PTRACE_O_EXITKILL) == 0);
  long delivered = 0;
  for (int seen = 0; WIFSTOPPED(status); delivered = 0) {
    __ptrace_syscall_info call{};
    if (WSTOPSIG(status) == (SIGTRAP | 0x80)) {
      ::ptrace(PTRACE_GET_SYSCALL_INFO, child, sizeof call, &call);
      const bool is_exchange = call.op == PTRACE_SYSCALL_INFO_ENTRY && call.entry.nr == SYS_renameat2;
      if (is_exchange && seen++ == nth) ::kill(child, signal);
    } else if (WSTOPSIG(status) != SIGSTOP) {
      delivered = WSTOPSIG(status);
    }
    ::ptrace(PTRACE_SYSCALL, child, nullptr, delivered);
    ::waitpid(child, &status, 0);
  }
  return WIFSIGNALED(status) ? 1000 + WTERMSIG(status) : WEXITSTATUS(status);
}

}  // namespace

TEST_CASE("between two renames a signal waits, and a kill leaves each output whole, old or new", "[safe_file]") {
  for (const int signal : {SIGTERM, SIGKILL}) {
    for (int nth = 0; nth < 4; ++nth) {
      CAPTURE(signal, nth);
      const Folder folder;
      const std::vector<glyphs::Output> outputs{
          {folder / "a"}, {folder / "b"}, {folder / "u.ufo", true}, {folder / "c"}, {folder / "d"}};
      for (const char* name : {"a", "b", "c", "d"}) write_file(folder / name, std::string("old"));
      write_files({{folder / "u.ufo", {}, small_ufo}});
      const std::set<std::string> old_ufo = tree(folder / "u.ufo");
      CHECK(interrupt_at(nth, signal, [&] {
              glyphs::OutputBatch batch(outputs);
              for (const std::size_t k : {0u, 1u, 3u, 4u}) batch.stage(k, Bytes{'n', 'e', 'w'});
              batch.stage(2, glyphs::Folder{{"metainfo.plist", {'n'}}});
              batch.put_in_place();
            }) == 1000 + signal);
      int fresh = 0;
      for (const char* name : {"a", "b", "c", "d"}) {
        const std::string found = content(folder / name);
        CHECK((found == "old" || found == "new"));
        fresh += found == "new" ? 1 : 0;
      }
      const bool has_new_ufo = tree(folder / "u.ufo") != old_ufo;
      if (has_new_ufo) CHECK(tree(folder / "u.ufo") == std::set<std::string>{"metainfo.plist=n"});
      if (signal == SIGTERM) {
        CHECK(fresh == 4);
        CHECK(has_new_ufo);
        CHECK(folder.count() == 5);
      } else {
        CHECK(fresh == nth);
      }
    }
  }
}

TEST_CASE("a folder for outputs is made with those above it, and goes again if nothing came", "[safe_file]") {
  const Folder folder;
  {
    const glyphs::OutputFolder made(folder / "x/y//z/");
    CHECK(fs::is_directory(folder / "x/y/z"));
  }
  CHECK(folder.count() == 0);
  {
    const glyphs::OutputFolder made(folder / "x/y");
    write_file(folder / "x/y/a", std::string("a"));
  }
  CHECK(content(folder / "x/y/a") == "a");
  { const glyphs::OutputFolder there(folder / "x"); }
  { const glyphs::OutputFolder there(folder / "x/y"); }
  CHECK(content(folder / "x/y/a") == "a");
  const auto refused = [](const std::string& path) {
    return message_of<FontWriteError>([&] { const glyphs::OutputFolder made(path); });
  };
  CHECK(refused(folder / "x/y/a") == folder / "x/y/a: cannot be written: Not a directory");
  CHECK(refused(folder / "n/x/../../x/y/a/b").ends_with("Not a directory"));
  CHECK(refused("") == "output: cannot be written: the path is empty");
  CHECK(folder.count() == 1);

  REQUIRE(::mkfifo((folder / "pipe").c_str(), 0600) == 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGTERM, SIG_DFL);
    const glyphs::OutputFolder made(folder / "p/q");
    write_files({{folder / "p/q/file", {1}}, {folder / "pipe", {1}}});  // nobody reads the pipe
    ::_exit(0);
  }
  for (int i = 0; i < 2000 && !(fs::exists(folder / "p/q") && !fs::is_empty(folder / "p/q")); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ::kill(child, SIGTERM);
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFSIGNALED(status));
  CHECK_FALSE(fs::exists(folder / "p"));
}

TEST_CASE("closed standard descriptors are opened on nothing", "[safe_file]") {
  const int status = run_child([] {
    for (const int number : {0, 1, 2}) ::close(number);
    glyphs::secure_standard_descriptors();
    for (const int number : {0, 1, 2}) {
      if (::fcntl(number, F_GETFD) == -1) ::_exit(3);
    }
    if (::open("/dev/null", O_RDONLY) < 3) ::_exit(4);
  });
  CHECK(status == 0);
}
