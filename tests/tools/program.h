#pragma once

// The program as a user meets it: arguments in; exit status, standard output, standard error and files out.

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/catch.h"
#include "tests/folder.h"

inline std::string contents(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream all;
  all << in.rdbuf();
  return all.str();
}

inline void put(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

struct Run {
  int status = -1;
  std::string out;
  std::string err;
};

/// Runs a program, found in PATH if it is a plain name; standard output may go to a device instead.
inline Run run_program(const std::string& program, std::vector<std::string> arguments,
                       const std::string& standard_output = "") {
  const TestFolder folder;
  const std::string out = standard_output.empty() ? folder / "out" : standard_output;
  const std::string err = folder / "err";
  arguments.insert(arguments.begin(), program);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, out.c_str(), O_WRONLY | O_CREAT, 0600);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, err.c_str(), O_WRONLY | O_CREAT, 0600);
  pid_t child = 0;
  CAPTURE(program);
  REQUIRE(posix_spawnp(&child, program.c_str(), &actions, nullptr, pointers.data(), environ) == 0);
  posix_spawn_file_actions_destroy(&actions);
  int ended = 0;
  REQUIRE(waitpid(child, &ended, 0) == child);
  REQUIRE(WIFEXITED(ended));
  return {WEXITSTATUS(ended), standard_output.empty() ? contents(out) : "", contents(err)};
}

inline Run glyphwave(const std::vector<std::string>& arguments, const std::string& standard_output = "") {
  return run_program(GLYPHWAVE_PROGRAM, arguments, standard_output);
}

/// One line that begins with the program's name and holds every one of these words.
inline void check_refusal(const Run& run, const std::vector<std::string>& words) {
  CAPTURE(run.out, run.err);
  CHECK(run.status == 2);
  CHECK(run.out.empty());
  CHECK(run.err.starts_with("glyphwave: "));
  CHECK(std::count(run.err.begin(), run.err.end(), '\n') == 1);
  CHECK(run.err.ends_with('\n'));
  for (const std::string& word : words) CHECK_THAT(run.err, Catch::Contains(word));
}
