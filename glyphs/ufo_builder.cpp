#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <set>
#include <tuple>

#include "glyphs/error.h"
#include "glyphs/glif.h"
#include "glyphs/sfnt_tables.h"
#include "glyphs/ufo.h"
#include "glyphs/xml.h"

namespace glyphs {

namespace {

using fontcore::BezierContour;
using fontcore::Point;
using fontcore::PointKind;
using fontcore::text;
using sfnt::Malformed;
using sfnt::tag;
using sfnt::View;

Bytes to_bytes(const std::string& content) { return {content.begin(), content.end()}; }

// ---- property lists as text, each value on lines of its own

/// Line ends as references, so that they are no line ends of the text.
std::string string_value(const std::string& plain) {
  std::string out = "<string>";
  for (const char c : xml::encode(plain)) {
    if (c == '\n') {
      out += "&#10;";
    } else {
      out += c;
    }
  }
  return out + "</string>";
}
std::string integer_value(std::int64_t number) { return text("<integer>", number, "</integer>"); }
std::string number_value(double number) {
  const char* kind = number == std::trunc(number) ? "integer" : "real";
  return text("<", kind, ">", xml::number_text(number), "</", kind, ">");
}
std::string bool_value(bool value) { return value ? "<true/>" : "<false/>"; }

std::string indented(const std::string& lines) {
  std::string out = "  ";
  for (const char c : lines) {
    out += c;
    if (c == '\n') out += "  ";
  }
  return out;
}
std::string array_value(const std::vector<std::string>& items) {
  std::string out = "<array>\n";
  for (const std::string& item : items) out += indented(item) + "\n";
  return out + "</array>";
}
/// Keys to values that are text already.
using Dictionary = std::map<std::string, std::string>;
std::string dictionary_value(const Dictionary& dictionary) {
  std::string out = "<dict>\n";
  for (const auto& [key, value] : dictionary) {
    out += "  <key>" + xml::encode(key) + "</key>\n";
    out += indented(value) + "\n";
  }
  return out + "</dict>";
}
Bytes property_list(const std::string& value) {
  return to_bytes(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<!DOCTYPE plist PUBLIC \"-//Apple//DTD PLIST 1.0//EN\" \"http://www.apple.com/DTDs/PropertyList-1.0.dtd\">\n"
      "<plist version=\"1.0\">\n" +
      value + "\n</plist>\n");
}

/// The numbers of the bits that are set and that a UFO may list.
std::string bits_value(View bytes, std::uint64_t at, int words, const std::set<int>& allowed) {
  std::vector<std::string> bits;
  const int word_bits = words > 1 ? 32 : 16;
  for (int bit = 0; bit < words * word_bits; ++bit) {
    const std::uint64_t word = at + 4 * static_cast<std::uint64_t>(bit / word_bits);
    const std::uint32_t value = words > 1 ? sfnt::u32(bytes, word) : sfnt::u16(bytes, at);
    if ((value >> (bit % word_bits) & 1) != 0 && (allowed.empty() || allowed.count(bit) > 0)) {
      bits.push_back(integer_value(bit));
    }
  }
  return array_value(bits);
}

/// A 16.16 number with as few decimals as still round to it.
double fixed(std::uint32_t raw) {
  constexpr double one = 65536.0;
  const double exact = static_cast<std::int32_t>(raw) / one;
  constexpr int most_decimals = 5;
  double scale = 1.0;
  for (int decimals = 0; decimals < most_decimals; ++decimals, scale *= 10.0) {
    const double rounded = std::round(exact * scale) / scale;
    if (std::round(rounded * one) == static_cast<std::int32_t>(raw)) return rounded;
  }
  return exact;
}

// ---- file names

/// The name of a glyph's file by the convention of UFO 3: capitals marked, so that no two differ in case alone, and
/// what some file system does not allow replaced.
class FileNames {
 public:
  std::string take(const std::string& glyph) {
    constexpr std::size_t longest = 255;
    const std::string ending = ".glif";
    std::string name;
    for (const char c : glyph) {
      const bool is_allowed = c >= ' ' && c != 0x7F && std::string_view("\"*+/:<>?[\\]|").find(c) == std::string::npos;
      name += is_allowed ? c : '_';
      if (c >= 'A' && c <= 'Z') name += '_';
    }
    if (name.starts_with('.')) name[0] = '_';
    if (name.size() > longest - ending.size()) name.resize(longest - ending.size());
    name = without_devices(name);
    if (name.size() > longest - ending.size()) name.resize(longest - ending.size());
    std::string file = name + ending;
    constexpr std::size_t digits = 15;
    for (std::uint64_t number = 1; !taken_.insert(lower(file)).second; ++number) {
      char buffer[digits + 1];
      std::snprintf(buffer, sizeof buffer, "%015llu", static_cast<unsigned long long>(number));
      file = name.substr(0, longest - ending.size() - digits) + buffer + ending;
    }
    return file;
  }

