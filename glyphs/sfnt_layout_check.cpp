#include <bit>
#include <optional>

#include "glyphs/sfnt_check.h"

namespace glyphs::sfnt {

namespace {

using fontcore::text;

void require(bool holds, const std::string& else_why) {
  if (!holds) throw Malformed(else_why);
}

/// Numbers read of a table at most: what shares its parts over and over takes many times its size to read.
constexpr std::int64_t most_reads = 20'000'000;

/// A part of a table, read from its start on; offsets in it are from there.
class Part {
 public:
  Part(View bytes, std::int64_t& reads) : bytes_(bytes), reads_(&reads) {}

  unsigned next() {
    require(++*reads_ <= most_reads, "too many parts");
    const unsigned value = u16(bytes_, at_);
    at_ += 2;
    return value;
  }
  std::uint32_t next_32() {
    const std::uint32_t high = next();
    return high << 16 | next();
  }
  void skip(std::uint64_t bytes) {
    slice(bytes_, at_, bytes);
    at_ += bytes;
  }
  /// How many bytes have been read.
  std::uint64_t at() const { return at_; }
  /// Where a list of so many bytes ends, within what an offset can reach.
  std::uint64_t list_end(std::uint64_t bytes) const {
    require(at_ + bytes <= 0xFFFF, text("a list of ", bytes, " bytes"));
    return at_ + bytes;
  }
  /// The part at an offset, which must lie at `end` or behind it.
  Part part(std::uint64_t offset, std::uint64_t end) const {
    require(offset >= end && offset < bytes_.size(),
            text("an offset ", offset, " between ", end, " and ", bytes_.size()));
    return {bytes_.subspan(offset), *reads_};
  }

 private:
  View bytes_;
  std::int64_t* reads_;
  std::uint64_t at_ = 0;
};

// ---- what the tables share

class Common {
 public:
  explicit Common(int glyph_count) : glyphs_(static_cast<unsigned>(glyph_count)) {}

 protected:
  void coverage(Part part) const {
    const unsigned format = part.next();
    require(format == 1 || format == 2, text("a coverage of format ", format));
    const unsigned count = part.next();
    require(count <= glyphs_, text("a coverage of ", count));
    unsigned last = 0;
    unsigned index = 0;
    for (unsigned i = 0; i < count; ++i) {
      const unsigned first = part.next();
      if (format == 1) {
        require(first <= glyphs_, text("glyph ", first, " of ", glyphs_));
        continue;
      }
      const unsigned end = part.next();
      require(first <= end && (last == 0 || first >= last), text("a coverage from ", first, " to ", end));
      require(part.next() == index, "coverage indices with a gap");
      last = end;
      index = (index + end - first + 1) & 0xFFFF;
    }
  }

  void classes(Part part, unsigned most_class = 0xFFFF) const {
    const unsigned format = part.next();
    require(format == 1 || format == 2, text("classes of format ", format));
    if (format == 1) require(part.next() <= glyphs_, "classes beyond the last glyph");
    const unsigned count = part.next();
    require(count <= glyphs_, text("classes of ", count));
    unsigned last = 0;
    for (unsigned i = 0; i < count; ++i) {
      if (format == 2) {
        const unsigned first = part.next();
        const unsigned end = part.next();
        require(first <= end && (last == 0 || first > last), text("classes from ", first, " to ", end));
        last = end;
      }
      require(part.next() <= most_class, "a class beyond the last");
    }
  }

  static void device(Part part) {
    const unsigned first = part.next();
    const unsigned last = part.next();
    const unsigned format = part.next();
    constexpr unsigned variation = 0x8000;
    if (format == variation) return;
    require(first <= last && format >= 1 && format <= 3, text("a device table of format ", format));
    part.skip(2 * ((last - first) / (1U << (4 - format)) + 1));
  }

  unsigned glyphs_;
};

// ---- GDEF

class Definitions : Common {
 public:
  using Common::Common;

