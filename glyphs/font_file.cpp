#include "glyphs/font_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "glyphs/error.h"
#include "glyphs/freetype_loader.h"
#include "glyphs/ufo.h"
#include "glyphs/woff.h"

namespace glyphs {

namespace {

using fontcore::text;

[[noreturn]] void refuse_file(const std::string& path, int error) {
  throw FontReadError(text(path, ": cannot be read: ", std::generic_category().message(error)));
}

struct Descriptor {
  int number = -1;
  explicit Descriptor(int opened) : number(opened) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

}  // namespace

Bytes read_file(const std::string& path) {
  // O_NONBLOCK, so that a pipe without a writer does not hold the program; it means nothing for a regular file.
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (file.number < 0) refuse_file(path, errno);
  struct stat status {};
  if (::fstat(file.number, &status) != 0) refuse_file(path, errno);
  if (S_ISDIR(status.st_mode)) throw FontReadError(text(path, ": is a folder"));
  if (!S_ISREG(status.st_mode)) throw FontReadError(text(path, ": is not a regular file"));
  const auto too_large = [&] { return FontReadError(text(path, ": is larger than ", max_font_size, " bytes")); };
  if (static_cast<std::uintmax_t>(status.st_size) > max_font_size) throw too_large();
  Bytes data(static_cast<std::size_t>(status.st_size) + 1);  // one more, to see the end
  std::size_t size = 0;
  for (;;) {
    if (size == data.size()) data.resize(2 * data.size());
    const ssize_t got = ::read(file.number, data.data() + size, data.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) refuse_file(path, errno);
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    if (size > max_font_size) throw too_large();
  }
  data.resize(size);
  return data;
}

Font load_font(const std::string& path, const LoadOptions& options) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) return load_ufo(path);
  return load_font_bytes(path, read_file(path), options);
}

Font load_font_bytes(const std::string& path, Bytes data, const LoadOptions& options) {
  Container container = Container::Sfnt;
  if (is_web_font(data)) {
    container = data[3] == '2' ? Container::Woff2 : Container::Woff;
    data = unpack_web_font(path, data);
  }
  Font font;
  if (options.location.empty()) {
    font = load_sfnt(path, std::move(data), options.face);
  } else {
    Instance instance = instantiate(path, data, options.face, options.location);
    font = load_sfnt(path, std::move(instance.data));
    font.warnings = std::move(instance.warnings);
  }
  font.container = container;
  return font;
}

}  // namespace glyphs