 private:
  static std::string lower(std::string name) {
    for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    return name;
  }

  /// Names that stand for devices on some systems are no part between full stops.
  static std::string without_devices(const std::string& name) {
    static const std::set<std::string> devices{"con",  "prn",  "aux",  "clock$", "nul",  "com1", "com2", "com3",
                                               "com4", "com5", "com6", "com7",   "com8", "com9", "lpt1", "lpt2",
                                               "lpt3", "lpt4", "lpt5", "lpt6",   "lpt7", "lpt8", "lpt9"};
    std::string out;
    for (std::size_t at = 0; at <= name.size();) {
      const std::size_t end = std::min(name.find('.', at), name.size());
      const std::string part = name.substr(at, end - at);
      out += (at > 0 ? "." : "") + std::string(devices.count(lower(part)) > 0 ? "_" : "") + part;
      at = end + 1;
    }
    return out;
  }

  std::set<std::string> taken_;
};

// ---- names

/// One record of the table `name`.
struct NameRecord {
  int platform = 0;
  int encoding = 0;
  int language = 0;
  int id = 0;
  std::string value;  ///< UTF-8
};

std::string from_utf16(View bytes) {
  std::string out;
  for (std::uint64_t at = 0; at + 2 <= bytes.size(); at += 2) {
    std::uint32_t code = sfnt::u16(bytes, at);
    const bool is_high = code >= 0xD800 && code < 0xDC00;
    if (is_high && at + 4 <= bytes.size()) {
      const std::uint32_t low = sfnt::u16(bytes, at + 2);
      if (low >= 0xDC00 && low < 0xE000) {
        code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
        at += 2;
      }
    }
    xml::append_utf8(out, code >= 0xD800 && code < 0xE000 ? 0xFFFD : code);
  }
  return out;
}

// ---- the UFO

class Builder {
 public:
  explicit Builder(const Font& font) : font_(font) {}

  WrittenUfo build() {
    if (!font_.data || font_.format == OutlineFormat::Ufo) fail("only a TTF or an OTF is made a UFO");
    if (font_.glyphs.empty() || font_.units_per_em <= 0) fail("it has no glyphs or no units per em");
    for (const Glyph& glyph : font_.glyphs) names_.push_back(glyph.name);
    // Compilers know the glyph for what is missing by its name; a font without names has it by its place alone.
    if (names_[0] == "gid0" && font_.find(".notdef") < 0) names_[0] = ".notdef";
    directory_ = sfnt::read_directory(*font_.data, font_.face_index);
    build_glyphs();
    build_info();
    put("metainfo.plist",
        dictionary_value({{"creator", string_value("org.glyphwave")}, {"formatVersion", integer_value(3)}}));
    put("layercontents.plist", array_value({array_value({string_value("public.default"), string_value("glyphs")})}));
    warn();
    return std::move(result_);
  }

