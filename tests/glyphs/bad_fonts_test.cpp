// Fonts broken on purpose, by the same bytes every time: none may crash, hang, fill the memory, be complained about in
// more than a line, or come out as a font that does not read back.

#include <functional>
#include <random>

#include "glyphs/safe_file.h"
#include "tests/bundled_fonts.h"
#include "tests/glyphs/sfnt_bytes.h"
#include "tests/glyphs/subset.h"
#include "tests/glyphs/survive.h"
#include "tests/glyphs/variable_bytes.h"

namespace {

using namespace sfnt_bytes;
using Tables = std::map<std::string, Bytes>;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  /// From 0 to count - 1.
  std::size_t below(std::size_t count) { return count == 0 ? 0 : engine_() % count; }
  template <typename T>
  T of(std::initializer_list<T> choices) {
    return choices.begin()[below(choices.size())];
  }
  unsigned char byte() { return static_cast<unsigned char>(engine_()); }

 private:
  std::mt19937 engine_;
};

void set32(Bytes& bytes, std::size_t at, std::uint32_t value) {
  set16(bytes, at, static_cast<int>(value >> 16));
  set16(bytes, at + 2, static_cast<int>(value & 0xFFFF));
}

/// A good font to be broken.
struct Source {
  std::string name;
  Bytes file;
  Tables tables = {};
  bool has_glyf = false;

  Source(std::string name_, Bytes file_) : name(std::move(name_)), file(std::move(file_)) {
    tables = tables_of(file);
    has_glyf = tables.contains("glyf");
  }
  Bytes font(const Tables& now) const {
    Bytes bytes = font_of(now);
    std::copy_n(file.begin(), 4, bytes.begin());
    return bytes;
  }
  std::string any_table(Random& random) const {
    return std::next(tables.begin(), static_cast<std::ptrdiff_t>(random.below(tables.size())))->first;
  }
  std::size_t record(Random& random) const { return 12 + 16 * random.below(tables.size()); }
};

Tables with_glyphs(const Tables& tables, const std::vector<Bytes>& glyphs) {
  Tables now = tables;
  Bytes glyf;
  Bytes loca;
  for (Bytes glyph : glyphs) {
    put(loca, static_cast<std::uint32_t>(glyf.size()), 4);
    glyph.resize((glyph.size() + 3) / 4 * 4);
    glyf.insert(glyf.end(), glyph.begin(), glyph.end());
  }
  put(loca, static_cast<std::uint32_t>(glyf.size()), 4);
  now["glyf"] = glyf;
  now["loca"] = loca;
  set16(now["head"], 50, 1);
  return now;
}

struct Mutation {
  const char* name;
  Bytes (*make)(const Source&, Random&);
};