  void check(Part table, bool is_variable) {
    const unsigned major = table.next();
    const unsigned minor = table.next();
    require(major == 1 && minor != 1, text("version ", major, ".", minor));
    const unsigned glyph_classes = table.next();
    const unsigned attachments = table.next();
    const unsigned carets = table.next();
    const unsigned mark_classes = table.next();
    const unsigned mark_sets = minor >= 2 ? table.next() : 0;
    const std::uint32_t variations = minor >= 3 ? table.next_32() : 0;
    const std::uint64_t end = table.at();
    constexpr unsigned most_glyph_class = 4;
    if (glyph_classes) classes(table.part(glyph_classes, end), most_glyph_class);
    if (attachments) check_attachments(table.part(attachments, end));
    if (carets) check_carets(table.part(carets, end));
    if (mark_classes) classes(table.part(mark_classes, end));
    if (mark_sets) check_mark_sets(table.part(mark_sets, end));
    if (variations && !is_variable) {
      Part store = table.part(variations, end);
      require(store.next() == 1, "a variation store of an unknown format");
      Part regions = store.part(store.next_32(), 0);
      regions.next();
      require(regions.next() == 0, "variations in a font without axes");
    }
  }

  unsigned mark_sets() const { return mark_sets_; }

 private:
  /// A coverage and a list of parts, one for each glyph of it.
  template <typename Check>
  void each(Part list, Check check) const {
    const unsigned covered = list.next();
    const unsigned count = list.next();
    const std::uint64_t end = list.list_end(std::uint64_t{2} * count);
    require(count <= glyphs_, text("a list of ", count));
    coverage(list.part(covered, end));
    for (unsigned i = 0; i < count; ++i) {
      const unsigned offset = list.next();
      check(offset, list.part(offset, end));
    }
  }

  void check_attachments(const Part& list) const {
    each(list, [](unsigned, Part points) {
      const unsigned count = points.next();
      require(count > 0, "an attachment without points");
      unsigned last = 0;
      for (unsigned i = 0; i < count; ++i) {
        const unsigned point = points.next();
        require(last == 0 || point > last, "attachment points out of order");
        last = point;
      }
    });
  }

  void check_carets(const Part& list) const {
    each(list, [&](unsigned at, Part carets) {
      const unsigned count = carets.next();
      require(count > 0, "a ligature without carets");
      const std::uint64_t end = carets.at() + std::uint64_t{2} * count;
      for (unsigned i = 0; i < count; ++i) {
        const unsigned offset = carets.next();
        Part caret = carets.part(offset, end);
        const unsigned format = caret.next();
        require(format >= 1 && format <= 3, text("a caret of format ", format));
        caret.skip(2);
        if (format != 3) continue;
        const unsigned beside = caret.next();
        require(beside != 0, "a caret without its device table");
        device(list.part((at + offset + beside) & 0xFFFF, 0));  // sanitizers add in 16 bits
      }
    });
  }

  void check_mark_sets(Part list) {
    const unsigned format = list.next();
    require(format == 1, text("mark sets of format ", format));
    mark_sets_ = list.next();
    const std::uint64_t end = list.list_end(std::uint64_t{2} * mark_sets_);
    for (unsigned i = 0; i < mark_sets_; ++i) coverage(list.part(list.next_32(), end));
  }

  unsigned mark_sets_ = 0;
};

// ---- GSUB and GPOS

/// Lookups, features and scripts; what a lookup's subtables say is up to the table.
class Layout : protected Common {
 public:
  /// `mark_sets`   of GDEF, if there is one.
  Layout(int glyph_count, std::optional<unsigned> mark_sets, unsigned extension_type, unsigned last_type)
      : Common(glyph_count), mark_sets_(mark_sets), extension_type_(extension_type), last_type_(last_type) {}
  virtual ~Layout() = default;
  Layout(const Layout&) = delete;
  Layout& operator=(const Layout&) = delete;

  void check(Part table, bool is_variable) {
    const unsigned major = table.next();
    const unsigned minor = table.next();
    require(major == 1 && minor <= 1, text("version ", major, ".", minor));
    const unsigned scripts = table.next();
    const unsigned features = table.next();
    const unsigned lookups = table.next();
    const std::uint32_t variations = minor == 1 ? table.next_32() : 0;
    const std::uint64_t end = table.at();
    if (lookups) check_lookups(table.part(lookups, end));
    if (features) check_features(table.part(features, end));
    if (scripts) check_scripts(table.part(scripts, end));
    require(variations == 0 || is_variable, "feature variations in a font without axes");
  }