 private:
  [[noreturn]] void fail(const std::string& why) const { throw FontWriteError(text(font_.path, ": ", why)); }

  void put(const std::string& file, const std::string& value) { result_.folder[file] = property_list(value); }

  // -- glyphs

  const std::string& name_of(int glyph) const { return names_[static_cast<std::size_t>(glyph)]; }

  void build_glyphs() {
    std::vector<std::vector<char32_t>> codes(font_.glyphs.size());
    for (const auto& [code, glyph] : font_.character_map) codes.at(static_cast<std::size_t>(glyph)).push_back(code);
    FileNames names;
    Dictionary contents;
    std::vector<std::string> order;
    for (const Glyph& glyph : font_.glyphs) {
      const std::string& name = name_of(glyph.id);
      const std::string file = names.take(name);
      contents[name] = string_value(file);
      order.push_back(string_value(name));
      result_.folder["glyphs/" + file] = to_bytes(glif(glyph, codes[static_cast<std::size_t>(glyph.id)]));
      if (!glyph.trouble.empty()) {
        result_.warnings.push_back(text(glyph.name, ": comes out empty, since it cannot be read: ", glyph.trouble));
      }
    }
    put("glyphs/contents.plist", dictionary_value(contents));
    Dictionary lib{{"public.glyphOrder", array_value(order)}};
    // Compilers look here before they take cubics for granted.
    if (font_.format == OutlineFormat::TrueType) {
      lib["com.github.googlei18n.cu2qu.curve_type"] = string_value("quadratic");
    }
    put("lib.plist", dictionary_value(lib));
  }

  std::string glif(const Glyph& glyph, const std::vector<char32_t>& codes) {
    std::string out = text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<glyph name=\"", xml::encode(name_of(glyph.id)),
                           "\" format=\"2\">\n");
    if (glyph.advance != 0.0) out += text("  <advance width=\"", xml::number_text(glyph.advance), "\"/>\n");
    for (const char32_t code : codes) {
      char hex[16];
      std::snprintf(hex, sizeof hex, "%04X", static_cast<unsigned>(code));
      out += text("  <unicode hex=\"", hex, "\"/>\n");
    }
    if (glyph.contours.empty() && glyph.components.empty()) return out + "</glyph>\n";
    out += "  <outline>\n";
    for (const BezierContour& contour : glyph.contours) {
      const BezierContour placed = transform(contour, {.shift = Point(-glyph.origin, 0.0)});
      out += "    <contour>\n";
      for (int i = 0; i < placed.point_count(); ++i) {
        if (placed.kind(i) != PointKind::ImpliedNode) out += "      " + point_element(placed, i) + "\n";
      }
      out += "    </contour>\n";
    }
    const std::vector<Point> shifts = shifts_of(glyph);
    for (std::size_t i = 0; i < glyph.components.size(); ++i) out += component(glyph.components[i], shifts[i]);
    return out + "  </outline>\n</glyph>\n";
  }

  std::string component(const Component& part, const Point& shift) const {
    std::string out = text("    <component base=\"", xml::encode(name_of(part.glyph)), "\"");
    const auto put_number = [&](const char* key, double value, double usual) {
      if (value != usual) out += text(" ", key, "=\"", xml::number_text(value), "\"");
    };
    const Eigen::Matrix2d& linear = part.placement.linear;
    put_number("xScale", linear(0, 0), 1.0);
    put_number("xyScale", linear(1, 0), 0.0);
    put_number("yxScale", linear(0, 1), 0.0);
    put_number("yScale", linear(1, 1), 1.0);
    put_number("xOffset", shift.x(), 0.0);
    put_number("yOffset", shift.y(), 0.0);
    return out + "/>\n";
  }

