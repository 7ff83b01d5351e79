#include "glyphs/layout_use.h"

#include <algorithm>
#include <bit>
#include <map>
#include <string>

#include "glyphs/sfnt_tables.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using sfnt::Malformed;
using sfnt::tag;
using sfnt::View;

/// Glyphs that share a rule: how many, and how many of them are asked about.
struct Share {
  std::int64_t all = 0;
  std::int64_t asked = 0;
};

/// Pairs with one that is asked about.
std::int64_t pairs(const Share& first, const Share& second) {
  return first.all * second.all - (first.all - first.asked) * (second.all - second.asked);
}

class LayoutReader {
 public:
  LayoutReader(std::size_t glyph_count, const std::vector<int>& asked) : is_asked_(glyph_count, false) {
    for (const int id : asked) is_asked_.at(static_cast<std::size_t>(id)) = true;
    is_anchored_.resize(glyph_count, false);
  }

  void read_gpos(View gpos) {
    table_ = gpos;
    const std::uint64_t lookups = u16(8);
    for (std::uint64_t i = 0; i < u16(lookups); ++i) read_lookup(lookups + u16(lookups + 2 + 2 * i));
  }

  void read_kern(View kern) {
    table_ = kern;
    if (u16(0) != 0) return;  // Apple's
    std::uint64_t at = 4;
    for (int k = 0; k < u16(2); ++k) {
      const std::uint64_t end = at + u16(at + 2);
      if (u16(at + 4) >> 8 == 0) {  // format 0: pairs
        for (std::uint64_t i = 0; i < u16(at + 6); ++i) {
          const std::uint64_t record = at + 14 + 6 * i;
          const bool is_touched = is_asked(u16(record)) || is_asked(u16(record + 2));
          if (u16(record + 4) != 0 && is_touched) ++use_.kerning_pairs;
        }
      }
      at = end;
    }
  }

  LayoutUse use() {
    use_.anchored.clear();
    for (std::size_t id = 0; id < is_anchored_.size(); ++id) {
      if (is_anchored_[id] && is_asked_[id]) use_.anchored.push_back(static_cast<int>(id));
    }
    return use_;
  }

 private:
  std::uint16_t u16(std::uint64_t at) {
    if (++reads_ > most_reads) throw Malformed("tables that share their parts without end");
    return sfnt::u16(table_, at);
  }
  std::uint64_t offset(std::uint64_t base, std::uint64_t at) { return base + u16(base + at); }
  bool is_asked(int glyph) const {
    return static_cast<std::size_t>(glyph) < is_asked_.size() && is_asked_[static_cast<std::size_t>(glyph)];
  }
  void add(Share& share, int glyph) const {
    ++share.all;
    share.asked += is_asked(glyph) ? 1 : 0;
  }

  std::vector<int> coverage(std::uint64_t at) {
    std::vector<int> glyphs;
    const unsigned count = u16(at + 2);
    for (std::uint64_t i = 0; i < count; ++i) {
      if (u16(at) == 1) {
        glyphs.push_back(u16(at + 4 + 2 * i));
      } else {
        const int last = u16(at + 4 + 6 * i + 2);
        for (int glyph = u16(at + 4 + 6 * i); glyph <= last; ++glyph) glyphs.push_back(glyph);
        if (glyphs.size() > is_asked_.size()) throw Malformed("a coverage of more glyphs than there are");
      }
    }
    return glyphs;
  }

  std::map<int, int> classes(std::uint64_t at) {
    std::map<int, int> by_glyph;
    const bool is_list = u16(at) == 1;
    const unsigned count = u16(at + (is_list ? 4U : 2U));
    for (std::uint64_t i = 0; i < count; ++i) {
      if (is_list) {
        by_glyph[u16(at + 2) + static_cast<int>(i)] = u16(at + 6 + 2 * i);
        continue;
      }
      const std::uint64_t range = at + 4 + 6 * i;
      const int last = std::min<int>(u16(range + 2), static_cast<int>(is_asked_.size()) - 1);
      for (int glyph = u16(range); glyph <= last; ++glyph) by_glyph[glyph] = u16(range + 4);
    }
    return by_glyph;
  }

  void read_lookup(std::uint64_t lookup) {
    enum : int { pair = 2, cursive = 3, mark_to_base = 4, mark_to_mark = 6, extension = 9 };
    for (std::uint64_t i = 0; i < u16(lookup + 4); ++i) {
      int type = u16(lookup);
      std::uint64_t at = offset(lookup, 6 + 2 * i);
      if (type == extension) {
        type = u16(at + 2);
        at += sfnt::u32(table_, at + 4);
      }
      if (type == pair) read_pairs(at);
      if (type < cursive || type > mark_to_mark) continue;
      for (const int glyph : coverage(offset(at, 2))) anchor(glyph);
      if (type < mark_to_base) continue;
      for (const int glyph : coverage(offset(at, 4))) anchor(glyph);
    }
  }
  void anchor(int glyph) {
    if (static_cast<std::size_t>(glyph) < is_anchored_.size()) is_anchored_[static_cast<std::size_t>(glyph)] = true;
  }