 protected:
  virtual void check_subtable(Part part, unsigned type) const = 0;

  /// Offsets to coverages, read now and looked at once it is known where the list they belong to ends.
  static std::vector<unsigned> numbers(Part& part, unsigned count) {
    std::vector<unsigned> all;
    for (unsigned i = 0; i < count; ++i) all.push_back(part.next());
    return all;
  }

  /// A list of offsets to parts that `check` looks at; an offset of 0 is one only where that `may_be_none`.
  template <typename Check>
  static void each(Part& part, unsigned count, std::uint64_t end, bool may_be_none, Check check) {
    for (unsigned i = 0; i < count; ++i) {
      const unsigned offset = part.next();
      if (offset != 0 || !may_be_none) check(part.part(offset, end));
    }
  }

  void context(Part part, bool is_chained) const {
    const unsigned format = part.next();
    if (format == 3) return coverage_context(part, is_chained);
    require(format == 1 || format == 2, text("a context of format ", format));
    const bool has_classes = format == 2;
    const unsigned covered = part.next();
    std::vector<unsigned> definitions;
    if (has_classes) definitions = numbers(part, is_chained ? 3 : 1);
    const unsigned count = part.next();
    const std::uint64_t end = part.list_end(std::uint64_t{2} * count);
    coverage(part.part(covered, end));
    for (std::size_t i = 0; i < definitions.size(); ++i) {
      const bool is_input = !is_chained || i == 1;
      if (definitions[i] != 0 || is_input) classes(part.part(definitions[i], end));
    }
    each(part, count, end, has_classes, [&](Part set) {
      const unsigned rules = set.next();
      const std::uint64_t set_end = set.list_end(std::uint64_t{2} * rules);
      each(set, rules, set_end, false, [&](const Part& rule) { check_rule(rule, is_chained, has_classes); });
    });
  }

 private:
  void check_lookups(Part list) {
    lookups_ = list.next();
    const std::uint64_t end = list.list_end(std::uint64_t{2} * lookups_);
    unsigned index = 0;
    each(list, lookups_, end, false, [&](const Part& lookup) {
      try {
        check_lookup(lookup);
      } catch (const Malformed& error) {
        throw Malformed(text("lookup ", index, ": ", error.what()));
      }
      ++index;
    });
  }

  void check_lookup(Part lookup) const {
    const unsigned type = lookup.next();
    const unsigned flags = lookup.next();
    const unsigned count = lookup.next();
    require(type >= 1 && type <= last_type_, text("type ", type));
    constexpr unsigned uses_mark_set = 0x10;
    const bool has_set = (flags & uses_mark_set) != 0;
    const std::uint64_t end = lookup.list_end(std::uint64_t{2} * count + (has_set ? 2 : 0));
    each(lookup, count, end, false, [&](Part part) {
      if (type != extension_type_) return check_subtable(part, type);
      const unsigned format = part.next();
      const unsigned inner = part.next();
      require(format == 1, text("an extension of format ", format));
      require(inner >= 1 && inner <= last_type_ && inner != extension_type_, text("an extension of type ", inner));
      const std::uint32_t offset = part.next_32();
      check_subtable(part.part(offset, part.at()), inner);
    });
    if (!has_set) return;
    const unsigned set = lookup.next();
    require(!mark_sets_ || set < *mark_sets_, text("mark set ", set, " of ", mark_sets_.value_or(0)));
  }

  void check_features(Part list) {
    features_ = list.next();
    const std::uint64_t end = list.list_end(std::uint64_t{6} * features_);
    for (unsigned i = 0; i < features_; ++i) {
      list.skip(4);
      Part feature = list.part(list.next(), end);
      const unsigned parameters = feature.next();
      const unsigned count = feature.next();
      const std::uint64_t feature_end = feature.list_end(std::uint64_t{2} * count);
      if (parameters) feature.part(parameters, feature_end);
      for (unsigned k = 0; k < count; ++k) {
        const unsigned lookup = feature.next();
        require(lookup < lookups_, text("feature ", i, " has lookup ", lookup, " of ", lookups_));
      }
    }
  }