  /// The offsets of a glyph's components between outlines that are at their origins, matched points resolved.
  std::vector<Point> shifts_of(const Glyph& glyph) const {
    std::vector<Point> shifts;
    const auto& parts = glyph.components;
    const bool has_matched =
        std::any_of(parts.begin(), parts.end(), [](const Component& p) { return p.matched_parent >= 0; });
    // The parts of the composed outline stand in their order.
    const std::vector<BezierContour> composed = has_matched ? compose(font_, glyph.id) : std::vector<BezierContour>();
    std::size_t first = 0;
    for (const Component& part : parts) {
      const double origin = font_.glyphs[static_cast<std::size_t>(part.glyph)].origin;
      Point shift = part.placement.shift + part.placement.linear * Point(origin, 0.0) - Point(glyph.origin, 0.0);
      if (has_matched) {
        const std::vector<BezierContour> own = compose(font_, part.glyph);
        if (part.matched_parent >= 0 && !own.empty()) {
          constexpr double whole = 1024.0;  // of a unit: what composing rounds is far smaller
          shift = composed.at(first).point(0) - part.placement.linear * own.front().point(0);
          shift = (shift * whole).array().round().matrix() / whole;
        }
        first += own.size();
      }
      shifts.push_back(shift);
    }
    return shifts;
  }

  // -- font info

  void build_info() {
    info_["unitsPerEm"] = integer_value(font_.units_per_em);
    info_["ascender"] = number_value(font_.ascender);
    info_["descender"] = number_value(font_.descender);
    from_table("head", 54, [&](View head) { read_head(head); });
    from_table("hhea", 36, [&](View hhea) { read_heights(hhea, "openTypeHhea", ""); });
    from_table("vhea", 36, [&](View vhea) { read_heights(vhea, "openTypeVhea", "VertTypo"); });
    from_table("post", 32, [&](View post) { read_post(post); });
    from_table("OS/2", 78, [&](View os2) { read_os2(os2); });
    from_table("gasp", 4, [&](View gasp) { read_gasp(gasp); });
    from_table("name", 6, [&](View name) { read_names(name); });
    put("fontinfo.plist", dictionary_value(info_));
  }

  /// What a table says, if it is there; one that is too short is named and left out.
  template <typename Read>
  void from_table(const char (&name)[5], std::uint64_t least, Read read) {
    const sfnt::TableRecord* table = directory_.find(tag(name));
    if (table == nullptr) return;
    try {
      read(sfnt::slice(table->bytes, 0, std::max<std::uint64_t>(least, table->bytes.size())));
    } catch (const Malformed& error) {
      result_.warnings.push_back(text(name, ": not in the font info, or not all of it: ", error.what()));
    }
  }

  void set_signed(const std::string& key, View bytes, std::uint64_t at) {
    info_[key] = integer_value(sfnt::i16(bytes, at));
  }
  void set_unsigned(const std::string& key, View bytes, std::uint64_t at) {
    info_[key] = integer_value(sfnt::u16(bytes, at));
  }

  void read_head(View head) {
    // The revision is meant as a decimal number of three places.
    const std::uint32_t revision = sfnt::u32(head, 4);
    const auto thousandths = static_cast<std::int64_t>(std::llround(revision / 65536.0 * 1000.0));
    info_["versionMajor"] = integer_value(thousandths / 1000);
    info_["versionMinor"] = integer_value(thousandths % 1000);
    std::set<int> flags;
    for (int bit = 0; bit < 15; ++bit) flags.insert(bit);
    info_["openTypeHeadFlags"] = bits_value(head, 16, 1, flags);
    set_unsigned("openTypeHeadLowestRecPPEM", head, 46);
    const std::uint64_t created = std::uint64_t{sfnt::u32(head, 20)} << 32 | sfnt::u32(head, 24);
    using namespace std::chrono;
    constexpr std::uint64_t longest = 400ull * 366 * 86400;
    if (created == 0 || created > longest) return;
    const sys_seconds moment = sys_days(year{1904} / 1 / 1) + seconds(static_cast<std::int64_t>(created));
    const auto day = floor<days>(moment);
    const year_month_day date(day);
    const hh_mm_ss time(moment - day);
    char buffer[64];
    std::snprintf(buffer, sizeof buffer, "%04d/%02u/%02u %02d:%02d:%02d", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  static_cast<int>(time.hours().count()), static_cast<int>(time.minutes().count()),
                  static_cast<int>(time.seconds().count()));
    info_["openTypeHeadCreated"] = string_value(buffer);
  }