  // Numbers of a value record at a place; tables by device or variation do not count.
  bool has_value(std::uint64_t at, int format) {
    constexpr int numbers = 4;
    for (int bit = 0; bit < numbers; ++bit) {
      if ((format >> bit & 1) == 0) continue;
      if (u16(at) != 0) return true;
      at += 2;
    }
    return false;
  }

  void read_pairs(std::uint64_t at) {
    const int first_format = u16(at + 4);
    const int second_format = u16(at + 6);
    const auto first_size = static_cast<std::uint64_t>(2 * std::popcount(static_cast<unsigned>(first_format)));
    const auto size = first_size + static_cast<std::uint64_t>(2 * std::popcount(static_cast<unsigned>(second_format)));
    const auto is_kerned = [&](std::uint64_t record) {
      return has_value(record, first_format) || has_value(record + first_size, second_format);
    };
    const std::vector<int> covered = coverage(offset(at, 2));
    if (u16(at) == 1) {
      for (std::uint64_t i = 0; i < covered.size(); ++i) {
        const std::uint64_t set = offset(at, 10 + 2 * i);
        for (std::uint64_t k = 0; k < u16(set); ++k) {
          const std::uint64_t record = set + 2 + k * (2 + size);
          const bool is_touched = is_asked(covered[i]) || is_asked(u16(record));
          if (is_touched && is_kerned(record + 2)) ++use_.kerning_pairs;
        }
      }
      return;
    }
    std::vector<Share> first(static_cast<std::size_t>(u16(at + 12)));
    std::vector<Share> second(static_cast<std::size_t>(u16(at + 14)));
    const std::map<int, int> first_classes = classes(offset(at, 8));
    const std::map<int, int> second_classes = classes(offset(at, 10));
    const auto count = [&](std::vector<Share>& shares, const std::map<int, int>& of, int glyph) {
      const auto found = of.find(glyph);
      const auto its = static_cast<std::size_t>(found == of.end() ? 0 : found->second);
      if (its < shares.size()) add(shares[its], glyph);
    };
    for (const int glyph : covered) count(first, first_classes, glyph);
    for (std::size_t glyph = 0; glyph < is_asked_.size(); ++glyph)
      count(second, second_classes, static_cast<int>(glyph));
    std::uint64_t record = at + 16;
    for (const Share& a : first) {
      for (const Share& b : second) {
        if (is_kerned(record)) use_.kerning_pairs += pairs(a, b);
        record += size;
      }
    }
  }

  static constexpr int most_reads = 50'000'000;
  View table_;
  int reads_ = 0;
  std::vector<bool> is_asked_;
  std::vector<bool> is_anchored_;
  LayoutUse use_;
};

// Names of glyphs, or of groups of them, on either side of a kerning.
std::int64_t ufo_kerning(const Font& font, const std::vector<int>& asked) {
  const auto kerning = font.folder->find("kerning.plist");
  if (kerning == font.folder->end()) return 0;
  std::map<std::string, Share> shares;
  for (const Glyph& glyph : font.glyphs) {
    shares[glyph.name] = {1, std::ranges::binary_search(asked, glyph.id) ? 1 : 0};
  }
  if (const auto groups = font.folder->find("groups.plist"); groups != font.folder->end()) {
    const xml::Document document(groups->second);
    std::map<std::string, Share> sums;
    for (const auto& [name, members] : xml::entries(xml::property_list(document), "its object")) {
      for (const pugi::xml_node member : xml::as_array(members, name)) {
        const auto share = shares.find(xml::as_text(member, name));
        if (share == shares.end()) continue;
        sums[name].all += share->second.all;
        sums[name].asked += share->second.asked;
      }
    }
    shares.insert(sums.begin(), sums.end());
  }
  std::int64_t count = 0;
  const xml::Document document(kerning->second);
  for (const auto& [first, others] : xml::entries(xml::property_list(document), "its object")) {
    for (const auto& [second, value] : xml::entries(others, first)) {
      const auto a = shares.find(first);
      const auto b = shares.find(second);
      if (a == shares.end() || b == shares.end() || xml::as_number(value, second) == 0.0) continue;
      count += pairs(a->second, b->second);
    }
  }
  return count;
}

}  // namespace

LayoutUse layout_use(const Font& font, const std::vector<int>& glyphs) {
  if (font.folder) {
    try {
      return {{}, ufo_kerning(font, glyphs)};
    } catch (const xml::Malformed&) {
      return {};
    }
  }
  if (!font.data) return {};
  LayoutReader reader(font.glyphs.size(), glyphs);
  const sfnt::Directory directory = sfnt::read_directory(*font.data, font.face_index);
  for (const sfnt::Tag name : {tag("GPOS"), tag("kern")}) {
    const sfnt::TableRecord* table = directory.find(name);
    if (table == nullptr) continue;
    try {
      if (name == tag("GPOS")) {
        reader.read_gpos(table->bytes);
      } else {
        reader.read_kern(table->bytes);
      }
    } catch (const Malformed&) {
      continue;
    }
  }
  return reader.use();
}

}  // namespace glyphs