  void check_scripts(Part list) const {
    const unsigned count = list.next();
    const std::uint64_t end = list.list_end(std::uint64_t{6} * count);
    for (unsigned i = 0; i < count; ++i) {
      const std::uint32_t name = list.next_32();
      Part script = list.part(list.next(), end);
      const unsigned common = script.next();
      require(common != 0 || name != tag("DFLT"), "script DFLT has no language of its own");
      const unsigned languages = script.next();
      const std::uint64_t script_end = script.list_end(std::uint64_t{6} * languages);
      std::uint32_t last = 0;
      for (unsigned k = 0; k < languages; ++k) {
        const std::uint32_t language = script.next_32();
        require(last <= language, text("script ", tag_name(name), ": languages out of order"));
        last = language;
        check_language(script.part(script.next(), script_end));
      }
    }
  }

  void check_language(Part language) const {
    require(language.next() == 0, "a language with a lookup order");
    const unsigned required = language.next();
    const unsigned count = language.next();
    require((required == 0xFFFF || required < features_) && count <= features_,
            text("a language with ", count, " of ", features_, " features"));
    for (unsigned i = 0; i < count; ++i) {
      const unsigned feature = language.next();
      require(feature < features_, text("a language with feature ", feature, " of ", features_));
    }
  }

  void check_records(Part& part, unsigned count) const {
    for (unsigned i = 0; i < count; ++i) {
      const unsigned place = part.next();
      const unsigned lookup = part.next();
      require(place < glyphs_ && lookup < lookups_, text("a context calls lookup ", lookup, " of ", lookups_));
    }
  }

  /// A sequence of a rule: glyphs, or classes, which may be any; of the input the first stands in the coverage.
  unsigned sequence_length(Part& part, bool is_input) const {
    const unsigned count = part.next();
    require(count < glyphs_ && !(is_input && count == 0), text("a context of ", count, " glyphs"));
    return count;
  }
  void check_sequence(Part& part, unsigned count, bool has_classes) const {
    for (unsigned i = 0; i < count; ++i) {
      const unsigned glyph = part.next();
      require(has_classes || glyph <= glyphs_, text("glyph ", glyph, " of ", glyphs_));
    }
  }

  void check_rule(Part rule, bool is_chained, bool has_classes) const {
    if (!is_chained) {
      const unsigned input = sequence_length(rule, true);
      const unsigned records = rule.next();
      check_sequence(rule, input - 1, has_classes);
      return check_records(rule, records);
    }
    check_sequence(rule, sequence_length(rule, false), has_classes);
    check_sequence(rule, sequence_length(rule, true) - 1, has_classes);
    check_sequence(rule, sequence_length(rule, false), has_classes);
    check_records(rule, rule.next());
  }

  /// One coverage for each glyph of the context.
  void coverage_context(Part& part, bool is_chained) const {
    std::vector<unsigned> offsets;
    unsigned records = 0;
    if (is_chained) {
      for (int k = 0; k < 3; ++k) {
        const std::vector<unsigned> some = numbers(part, sequence_length(part, false));
        offsets.insert(offsets.end(), some.begin(), some.end());
      }
      records = part.next();
    } else {
      const unsigned count = sequence_length(part, false);
      records = part.next();
      offsets = numbers(part, count);
    }
    const std::uint64_t end = part.list_end(std::uint64_t{4} * records);
    for (const unsigned offset : offsets) coverage(part.part(offset, end));
    check_records(part, records);
  }

  std::optional<unsigned> mark_sets_;
  unsigned extension_type_;
  unsigned last_type_;
  unsigned lookups_ = 0;
  unsigned features_ = 0;
};

class Substitutions : public Layout {
 public:
  Substitutions(int glyph_count, std::optional<unsigned> mark_sets) : Layout(glyph_count, mark_sets, 7, 8) {}