  /// hhea and vhea, which are laid out alike.
  void read_heights(View table, const std::string& prefix, const std::string& infix) {
    set_signed(prefix + infix + "Ascender", table, 4);
    set_signed(prefix + infix + "Descender", table, 6);
    set_signed(prefix + infix + "LineGap", table, 8);
    set_signed(prefix + "CaretSlopeRise", table, 18);
    set_signed(prefix + "CaretSlopeRun", table, 20);
    set_signed(prefix + "CaretOffset", table, 22);
  }

  void read_post(View post) {
    info_["italicAngle"] = number_value(fixed(sfnt::u32(post, 4)));
    set_signed("postscriptUnderlinePosition", post, 8);
    set_signed("postscriptUnderlineThickness", post, 10);
    info_["postscriptIsFixedPitch"] = bool_value(sfnt::u32(post, 12) != 0);
  }

  void read_os2(View os2) {
    const int version = sfnt::u16(os2, 0);
    const int weight = sfnt::u16(os2, 4);
    const int width = sfnt::u16(os2, 6);
    if (weight <= 1000) info_["openTypeOS2WeightClass"] = integer_value(weight);
    if (width >= 1 && width <= 9) info_["openTypeOS2WidthClass"] = integer_value(width);
    info_["openTypeOS2Type"] = bits_value(os2, 8, 1, {0, 1, 2, 3, 8, 9});
    constexpr std::array<const char*, 10> sizes{
        "SubscriptXSize",   "SubscriptYSize",     "SubscriptXOffset",   "SubscriptYOffset", "SuperscriptXSize",
        "SuperscriptYSize", "SuperscriptXOffset", "SuperscriptYOffset", "StrikeoutSize",    "StrikeoutPosition"};
    for (std::size_t i = 0; i < sizes.size(); ++i) set_signed(text("openTypeOS2", sizes[i]), os2, 10 + 2 * i);
    const int family = sfnt::u16(os2, 30);
    if (family >> 8 <= 14 && (family & 0xFF) <= 15) {
      info_["openTypeOS2FamilyClass"] = array_value({integer_value(family >> 8), integer_value(family & 0xFF)});
    }
    std::vector<std::string> panose;
    for (std::uint64_t i = 0; i < 10; ++i) panose.push_back(integer_value(sfnt::u8(os2, 32 + i)));
    info_["openTypeOS2Panose"] = array_value(panose);
    std::set<int> ranges;
    for (int bit = 0; bit < 128; ++bit) ranges.insert(bit);
    info_["openTypeOS2UnicodeRanges"] = bits_value(os2, 42, 4, ranges);
    std::string vendor;
    for (std::uint64_t i = 0; i < 4; ++i) {
      const auto c = static_cast<char>(sfnt::u8(os2, 58 + i));
      if (c >= ' ' && c <= '~') vendor += c;
    }
    info_["openTypeOS2VendorID"] = string_value(vendor);
    const unsigned selection = sfnt::u16(os2, 62);
    info_["openTypeOS2Selection"] = bits_value(os2, 62, 1, {1, 2, 3, 4, 7, 8, 9});
    const bool is_italic = (selection & 1u) != 0;
    const bool is_bold = (selection & 0x20u) != 0;
    info_["styleMapStyleName"] = string_value(is_bold     ? (is_italic ? "bold italic" : "bold")
                                              : is_italic ? "italic"
                                                          : "regular");
    set_signed("openTypeOS2TypoAscender", os2, 68);
    set_signed("openTypeOS2TypoDescender", os2, 70);
    set_signed("openTypeOS2TypoLineGap", os2, 72);
    set_unsigned("openTypeOS2WinAscent", os2, 74);
    set_unsigned("openTypeOS2WinDescent", os2, 76);
    if (version >= 1) info_["openTypeOS2CodePageRanges"] = bits_value(os2, 78, 2, {});
    if (version < 2) return;
    set_signed("xHeight", os2, 86);
    set_signed("capHeight", os2, 88);
  }

