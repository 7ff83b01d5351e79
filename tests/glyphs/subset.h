#pragma once

// Small fonts out of bundled ones, by HarfBuzz: whole fonts of a few glyphs, for tests that read them thousands of
// times.

#include <hb-subset.h>

#include <string>
#include <vector>

#include "glyphs/font_file.h"

/// A font with only the glyphs of some characters, those that they are composed of, and `.notdef`; names and hints are
/// kept, the tables of layout and of other sizes are not.
inline glyphs::Bytes subset_of(const std::string& path, const std::u32string& characters) {
  const glyphs::Bytes file = glyphs::read_file(path);
  hb_blob_t* const blob = hb_blob_create(reinterpret_cast<const char*>(file.data()), static_cast<unsigned>(file.size()),
                                         HB_MEMORY_MODE_READONLY, nullptr, nullptr);
  hb_face_t* const face = hb_face_create(blob, 0);
  hb_subset_input_t* const input = hb_subset_input_create_or_fail();
  hb_subset_input_set_flags(input, HB_SUBSET_FLAGS_GLYPH_NAMES | HB_SUBSET_FLAGS_NOTDEF_OUTLINE);
  for (const char32_t character : characters) hb_set_add(hb_subset_input_unicode_set(input), character);
  for (const char* const table : {"GSUB", "GPOS", "GDEF", "BASE", "kern", "hdmx", "VDMX", "LTSH", "FFTM", "DSIG"}) {
    hb_set_add(hb_subset_input_set(input, HB_SUBSET_SETS_DROP_TABLE_TAG), hb_tag_from_string(table, 4));
  }
  hb_face_t* const subset = hb_subset_or_fail(face, input);
  hb_blob_t* const result = hb_face_reference_blob(subset);
  unsigned size = 0;
  const char* const data = hb_blob_get_data(result, &size);
  glyphs::Bytes bytes(data, data + size);
  hb_blob_destroy(result);
  hb_face_destroy(subset);
  hb_subset_input_destroy(input);
  hb_face_destroy(face);
  hb_blob_destroy(blob);
  return bytes;
}
