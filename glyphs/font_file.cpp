#include "glyphs/font_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <system_error>

#include "glyphs/error.h"
#include "glyphs/freetype_loader.h"
#include "glyphs/sfnt_cff.h"
#include "glyphs/ufo.h"
#include "glyphs/woff.h"
#include "glyphs/xml.h"

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

/// The bytes of an open file, or why there are none.
struct Content {
  Bytes data;
  int error = 0;
  bool is_too_large = false;
};

Content read_all(int file, std::uintmax_t expected, std::size_t most) {
  Content content;
  content.is_too_large = expected > most;
  if (content.is_too_large) return content;
  Bytes& data = content.data;
  data.resize(static_cast<std::size_t>(expected) + 1);  // one more, to see the end
  std::size_t size = 0;
  for (;;) {
    if (size == data.size()) data.resize(2 * data.size());
    const ssize_t got = ::read(file, data.data() + size, data.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) content.error = errno;
    if (got <= 0) break;
    size += static_cast<std::size_t>(got);
    content.is_too_large = size > most;
    if (content.is_too_large) break;
  }
  data.resize(size);
  return content;
}

/// Reads a folder through open descriptors, so that nothing that is renamed meanwhile can lead out of it.
class FolderReader {
 public:
  explicit FolderReader(const std::string& path) : path_(path) {}

  Folder read() {
    const Descriptor root(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (root.number < 0) refuse("", errno);
    read_into(root.number, "", 0);
    return std::move(folder_);
  }

 private:
  [[noreturn]] void refuse(const std::string& inside, const std::string& why) const {
    // A path in a folder may be long, so it is shown whole; what would break the line is not.
    std::string name = inside;
    for (char& c : name) c = (c >= 0 && c < ' ') || c == 0x7F ? '?' : c;
    throw FontReadError(text(path_, ": ", name.empty() ? "" : name + ": ", why));
  }
  [[noreturn]] void refuse(const std::string& inside, int error) const {
    refuse(inside, "cannot be read: " + std::generic_category().message(error));
  }

  /// Sorted, so that the first thing to be refused is always the same.
  std::vector<std::string> names_in(int folder, const std::string& prefix) const {
    std::vector<std::string> names;
    const int copy = ::fcntl(folder, F_DUPFD_CLOEXEC, 3);
    DIR* stream = copy < 0 ? nullptr : ::fdopendir(copy);
    if (stream == nullptr) {
      const int error = errno;
      if (copy >= 0) ::close(copy);
      refuse(prefix, error);
    }
    errno = 0;
    while (const dirent* entry = ::readdir(stream)) {
      const std::string name = entry->d_name;
      if (name != "." && name != "..") names.push_back(name);
      if (names.size() > max_folder_files) break;
    }
    const int error = errno;
    ::closedir(stream);
    if (error != 0) refuse(prefix, error);
    std::sort(names.begin(), names.end());
    return names;
  }

  void read_into(int folder, const std::string& prefix, int depth) {
    const std::vector<std::string> names = names_in(folder, prefix);
    if (names.empty() && !prefix.empty()) folder_[prefix];
    for (const std::string& name : names) {
      const std::string inside = prefix + name;
      struct stat status {};
      if (++files_ > max_folder_files) refuse("", text("has more than ", max_folder_files, " files"));
      if (::fstatat(folder, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) != 0) refuse(inside, errno);
      if (S_ISLNK(status.st_mode)) refuse(inside, "is a link, which is not followed");
      if (!S_ISDIR(status.st_mode) && !S_ISREG(status.st_mode)) refuse(inside, "is neither a file nor a folder");
      const bool is_folder = S_ISDIR(status.st_mode);
      const Descriptor file(
          ::openat(folder, name.c_str(),
                   O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | O_NOCTTY | (is_folder ? O_DIRECTORY : 0)));
      if (file.number < 0 || ::fstat(file.number, &status) != 0) refuse(inside, errno);
      if (is_folder) {
        if (depth == max_folder_depth) refuse(inside, text("folders nest deeper than ", max_folder_depth));
        read_into(file.number, inside + "/", depth + 1);
      } else {
        if (!S_ISREG(status.st_mode)) refuse(inside, "is neither a file nor a folder");
        read_file(file.number, inside, static_cast<std::uintmax_t>(status.st_size));
      }
    }
  }

  void read_file(int file, const std::string& inside, std::uintmax_t expected) {
    Content content = read_all(file, expected, max_folder_size - size_);
    if (content.is_too_large) refuse("", text("has more than ", max_folder_size, " bytes in its files"));
    if (content.error != 0) refuse(inside, content.error);
    size_ += content.data.size();
    folder_[inside] = std::move(content.data);
  }

  const std::string& path_;
  Folder folder_;
  std::size_t size_ = 0;
  std::size_t files_ = 0;
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
  Content content = read_all(file.number, static_cast<std::uintmax_t>(status.st_size), max_font_size);
  if (content.is_too_large) throw FontReadError(text(path, ": is larger than ", max_font_size, " bytes"));
  if (content.error != 0) refuse_file(path, content.error);
  return std::move(content.data);
}

Folder read_folder(const std::string& path) { return FolderReader(path).read(); }

Font load_font(const std::string& path, const LoadOptions& options) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) {
    // Before all files of some other folder are read.
    const bool is_ufo = ::stat((path + "/metainfo.plist").c_str(), &status) == 0 || errno != ENOENT;
    if (!is_ufo) throw FontReadError(text(path, ": is a folder without metainfo.plist, so it is no UFO"));
    if (options.face != 0) throw FontReadError(text(path, ": is a UFO, one font; there is no face ", options.face));
    if (!options.location.empty()) throw FontReadError(path + ": is a UFO, not a variable font; it has no location");
    return load_ufo(path, read_folder(path));
  }
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

