#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "glyphs/font.h"

/// Whether the OpenType Sanitizer takes the font.
inline bool is_accepted_by_sanitizer(const glyphs::Bytes& bytes) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("glyphwave-" + std::to_string(getpid()) + ".font")).string();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  const int status = std::system(("ots-sanitize " + path + " > /dev/null 2>&1").c_str());
  std::filesystem::remove(path);
  return status == 0;
}