  void read_gasp(View gasp) {
    std::vector<std::string> records;
    int last = -1;
    const std::uint64_t count = sfnt::u16(gasp, 2);
    for (std::uint64_t i = 0; i < count; ++i) {
      const int size = sfnt::u16(gasp, 4 + 4 * i);
      if (size <= last) return;  // not in order, which a UFO requires
      last = size;
      records.push_back(dictionary_value({{"rangeMaxPPEM", integer_value(size)},
                                          {"rangeGaspBehavior", bits_value(gasp, 6 + 4 * i, 1, {0, 1, 2, 3})}}));
    }
    if (!records.empty()) info_["openTypeGaspRangeRecords"] = array_value(records);
  }

  /// English names have keys of their own; all others are records.
  void read_names(View table) {
    constexpr int windows = 3;
    constexpr int english = 0x409;
    std::vector<NameRecord> records;
    std::vector<std::string> lost;
    const std::uint64_t count = sfnt::u16(table, 2);
    const std::uint64_t strings = sfnt::u16(table, 4);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t at = 6 + 12 * i;
      NameRecord record{sfnt::u16(table, at), sfnt::u16(table, at + 2), sfnt::u16(table, at + 4),
                        sfnt::u16(table, at + 6), ""};
      const View raw = sfnt::slice(table, strings + sfnt::u16(table, at + 10), sfnt::u16(table, at + 8));
      const bool is_ascii = std::all_of(raw.begin(), raw.end(), [](unsigned char c) { return c < 0x80; });
      if (record.platform == 0 || (record.platform == windows && record.encoding <= 10)) {
        record.value = from_utf16(raw);
      } else if (record.platform == 1 && record.encoding == 0 && is_ascii) {
        record.value.assign(raw.begin(), raw.end());
      } else {
        lost.push_back(text(record.platform, "/", record.encoding, "/", record.language, "/", record.id));
        continue;
      }
      records.push_back(std::move(record));
    }
    std::map<int, std::string> own;  // by id
    for (const NameRecord& record : records) {
      if (record.platform == windows && record.language == english) own.emplace(record.id, record.value);
    }
    for (const NameRecord& record : records) {  // a font of Macintosh names alone
      if (record.platform == 1 && record.language == 0) own.emplace(record.id, record.value);
    }
    const auto name = [&](int id) {
      const auto found = own.find(id);
      return found == own.end() ? std::string() : found->second;
    };
    const auto set = [&](const char* key, const std::string& value) {
      if (!value.empty()) info_[key] = string_value(value);
    };
    set("familyName", own.count(16) > 0 ? name(16) : name(1));
    set("styleName", own.count(17) > 0 ? name(17) : name(2));
    set("styleMapFamilyName", name(1));
    constexpr std::array<std::pair<int, const char*>, 19> keys{{{0, "copyright"},
                                                                {3, "openTypeNameUniqueID"},
                                                                {4, "postscriptFullName"},
                                                                {5, "openTypeNameVersion"},
                                                                {6, "postscriptFontName"},
                                                                {7, "trademark"},
                                                                {8, "openTypeNameManufacturer"},
                                                                {9, "openTypeNameDesigner"},
                                                                {10, "openTypeNameDescription"},
                                                                {11, "openTypeNameManufacturerURL"},
                                                                {12, "openTypeNameDesignerURL"},
                                                                {13, "openTypeNameLicense"},
                                                                {14, "openTypeNameLicenseURL"},
                                                                {16, "openTypeNamePreferredFamilyName"},
                                                                {17, "openTypeNamePreferredSubfamilyName"},
                                                                {18, "openTypeNameCompatibleFullName"},
                                                                {19, "openTypeNameSampleText"},
                                                                {21, "openTypeNameWWSFamilyName"},
                                                                {22, "openTypeNameWWSSubfamilyName"}}};
    for (const auto& [id, key] : keys) set(key, name(id));
    // Compilers make the full name of others, and the style name of the style that the family is mapped by.
    std::set<int> has_key{1};
    for (const auto& [id, key] : keys) has_key.insert(id);
    has_key.erase(4);
    std::string style = name(2);
    for (char& c : style) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    const auto mapped = info_.find("styleMapStyleName");
    if (mapped != info_.end() && mapped->second == string_value(style)) has_key.insert(2);
    std::set<std::tuple<int, int, int, int>> seen;
    std::vector<std::string> others;
    for (const NameRecord& record : records) {
      // The same name again on another platform follows from the key.
      const bool is_english = (record.platform == windows && record.language == english) ||
                              (record.platform != windows && record.language == 0);
      if (is_english && has_key.count(record.id) > 0 && record.value == name(record.id)) continue;
      if (!seen.emplace(record.id, record.platform, record.encoding, record.language).second) continue;
      others.push_back(dictionary_value({{"nameID", integer_value(record.id)},
                                         {"platformID", integer_value(record.platform)},
                                         {"encodingID", integer_value(record.encoding)},
                                         {"languageID", integer_value(record.language)},
                                         {"string", string_value(record.value)}}));
    }
    if (!others.empty()) info_["openTypeNameRecords"] = array_value(others);
    if (!lost.empty()) {
      result_.warnings.push_back(text("name: ", lost.size(),
                                      " records in other encodings than UTF-16 and ASCII are left out, the first ",
                                      lost.front(), " (platform/encoding/language/id)"));
    }
  }