namespace {

struct Ending {
  const char* text;
  FileKind kind;
};
constexpr std::array<Ending, 4> endings{
    {{".ttf", FileKind::TrueType}, {".otf", FileKind::OpenType}, {".ufo", FileKind::Ufo}, {".svg", FileKind::Svg}}};

WrittenFont written(WrittenUfo ufo) {
  WrittenFont font;
  font.folder = std::move(ufo.folder);
  font.changed_tables = std::move(ufo.changed_files);
  font.moved_composites = std::move(ufo.moved_composites);
  font.decomposed = std::move(ufo.decomposed);
  font.warnings = std::move(ufo.warnings);
  return font;
}

}  // namespace

const char* ending_of(FileKind kind) { return std::ranges::find(endings, kind, &Ending::kind)->text; }

FileKind file_kind(const std::string& path) {
  std::string name = path;
  while (name.size() > 1 && name.back() == '/') name.pop_back();
  const auto found = std::ranges::find_if(endings, [&](const Ending& ending) { return name.ends_with(ending.text); });
  if (found != endings.end()) return found->kind;
  throw RequestError(path + ": the output's ending chooses its format: .ttf, .otf, .ufo or .svg");
}

FileKind kind_of(const Font& font) {
  if (font.is_variable) {
    throw RequestError(font.path +
                       ": is variable, and edited at one place of its design space only: give a --location");
  }
  switch (font.format) {
    case OutlineFormat::Ufo:
      return FileKind::Ufo;
    case OutlineFormat::Cff:
      return FileKind::OpenType;
    case OutlineFormat::Cff2:
      break;
    case OutlineFormat::TrueType:
    case OutlineFormat::None:
      return FileKind::TrueType;
  }
  throw RequestError(font.path + ": has CFF2 outlines, which this version does not write");
}

namespace {

std::vector<std::int64_t> sfnt_bytes(const Font& font, const Bytes& data, int face) {
  std::vector<std::int64_t> bytes(font.glyphs.size(), 0);
  const auto fill = [&](const auto& entry) {
    for (std::size_t id = 0; id < bytes.size(); ++id) {
      try {
        bytes[id] = static_cast<std::int64_t>(entry(static_cast<int>(id)).size());
      } catch (const sfnt::Malformed&) {
        bytes[id] = 0;  // the font gives it no bytes: it is in trouble
      }
    }
  };
  try {
    const sfnt::Directory directory = sfnt::read_directory(data, face);
    const sfnt::Basics basics = sfnt::read_basics(directory);
    if (font.format == OutlineFormat::TrueType) {
      fill([&](int id) { return basics.outlines.bytes(id); });
    } else if (font.format == OutlineFormat::Cff) {
      const sfnt::CffTable table(directory.require(sfnt::tag("CFF "), 0), basics.units_per_em);
      fill([&](int id) { return table.charstrings().object(id); });
    }
  } catch (const sfnt::Malformed& error) {
    throw FontReadError(text(font.path, ": ", error.what()));
  }
  return bytes;
}

}  // namespace

void add_written(const WrittenFont& written, GlyphChange& change) {
  if (const auto emptied = written.emptied.find(change.glyph); emptied != written.emptied.end())
    change.refused = fontcore::text("comes out empty: ", emptied->second);
  if (std::ranges::binary_search(written.dropped_instructions, change.glyph))
    change.dropped.emplace_back("instructions: they were made for the points that were");
  if (std::ranges::binary_search(written.dropped_hints, change.glyph))
    change.dropped.emplace_back("hints: they were made for the points that were");
}

std::vector<std::int64_t> glyph_bytes(const Font& font) {
  return font.folder ? glif_bytes(font, *font.folder) : sfnt_bytes(font, *font.data, font.face_index);
}

std::vector<std::int64_t> glyph_bytes(const Font& font, const WrittenFont& written) {
  return written.folder ? glif_bytes(font, *written.folder) : sfnt_bytes(font, written.data, 0);
}

WrittenFont extract_ufo(const Font& font) { return written(build_ufo(font)); }

void require_kind(const Font& font, const std::string& output) {
  const FileKind own = kind_of(font);
  const FileKind kind = file_kind(output);
  if (kind == own || (font.format == OutlineFormat::None && kind == FileKind::OpenType)) return;
  throw RequestError(
      text(output, ": ", font.path, " keeps its kind of outlines, so the output's ending is ", ending_of(own)));
}

WrittenFont write_font(const Font& font, const EditedGlyphs& edited, const WriteOptions& options) {
  if (font.format == OutlineFormat::Ufo) return written(write_ufo(font, edited, options));
  return write_sfnt(font, edited, options);
}

}  // namespace glyphs
