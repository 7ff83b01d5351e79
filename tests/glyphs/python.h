#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/catch.h"
#include "tests/folder.h"

/// Debian's Python, which has fontTools and shapely where they are installed; other ones may hide them.
inline const std::string python = "/usr/bin/python3";

inline bool has_modules(const std::string& modules) {
  return std::system((python + " -c 'import " + modules + "' > /dev/null 2>&1").c_str()) == 0;
}

/// What a script prints.
inline std::string run_python(const std::string& script, const std::vector<std::string>& arguments) {
  const TestFolder folder;
  std::ofstream(folder / "script.py") << script;
  std::string command = python + " " + (folder / "script.py");
  for (const std::string& argument : arguments) command += " '" + argument + "'";
  REQUIRE(std::system((command + " > " + (folder / "out") + " 2> " + (folder / "err")).c_str()) == 0);
  std::ostringstream out;
  out << std::ifstream(folder / "out").rdbuf();
  return out.str();
}