  void warn() {
    const std::set<sfnt::Tag> taken{tag("head"), tag("hhea"), tag("maxp"), tag("hmtx"), tag("cmap"), tag("name"),
                                    tag("OS/2"), tag("post"), tag("glyf"), tag("loca"), tag("CFF "), tag("CFF2"),
                                    tag("gasp"), tag("vhea"), tag("DSIG"), tag("hdmx"), tag("LTSH"), tag("VDMX")};
    std::set<std::string> left;
    for (const sfnt::TableRecord& table : directory_.tables) {
      if (taken.count(table.tag) == 0) left.insert(sfnt::tag_name(table.tag));
    }
    std::string list;
    for (const std::string& name : left) list += (list.empty() ? "" : ", ") + name;
    if (!list.empty()) result_.warnings.push_back(text("tables that the UFO has nothing of: ", list));
    const bool is_cff = font_.format == OutlineFormat::Cff || font_.format == OutlineFormat::Cff2;
    const bool has_hints =
        std::any_of(font_.glyphs.begin(), font_.glyphs.end(), [](const Glyph& g) { return g.has_instructions; });
    if (is_cff) result_.warnings.push_back("CFF: hints and alignment zones are left out");
    if (has_hints) result_.warnings.push_back("glyf: instructions are left out");
    if (font_.is_variable) result_.warnings.push_back("only the default of the variable font is in the UFO");
  }

  const Font& font_;
  std::vector<std::string> names_;  // by glyph id
  sfnt::Directory directory_;
  Dictionary info_;
  WrittenUfo result_;
};

}  // namespace

WrittenUfo build_ufo(const Font& font) {
  try {
    return Builder(font).build();
  } catch (const Malformed& error) {
    throw FontWriteError(text(font.path, ": ", error.what()));
  } catch (const FontReadError& error) {
    throw FontWriteError(error.what());
  }
}

}  // namespace glyphs
