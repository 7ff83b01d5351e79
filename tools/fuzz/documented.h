#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

#include "glyphs/error.h"

/// What a library that keeps its word never does: the fuzzer takes the abort for a finding and keeps the input.
[[noreturn]] inline void broken(const std::string& promise) {
  std::fprintf(stderr, "broken promise: %s\n", promise.c_str());
  std::abort();
}

/// Runs the work. The documented exceptions are its answers: one line, beginning with the name of what was read where
/// there is one. All others leave, and are findings.
template <typename Work>
int documented(const std::string& name, const Work& work) {
  const auto require_line = [&](const std::string& message, bool has_name) {
    if (message.find('\n') != std::string::npos) broken("one line: " + message);
    if (has_name && !message.starts_with(name)) broken("the name first: " + message);
  };
  try {
    work();
  } catch (const glyphs::FontReadError& error) {
    require_line(error.what(), true);
  } catch (const glyphs::FontWriteError& error) {
    require_line(error.what(), true);
  } catch (const glyphs::RequestError& error) {
    require_line(error.what(), true);
  } catch (const fontcore::Error& error) {
    require_line(error.what(), false);
  }
  return 0;
}