/// Of any font.
const std::vector<Mutation> of_bytes{
    {"bytes anywhere",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       for (std::size_t k = random.of({1u, 4u, 32u, 256u}); k > 0; --k) file[random.below(file.size())] = random.byte();
       return file;
     }},
    {"bytes of the directory",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       for (std::size_t k = random.of({1u, 2u, 8u}); k > 0; --k) {
         file[random.below(12 + 16 * source.tables.size())] = random.byte();
       }
       return file;
     }},
    {"bytes of a table",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       Bytes& table = tables[source.any_table(random)];
       const std::size_t front = random.of({std::size_t{16}, std::size_t{80}, table.size()});
       for (std::size_t k = random.of({1u, 3u, 20u}); k > 0 && !table.empty(); --k) {
         table[random.below(std::min(front, table.size()))] =
             random.of<unsigned char>({0, 1, 0x7F, 0x80, 0xFF, random.byte()});
       }
       return source.font(tables);
     }},
    {"words of a table",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       Bytes& table = tables[source.any_table(random)];
       for (std::size_t k = random.of({1u, 3u}); k > 0 && table.size() > 2; --k) {
         set16(table, random.below(table.size() / 2) * 2 % (table.size() - 1),
               random.of({0, 1, 0x7FFF, 0x8000, 0xFFFE, 0xFFFF}));
       }
       return source.font(tables);
     }},
    {"the end is missing",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       file.resize(random.of({random.below(16), random.below(12 + 16 * source.tables.size()), random.below(file.size()),
                              file.size() - 1}));
       return file;
     }},
    {"the end of a table is missing",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       Bytes& table = tables[source.any_table(random)];
       table.resize(random.of({std::size_t{0}, std::size_t{1}, random.below(table.size() + 1)}));
       return source.font(tables);
     }},
    {"a table's length lies",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       const auto size = static_cast<std::uint32_t>(file.size());
       set32(
           file, source.record(random) + 12,
           random.of<std::uint32_t>({0, 1, size - 1, size, size + 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFC, 0xFFFFFFFF}));
       return file;
     }},
    {"a table's place lies",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       const auto size = static_cast<std::uint32_t>(file.size());
       set32(file, source.record(random) + 8,
             random.of<std::uint32_t>({0, 4, 11, size - 1, size, 0x7FFFFFFF, 0xFFFFFFF0, 0xFFFFFFFF}));
       return file;
     }},
    {"two tables overlap",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       const std::size_t to = source.record(random);
       set32(file, source.record(random) + 8, get(file, to + 8, 4) + random.of({0u, 2u, 8u}));
       return file;
     }},
    {"a table is missing",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       tables.erase(source.any_table(random));
       return source.font(tables);
     }},
    {"two tables are swapped",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       std::swap(tables[source.any_table(random)], tables[source.any_table(random)]);
       return source.font(tables);
     }},
    {"a table is there twice",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       std::copy_n(file.begin() + static_cast<std::ptrdiff_t>(source.record(random)), 4,
                   file.begin() + static_cast<std::ptrdiff_t>(source.record(random)));
       return file;
     }},
    {"the number of tables lies",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       set16(file, 4, random.of({0, 1, static_cast<int>(source.tables.size()) + 1, 4096, 0xFFFF}));
       return file;
     }},
    {"the version lies",
     [](const Source& source, Random& random) {
       Bytes file = source.file;
       const std::string version = random.of<std::string>(
           {"OTTO", std::string("\0\1\0\0", 4), "true", "typ1", "ttcf", "wOFF", "wOF2", "%!PS", "\x80\1xx"});
       std::copy(version.begin(), version.end(), file.begin());
       return file;
     }},
    {"a table of noise",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       for (unsigned char& byte : tables[source.any_table(random)]) byte = random.byte();
       return source.font(tables);
     }},
    {"the number of glyphs lies",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       const int count = get16(tables["maxp"], 4);
       set16(tables["maxp"], 4, random.of({0, 1, count - 1, count + 1, 2 * count, 0xFFFF}));
       return source.font(tables);
     }},
    {"limits of maxp lie",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       Bytes& maxp = tables["maxp"];
       for (std::size_t at = 6; at + 2 <= maxp.size(); at += 2) set16(maxp, at, random.of({0, 0xFFFF}));
       return source.font(tables);
     }},
    {"head lies",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       const auto [at, value] = random.of<std::pair<std::size_t, int>>({{0, 7},
                                                                        {12, 0},
                                                                        {18, 0},
                                                                        {18, 15},
                                                                        {18, 16},
                                                                        {18, 16384},
                                                                        {18, 0xFFFF},
                                                                        {36, 0x7FFF},
                                                                        {40, 0x8000},
                                                                        {50, 0},
                                                                        {50, 1},
                                                                        {50, 2},
                                                                        {52, 7}});
       set16(tables["head"], at, value);
       return source.font(tables);
     }},
    {"the number of advances lies",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       set16(tables["hhea"], 34, random.of({0, 1, get16(tables["maxp"], 4) + 1, 0xFFFF}));
       if (random.below(2) == 0) tables["hmtx"].resize(random.below(tables["hmtx"].size()));
       return source.font(tables);
     }},
    {"a cmap of giant groups",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       const std::size_t groups = random.of({1u, 2u, 500u});
       const int format = random.of({12, 13});
       Bytes cmap;
       for (const int value : {0, 1, 3, 10}) put16(cmap, value);
       put(cmap, 12, 4);
       for (const int value : {format, 0}) put16(cmap, value);
       for (const std::size_t value : {16 + 12 * groups, std::size_t{0}, groups})
         put(cmap, static_cast<std::uint32_t>(value), 4);
       for (std::size_t k = 0; k < groups; ++k) {
         put(cmap, static_cast<std::uint32_t>(random.of({std::size_t{0}, k * 1000})), 4);
         put(cmap, random.of({0xFFFFFFFFu, 0x10FFFFu, static_cast<std::uint32_t>(k * 1000 + 999)}), 4);
         put(cmap, random.of({0u, 1u, 0xFFFFu, 0xFFFFFFFFu}), 4);
       }
       tables["cmap"] = cmap;
       return source.font(tables);
     }},
    {"a cmap of crossed segments",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       constexpr int segments = 200;
       Bytes cmap;
       for (const int value : {0, 1, 3, 1}) put16(cmap, value);
       put(cmap, 12, 4);
       for (const int value : {4, 16 + 8 * segments, 0, 2 * segments, 0, 0, 0}) put16(cmap, value);
       for (int k = 0; k < segments; ++k) put16(cmap, random.of({k, 0xFFFF, 0xFFFE}));
       put16(cmap, 0);
       for (int k = 0; k < 3 * segments; ++k) put16(cmap, random.of({0, k, 0xFFFF, 0x7FFF, 1}));
       tables["cmap"] = cmap;
       return source.font(tables);
     }},
    {"names of all kinds",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       const int count = get16(tables["maxp"], 4);
       const std::string name = random.of<std::string>({"../../outside", "/outside", "a/b\\c", "<g id=\"", "two\nlines",
                                                        "\xFF\xFE", "same", "", std::string(255, '.')});
       Bytes post = tables["post"];
       post.resize(32);
       set32(post, 0, 0x20000);
       put16(post, count);
       for (int k = 0; k < count; ++k) put16(post, random.of({258 + k, 258 + k, 0xFFFF, 258}));
       for (int k = 0; k < count; ++k) {
         put(post, static_cast<std::uint32_t>(name.size()), 1);
         post.insert(post.end(), name.begin(), name.end());
       }
       if (random.below(3) == 0) post.resize(random.below(post.size()));
       tables["post"] = post;
       return source.font(tables);
     }},
    {"a collection that lies",
     [](const Source& source, Random& random) {
       Bytes file{'t', 't', 'c', 'f'};
       put(file, random.of({0x10000u, 0x20000u, 9u}), 4);
       put(file, random.of({0u, 1u, 2u, 0xFFFFu, 0xFFFFFFFFu}), 4);
       for (int k = 0; k < 2; ++k) put(file, random.of({0u, 12u, 20u, 0xFFFFFFFFu}), 4);
       file.insert(file.end(), source.file.begin(), source.file.end());
       return file;
     }},
};