 protected:
  void check_subtable(Part part, unsigned type) const override {
    switch (type) {
      case 1:
        return single(part);
      case 2:
      case 3:
      case 4:
        return sets(part, type == 4);
      case 5:
      case 6:
        return context(part, type == 6);
      default:
        return reverse(part);
    }
  }

 private:
  void check_glyphs(Part& part, unsigned count) const {
    for (unsigned i = 0; i < count; ++i) {
      const unsigned glyph = part.next();
      require(glyph < glyphs_, text("glyph ", glyph, " of ", glyphs_));
    }
  }

  void single(Part part) const {
    const unsigned format = part.next();
    const unsigned covered = part.next();
    require(format == 1 || format == 2, text("a substitution of format ", format));
    const unsigned number = part.next();
    if (format == 1) {
      const int shift = static_cast<std::int16_t>(number);
      require(static_cast<unsigned>(shift < 0 ? -shift : shift) < glyphs_, text("glyphs shifted by ", shift));
    } else {
      require(number <= glyphs_, text(number, " substitutes"));
      check_glyphs(part, number);
    }
    coverage(part.part(covered, part.at()));
  }

  /// One glyph for several, one of several, or ligatures.
  void sets(Part part, bool has_ligatures) const {
    const unsigned format = part.next();
    const unsigned covered = part.next();
    const unsigned count = part.next();
    require(format == 1, text("a substitution of format ", format));
    const std::uint64_t end = part.list_end(std::uint64_t{2} * count);
    each(part, count, end, false, [&](Part set) {
      const unsigned members = set.next();
      if (!has_ligatures) {
        require(members <= glyphs_, text(members, " substitutes"));
        return check_glyphs(set, members);
      }
      const std::uint64_t set_end = set.list_end(std::uint64_t{2} * members);
      each(set, members, set_end, false, [&](Part ligature) {
        check_glyphs(ligature, 1);
        const unsigned components = ligature.next();
        require(components > 0 && components <= glyphs_, text("a ligature of ", components));
        check_glyphs(ligature, components - 1);
      });
    });
    coverage(part.part(covered, end));
  }

  void reverse(Part part) const {
    part.next();
    const unsigned covered = part.next();
    std::vector<unsigned> offsets = numbers(part, part.next());
    const std::vector<unsigned> behind = numbers(part, part.next());
    offsets.insert(offsets.end(), behind.begin(), behind.end());
    offsets.push_back(covered);
    check_glyphs(part, part.next());
    const std::uint64_t end = part.list_end(0);
    for (const unsigned offset : offsets) coverage(part.part(offset, end));
  }
};

class Positions : public Layout {
 public:
  Positions(int glyph_count, std::optional<unsigned> mark_sets) : Layout(glyph_count, mark_sets, 9, 9) {}

 protected:
  void check_subtable(Part part, unsigned type) const override {
    switch (type) {
      case 1:
        return single(part);
      case 2:
        return pair(part);
      case 3:
        return cursive(part);
      case 4:
      case 5:
      case 6:
        return marks(part, type == 5);
      default:
        return context(part, type == 8);
    }
  }

 private:
  static void value(Part& part, unsigned format) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      if (!(format >> bit & 1)) continue;
      const unsigned number = part.next();
      if (bit >= 4 && number != 0) device(part.part(number, 0));
    }
  }
  static std::uint64_t value_size(unsigned format) {
    return std::uint64_t{2} * static_cast<unsigned>(std::popcount(format & 0xFF));
  }

  static void anchor(Part part) {
    const unsigned format = part.next();
    require(format >= 1 && format <= 3, text("an anchor of format ", format));
    part.skip(4);
    if (format == 2) part.next();
    if (format != 3) return;
    for (const unsigned offset : numbers(part, 2)) {
      if (offset != 0) device(part.part(offset, part.at()));
    }
  }

