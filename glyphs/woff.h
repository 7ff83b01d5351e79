#pragma once

#include <string>

#include "glyphs/font.h"

namespace glyphs {

/// True if the bytes begin as a WOFF or a WOFF2 file does.
bool is_web_font(const Bytes& data);

/// The sfnt that a WOFF or WOFF2 file packs, a collection if it packs one.
///
/// Of WOFF every table is unpacked to exactly the length it claims, and lies in the order of the file; WOFF2 is
/// unpacked by Google's woff2, which writes `glyf` and `loca` anew and forgets overlap flags that it does not know.
/// Extended metadata and private data are not part of the sfnt. Lengths are checked before anything is allocated, and
/// the result is no larger than `max_font_size`.
///
/// Throws  FontReadError, one line naming the file: lengths that lie, data that does not unpack, too large a result.
/// Source  W3C, WOFF File Format 1.0; WOFF File Format 2.0.
Bytes unpack_web_font(const std::string& path, const Bytes& data);

}  // namespace glyphs