/// A simple glyph of the source with some bytes.
std::size_t any_simple(const std::vector<Bytes>& glyphs, Random& random) {
  std::vector<std::size_t> simple;
  for (std::size_t id = 0; id < glyphs.size(); ++id) {
    if (glyphs[id].size() > 30 && get16(glyphs[id], 0) > 0) simple.push_back(id);
  }
  return simple.at(random.below(simple.size()));
}

/// Of fonts with `glyf`.
const std::vector<Mutation> of_glyf{
    {"loca out of order",
     [](const Source& source, Random& random) {
       Tables tables = with_glyphs(source.tables, glyphs_of(source.tables));
       Bytes& loca = tables["loca"];
       for (std::size_t k = random.of({1u, 5u}); k > 0; --k) {
         set32(loca, 4 * random.below(loca.size() / 4),
               random.of({get(loca, 4 * random.below(loca.size() / 4), 4), 0u, 0xFFFFFFFFu,
                          static_cast<std::uint32_t>(tables["glyf"].size()) + 1}));
       }
       return source.font(tables);
     }},
    {"loca of the other format",
     [](const Source& source, Random&) {
       Tables tables = source.tables;
       set16(tables["head"], 50, 1 - get16(tables["head"], 50));
       return source.font(tables);
     }},
    {"loca too short",
     [](const Source& source, Random& random) {
       Tables tables = source.tables;
       tables["loca"].resize(random.below(tables["loca"].size()));
       return source.font(tables);
     }},
    {"a number of contours, an end point or a length of instructions lies",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       Bytes& glyph = glyphs[any_simple(glyphs, random)];
       const auto contours = static_cast<std::size_t>(get16(glyph, 0));
       set16(glyph, random.of({std::size_t{0}, 10 + 2 * random.below(contours), 10 + 2 * contours}),
             random.of({0, 1, 0x7FFF, 0x8000, 0xFFFE, 0xFFFF, 1000}));
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"flags that repeat beyond the end",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       Bytes& glyph = glyphs[any_simple(glyphs, random)];
       for (std::size_t at = 14 + random.below(8); at < glyph.size(); ++at) {
         glyph[at] = static_cast<unsigned char>(at % 2 == 0 ? random.of({0x09, 0x39, 0x3F}) : 0xFF);
       }
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"a glyph ends early",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       Bytes& glyph = glyphs[any_simple(glyphs, random)];
       glyph.resize(random.below(glyph.size()));
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"composites in a cycle",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const std::size_t length = random.of({std::size_t{1}, std::size_t{2}, glyphs.size()});
       for (std::size_t k = 0; k < length; ++k) glyphs[k] = composite({{static_cast<int>((k + 1) % length), 1, 2}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"a composite of what is not there",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const int count = static_cast<int>(glyphs.size());
       glyphs[0] = composite({{1}, {random.of({count, 0xFFFF, count - 1}), 0, 0, random.below(2) == 0}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"a composite without end",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       glyphs[random.below(glyphs.size())] = composite({{1, 0, 0, true, 0x20}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"matched points that lie",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const int part = static_cast<int>(any_simple(glyphs, random));
       glyphs[part == 0 ? 1 : 0] =
           composite({{part}, {part, random.of({0, 3, 5000, 0xFFFF}), random.of({0, 3, 5000, 0xFFFF}), false}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"extreme matrices",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const int part = static_cast<int>(any_simple(glyphs, random));
       const auto entry = [&] { return random.of({-2.0, 0.0, 1.9999, 1.0}); };
       glyphs[part == 0 ? 1 : 0] =
           composite({{part, 0x7FFF, 0x8000, true, random.of({0, 0x800}), {entry(), entry(), entry(), entry()}}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"extreme coordinates",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const int far = random.of({16383, 16384, 32767});
       const int low = random.of({0, -far, -far - 1});
       glyphs[any_simple(glyphs, random)] =
           simple_glyph({{{low, low}, {far, low}, {far, far, random.below(2) == 0}, {low, far}}});
       return source.font(with_glyphs(source.tables, glyphs));
     }},
    {"contours that enclose nothing",
     [](const Source& source, Random& random) {
       std::vector<Bytes> glyphs = glyphs_of(source.tables);
       const std::vector<Contours> all{{{{10, 10}}},
                                       {{{10, 10, false}}},
                                       {std::vector<Point>(50, {10, 10})},
                                       {{{0, 0, false}, {50, 100, false}, {100, 0, false}}},
                                       {{{0, 0}, {100, 0}}},
                                       {{{0, 0}, {500, 0}, {250, 0}, {700, 0}}},
                                       Contours(200, {{0, 0}, {100, 0}, {100, 100}, {0, 100}}),
                                       {{{0, 0}, {900, 900}, {900, 0}, {0, 900}}}};
       glyphs[any_simple(glyphs, random)] = simple_glyph(all[random.below(all.size())]);
       return source.font(with_glyphs(source.tables, glyphs));
     }},
};

std::vector<Source> sources(const std::vector<std::string>& paths) {
  std::vector<Source> all;
  for (const std::string& path : paths) all.emplace_back(path, subset_of(path, U"o\u00D3"));
  return all;
}

/// Every mutation of every source, `rounds` times; variable fonts are read at a place.
void survive_all(const std::vector<Source>& all, const std::vector<Mutation>& mutations, unsigned rounds,
                 const glyphs::Location& location = {}) {
  std::map<Survived, int> counts;
  for (const Source& source : all) {
    REQUIRE(survive(source.file, location) != Survived::Refused);
    for (const Mutation& mutation : mutations) {
      for (unsigned seed = 1; seed <= rounds; ++seed) {
        Random random(seed);
        const Bytes bad = mutation.make(source, random);
        INFO(source.name << ": " << mutation.name << ", seed " << seed);
        ++counts[survive(bad, location)];
      }
    }
  }
  // The mutations reach what they are for: behind the directory, and up to the writer.
  CHECK(counts[Survived::Refused] > 0);
  CHECK(counts[Survived::Read] + counts[Survived::Restyled] > 0);
}

}  // namespace

TEST_CASE("a TrueType font with lies in any table is refused in a line, or restyled to a font", "[bad]") {
  const std::vector<Source> all = sources({bundled_ttf[0], bundled_ttf[3]});
  survive_all(all, of_bytes, 2);
  survive_all(all, of_glyf, 2);
}

TEST_CASE("many TrueType fonts with lies in any table are refused in a line, or restyled to a font", "[bad][slow]") {
  const std::vector<Source> all = sources(bundled_ttf);
  survive_all(all, of_bytes, 6);
  survive_all(all, of_glyf, 6);
}

TEST_CASE("a CFF font with lies in any table is refused in a line, or read", "[bad]") {
  survive_all(sources({bundled_otf[0], bundled_otf[2]}), of_bytes, 2);
}

TEST_CASE("many CFF fonts with lies in any table are refused in a line, or read", "[bad][slow]") {
  survive_all(sources(bundled_otf), of_bytes, 12);
}

TEST_CASE("a variable CFF2 font with lies in any table is refused in a line, or read at a place", "[bad]") {
  const std::vector<Source> all{{"CFF2", variable_bytes::otto(variable_bytes::cff2_tables())}};
  survive_all(all, of_bytes, 12, {{"wght", 650}, {"wdth", 80}});
}

TEST_CASE("many variable fonts with lies in any table are refused in a line, or read at a place", "[bad][slow]") {
  const std::vector<Source> all{{"CFF2", variable_bytes::otto(variable_bytes::cff2_tables())},
                                {"gvar", font_of(variable_bytes::variable_tables())}};
  survive_all(all, of_bytes, 60, {{"wght", 650}});
}

// ---- what no drawn font asks for

namespace {

Bytes made(const std::vector<Bytes>& glyphs) { return font_of(with_glyphs(small_font(glyphs), glyphs)); }

const Bytes square = simple_glyph({{{0, 0}, {100, 0}, {100, 100}, {0, 100}}});

/// Where the work went: into contours one by one, and of how many more there were.
struct Looked {
  std::ptrdiff_t into = 0;
  std::ptrdiff_t left_out = 0;
};
Looked look_at(const Bytes& bytes) {
  const glyphs::Font font = glyphs::load_font_bytes("bad.ttf", bytes);
  Looked looked;
  for (const auto& facts : glyphs::inspect(font, glyphs::select_glyphs(font, ""))) {
    looked.into += std::ssize(facts.contours);
    looked.left_out += facts.left_out;
  }
  return looked;
}

}  // namespace

TEST_CASE("composites that multiply level by level cost no more than a few rich glyphs", "[bad]") {
  for (const std::size_t fold : {2u, 10u}) {
    std::vector<Bytes> glyphs{square};
    for (int level = 0; level < 20; ++level) glyphs.push_back(composite(std::vector<Part>(fold, {level, 1, 1})));
    const Bytes font = made(glyphs);
    survive(font);
    const Looked looked = look_at(font);
    CHECK(looked.into < 4000);
    CHECK(looked.left_out > 8000);
  }
}

TEST_CASE("many composites of one giant are refused when they come to more than a font is made of", "[bad]") {
  const Bytes giant = simple_glyph(Contours(4000, {{0, 0}, {100, 0}, {100, 100}, {0, 100}}));
  std::vector<Bytes> glyphs{giant};
  for (int user = 0; user < 600; ++user) glyphs.push_back(composite({{0, user, 0}}));
  const Bytes bytes = made(glyphs);
  const glyphs::Font font = glyphs::load_font_bytes("bad.ttf", bytes);
  const auto in_trouble = std::count_if(font.glyphs.begin(), font.glyphs.end(),
                                        [](const glyphs::Glyph& glyph) { return !glyph.trouble.empty(); });
  CHECK(in_trouble > 0);
  CHECK(in_trouble < 200);
  CHECK(font.glyphs[1].trouble.empty());
  CHECK(look_at(bytes).into < 16 * 600 + 2048);
}

TEST_CASE("points that take no bytes are read as far as the bytes explain them", "[bad]") {
  Bytes dots;  // one contour of 32,000 points in one place, 250 bytes
  for (const int value : {1, 0, 0, 0, 0, 31'999, 0}) put16(dots, value);
  for (int run = 0; run < 125; ++run) dots.insert(dots.end(), {1 | 8 | 16 | 32, 255});
  const Bytes bytes = made(std::vector<Bytes>(2000, dots));
  const glyphs::Font font = glyphs::load_font_bytes("bad.ttf", bytes);
  std::ptrdiff_t points = 0;
  for (const glyphs::Glyph& glyph : font.glyphs) {
    for (const auto& contour : glyph.contours) points += contour.point_count();
  }
  CHECK(points > 1'000'000);
  CHECK(points <= 4 * std::ssize(bytes) + glyphs::max_composed_points);
  CHECK(font.glyphs[0].trouble.empty());
  CHECK_FALSE(font.glyphs[1999].trouble.empty());
}

TEST_CASE("components nest 32 deep and no deeper", "[bad]") {
  std::vector<Bytes> glyphs{square};
  for (int level = 0; level < 100; ++level) glyphs.push_back(composite({{level, 1, 1}}));
  const Bytes bytes = made(glyphs);
  const glyphs::Font font = glyphs::load_font_bytes("bad.ttf", bytes);
  CHECK(font.glyphs[32].trouble.empty());
  CHECK_FALSE(font.glyphs[33].trouble.empty());
  CHECK(survive(bytes) == Survived::Restyled);
}

TEST_CASE("points matched far along thousands of parts are counted off within the budget", "[bad]") {
  const Bytes many = simple_glyph({std::vector<Point>(32000, {1, 2}), {{0, 0}, {100, 0}, {100, 100}}});
  std::vector<Part> parts{{0}};
  for (int part = 0; part < 8000; ++part) parts.push_back({1, 31999, 3, false});
  survive(made({many, square, composite(parts)}));
}

TEST_CASE("giant glyphs are read, and take no longer than the bytes explain", "[bad]") {
  Random random(1);
  const auto any = [&] { return static_cast<int>(random.below(2000)); };
  std::vector<Point> scribble(32000);
  for (Point& point : scribble) point = {any(), any(), random.below(2) == 0};
  std::vector<Point> lines(32000);
  for (std::size_t k = 0; k < lines.size(); ++k) lines[k] = {static_cast<int>(k) % 2000, static_cast<int>(k / 16)};
  Contours triangles(4000);
  for (auto& triangle : triangles) triangle = {{any(), any()}, {any(), any()}, {any(), any()}};
  for (const Contours& giant : {Contours{scribble}, Contours{lines}, triangles}) {
    survive(made({square, simple_glyph(giant)}));
  }
}

// ---- CFF

namespace {

Bytes index_of(const std::vector<Bytes>& items) {
  Bytes bytes;
  put16(bytes, static_cast<int>(items.size()));
  if (items.empty()) return bytes;
  put(bytes, 4, 1);
  std::uint32_t offset = 1;
  put(bytes, offset, 4);
  for (const Bytes& item : items) put(bytes, offset += static_cast<std::uint32_t>(item.size()), 4);
  for (const Bytes& item : items) bytes.insert(bytes.end(), item.begin(), item.end());
  return bytes;
}

Bytes number(int value) {
  Bytes bytes{29};
  put(bytes, static_cast<std::uint32_t>(value), 4);
  return bytes;
}

/// A font of charstrings, as given: nothing in them is checked.
Bytes cff_font(const std::vector<Bytes>& charstrings, const std::vector<Bytes>& subroutines = {},
               int charstrings_at = -1, const Bytes& more_top = {}) {
  const auto top = [&](int at) {
    Bytes dict = number(at);
    dict.push_back(17);
    dict.insert(dict.end(), more_top.begin(), more_top.end());
    return dict;
  };
  Bytes cff{1, 0, 4, 4};
  const auto add = [&](const Bytes& bytes) { cff.insert(cff.end(), bytes.begin(), bytes.end()); };
  add(index_of({{'m', 'a', 'd', 'e'}}));
  const std::size_t fixed = cff.size() + index_of({top(0)}).size() + index_of({}).size() + index_of(subroutines).size();
  add(index_of({top(charstrings_at < 0 ? static_cast<int>(fixed) : charstrings_at)}));
  add(index_of({}));
  add(index_of(subroutines));
  add(index_of(charstrings));

  Tables tables = small_font(std::vector<Bytes>(charstrings.size()));
  tables.erase("glyf");
  tables.erase("loca");
  tables["maxp"].resize(6);
  set32(tables["maxp"], 0, 0x5000);
  tables["CFF "] = cff;
  Bytes font = font_of(tables);
  std::copy_n("OTTO", 4, font.begin());
  return font;
}

Bytes repeated(const Bytes& bytes, std::size_t times) {
  Bytes all;
  for (std::size_t k = 0; k < times; ++k) all.insert(all.end(), bytes.begin(), bytes.end());
  return all;
}
Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

constexpr unsigned char zero = 139;  // a charstring's number 0; 140 is 1
constexpr unsigned char rmoveto = 21, rlineto = 5, rrcurveto = 8, callgsubr = 29, callsubr = 10, ret = 11, endchar = 14;
const Bytes drawn{zero, zero, rmoveto, 239, zero, rlineto, zero, 239, rlineto, 39, zero, rlineto, endchar};

}  // namespace

TEST_CASE("a charstring that is no program leaves its glyph without outline, and the font good", "[bad][cff]") {
  REQUIRE(survive(cff_font({{endchar}, drawn})) != Survived::Refused);
  const Bytes far{28, 0x7F, 0xFF, 28, 0x7F, 0xFF};
  const std::vector<Bytes> programs{
      {},
      {zero},
      {28},
      {12},
      {255, 0},
      {19},
      repeated({zero}, 49) + Bytes{rlineto, endchar},
      repeated({zero}, 514) + Bytes{rlineto, endchar},
      repeated({zero}, 100'000) + Bytes{rlineto, endchar},
      repeated({rlineto}, 60) + Bytes{endchar},
      repeated({callsubr}, 60) + Bytes{endchar},
      repeated({rrcurveto}, 2) + Bytes{endchar},
      {28, 0x7F, 0xFF, callgsubr, endchar},
      {28, 0x80, 0, callsubr, endchar},
      {zero, zero, zero, zero, endchar},  // seac of what is not there
      {zero, zero, 204, 205, endchar},    // and of what is
      far + Bytes{rmoveto} + repeated(far + Bytes{rlineto}, 200) + Bytes{endchar},
      Bytes{zero, zero, rmoveto} + repeated({140, 140, rlineto}, 20'000) + Bytes{endchar},
      Bytes{zero, zero, rmoveto} + repeated({140, zero, 12, 12, rlineto}, 20) + Bytes{endchar},  // division by zero
      repeated({zero, zero, rmoveto}, 30'000) + Bytes{endchar},
  };
  for (const Bytes& program : programs) {
    CAPTURE(program.size());
    CHECK(survive(cff_font({{endchar}, program, drawn})) != Survived::Refused);
  }
}

TEST_CASE("subroutines that call each other end", "[bad][cff]") {
  const auto call = [](int number) { return Bytes{static_cast<unsigned char>(number + 32), callgsubr}; };  // bias 107
  std::vector<Bytes> bomb;
  for (int level = 1; level <= 12; ++level) bomb.push_back(repeated(call(level), 10) + Bytes{ret});
  bomb.push_back({zero, zero, rlineto, ret});
  const Bytes start = Bytes{zero, zero, rmoveto} + call(0) + Bytes{endchar};
  for (const std::vector<Bytes>& subroutines :
       {std::vector<Bytes>{call(0) + Bytes{ret}}, {call(1) + Bytes{ret}, call(0) + Bytes{ret}}, bomb}) {
    survive(cff_font({{endchar}, start, drawn}, subroutines));
  }
}

TEST_CASE("many charstrings that never end cost no more than a few", "[bad][cff][slow]") {
  std::vector<Bytes> bomb;
  for (int level = 1; level <= 9; ++level) {
    bomb.push_back(repeated({static_cast<unsigned char>(level + 32), callgsubr}, 10) + Bytes{ret});
  }
  bomb.push_back({zero, zero, rlineto, ret});
  std::vector<Bytes> charstrings(200, Bytes{zero, zero, rmoveto, 32, callgsubr, endchar});
  charstrings[0] = {endchar};
  CHECK(survive(cff_font(charstrings, bomb)) == Survived::Restyled);
}

TEST_CASE("lies in an INDEX or a DICT of CFF are refused in a line, or harm nothing", "[bad][cff]") {
  const Bytes good = cff_font({{endchar}, drawn, drawn});
  for (const int at : {0, 3, 4, 0x7FFFFFFF, 10'000}) survive(cff_font({{endchar}, drawn}, {}, at));
  for (const Bytes& dict :
       {number(0x7FFFFFFF) + number(0) + Bytes{18}, number(100) + number(0x7FFFFFF0) + Bytes{18},
        number(-1) + Bytes{15}, number(0x7FFFFFFF) + Bytes{16}, Bytes{12}, Bytes{30, 0xDD, 0xDD}, Bytes{12, 36},
        number(5) + Bytes{12, 36} + number(6) + Bytes{12, 37}, repeated(number(1), 60),
        number(1) + number(0) + number(0) + Bytes{12, 30}, number(1) + Bytes{12, 6}}) {
    survive(cff_font({{endchar}, drawn}, {}, -1, dict));
  }
  Tables tables = tables_of(good);
  const Bytes cff = tables["CFF "];
  for (std::size_t at = 0; at < cff.size(); ++at) {
    for (const int value : {0, 5, 0x7F, 0xFF}) {
      INFO("byte " << at << " is " << value);
      tables["CFF "] = cff;
      tables["CFF "][at] = static_cast<unsigned char>(value);
      Bytes font = font_of(tables);
      std::copy_n("OTTO", 4, font.begin());
      survive(font);
    }
  }
}