  void single(Part part) const {
    const unsigned format = part.next();
    const unsigned covered = part.next();
    const unsigned values = part.next();
    require(format == 1 || format == 2, text("a position of format ", format));
    const unsigned count = format == 1 ? 1 : part.next();
    for (unsigned i = 0; i < count; ++i) value(part, values);
    coverage(part.part(covered, part.at()));
  }

  void pair(Part part) const {
    const unsigned format = part.next();
    const unsigned covered = part.next();
    const unsigned first = part.next();
    const unsigned second = part.next();
    require(format == 1 || format == 2, text("pairs of format ", format));
    coverage(part.part(covered, part.at()));
    if (format == 1) {
      const unsigned count = part.next();
      const std::uint64_t end = part.list_end(std::uint64_t{2} * count);
      each(part, count, end, false, [&](Part set) {
        const unsigned pairs = set.next();
        for (unsigned i = 0; i < pairs; ++i) {
          const unsigned glyph = set.next();
          require(glyph < glyphs_, text("glyph ", glyph, " of ", glyphs_));
          value(set, first);
          value(set, second);
        }
      });
      return;
    }
    const std::vector<unsigned> definitions = numbers(part, 2);
    const std::uint64_t rows = part.next();
    const std::uint64_t cells = rows * part.next();
    const std::uint64_t end = part.at() + cells * (value_size(first) + value_size(second));
    for (const unsigned offset : definitions) classes(part.part(offset, end));
    if (value_size(second) == 0) return;  // sanitizers look at neither value then
    for (std::uint64_t i = 0; i < cells; ++i) {
      value(part, first);
      value(part, second);
    }
  }

  void cursive(Part part) const {
    const unsigned format = part.next();
    const unsigned covered = part.next();
    const unsigned count = part.next();
    require(format == 1, text("cursive joins of format ", format));
    const std::uint64_t end = part.list_end(std::uint64_t{2} * count);  // of half the list, as sanitizers have it
    each(part, 2 * count, end, true, anchor);
    coverage(part.part(covered, part.at()));
  }

  void marks(Part part, bool on_ligatures) const {
    const unsigned format = part.next();
    const std::vector<unsigned> covered = numbers(part, 2);
    const unsigned class_count = part.next();
    const std::vector<unsigned> arrays = numbers(part, 2);
    require(format == 1, text("marks of format ", format));
    for (const unsigned offset : covered) coverage(part.part(offset, part.at()));
    Part marks = part.part(arrays[0], part.at());
    const unsigned count = marks.next();
    const std::uint64_t end = marks.list_end(std::uint64_t{4} * count);
    for (unsigned i = 0; i < count; ++i) {
      marks.next();
      anchor(marks.part(marks.next(), end));
    }
    Part bases = part.part(arrays[1], part.at());
    if (!on_ligatures) return anchors(bases, class_count);
    const unsigned ligatures = bases.next();
    each(bases, ligatures, 2, false, [&](const Part& ligature) { anchors(ligature, class_count); });
  }

  static void anchors(Part part, unsigned class_count) {
    const std::uint64_t count = std::uint64_t{part.next()} * class_count;
    const std::uint64_t end = part.list_end(2 * count);
    each(part, static_cast<unsigned>(count), end, true, anchor);
  }
};

}  // namespace

std::vector<std::string> layout_faults(const Directory& directory, int glyph_count) {
  std::vector<std::string> faults;
  const bool is_variable = directory.has(tag("fvar"));
  const auto look = [&](Tag name, auto&& checker) {
    const TableRecord* table = directory.find(name);
    if (!table || table->bytes.empty()) return;
    std::int64_t reads = 0;
    try {
      checker.check(Part(table->bytes, reads), is_variable);
    } catch (const Malformed& error) {
      faults.push_back(text("table ", tag_name(name), ": ", error.what()));
    }
  };
  Definitions definitions(glyph_count);
  look(tag("GDEF"), definitions);
  std::optional<unsigned> mark_sets;
  if (directory.has(tag("GDEF"))) mark_sets = definitions.mark_sets();
  look(tag("GSUB"), Substitutions(glyph_count, mark_sets));
  look(tag("GPOS"), Positions(glyph_count, mark_sets));
  return faults;
}

}  // namespace glyphs::sfnt
