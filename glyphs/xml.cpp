#include "glyphs/xml.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <new>
#include <set>

#include "fontcore/error.h"

namespace glyphs::xml {

namespace {

using fontcore::text;

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
bool begins_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == ':' || static_cast<signed char>(c) < 0;
}
bool is_in_name(char c) { return begins_name(c) || (c >= '0' && c <= '9') || c == '-' || c == '.'; }
/// A code point that XML 1.0 may hold.
bool is_character(std::uint32_t code) {
  return code == '\t' || code == '\n' || code == '\r' || (code >= 0x20 && code <= 0xD7FF) ||
         (code >= 0xE000 && code <= 0xFFFD) || (code >= 0x10000 && code <= 0x10FFFF);
}
constexpr std::uint32_t no_code = 0xFFFFFFFF;

/// The code point of what stands between & and ;.
std::uint32_t referenced(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, char>, 5> named{
      {{"amp", '&'}, {"lt", '<'}, {"gt", '>'}, {"quot", '"'}, {"apos", '\''}}};
  for (const auto& [key, character] : named) {
    if (name == key) return static_cast<unsigned char>(character);
  }
  if (!name.starts_with('#')) return no_code;
  const bool is_hex = name.starts_with("#x");
  const char* first = name.data() + (is_hex ? 2 : 1);
  std::uint32_t code = no_code;
  const auto [end, error] = std::from_chars(first, name.data() + name.size(), code, is_hex ? 16 : 10);
  return error == std::errc() && end == name.data() + name.size() && is_character(code) ? code : no_code;
}

/// The code point that starts at a byte, and how many bytes it has; no_code if it is not UTF-8 in its shortest form.
std::pair<std::uint32_t, std::size_t> code_at(std::string_view bytes, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i])); };
  const std::uint32_t lead = byte(at);
  if (lead < 0x80) return {lead, 1};
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || bytes.size() - at < length) return {no_code, 1};
  std::uint32_t code = lead & (0xFFu >> (length + 1));
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0) != 0x80) return {no_code, 1};
    code = code << 6 | (byte(at + i) & 0x3F);
  }
  constexpr std::array<std::uint32_t, 5> least{0, 0, 0x80, 0x800, 0x10000};
  return {code >= least[length] ? code : no_code, length};
}

/// One pass over a document: characters, tags, references, limits.
class Check {
 public:
  explicit Check(std::string_view bytes) : bytes_(bytes) {}

  void run() {
    if (bytes_.empty()) throw Malformed("is empty");
    if (bytes_.size() > max_size) throw Malformed(text("has more than ", max_size, " bytes"));
    check_characters();
    if (bytes_.starts_with("\xEF\xBB\xBF")) at_ = 3;
    if (rest().starts_with("<?xml")) check_declaration();
    while (at_ < bytes_.size()) {
      if (bytes_[at_] != '<') {
        check_text();
      } else if (rest().starts_with("<!--")) {
        skip_past("-->", 4);
      } else if (rest().starts_with("<?")) {
        skip_past("?>", 2);
      } else if (rest().starts_with("<![CDATA[")) {
        if (open_.empty()) fail("text outside the root element");
        skip_past("]]>", 9);
      } else if (rest().starts_with("<!")) {
        check_document_type();
      } else if (rest().starts_with("</")) {
        close_element();
      } else {
        open_element();
      }
    }
    if (!open_.empty()) fail(text("ends within <", open_.back(), ">"));
    if (!has_root_) fail("no element");
  }

 private:
  std::string_view rest() const { return bytes_.substr(at_); }
  [[noreturn]] void fail(const std::string& why) const {
    const auto line = 1 + std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(at_), '\n');
    throw Malformed(text("line ", line, ": ", why));
  }

  void check_characters() {
    if (bytes_.starts_with("\xFF\xFE") || bytes_.starts_with("\xFE\xFF") || bytes_.substr(0, 4).find('\0') < 4) {
      throw Malformed("is not in UTF-8, the only encoding that is read");
    }
    for (at_ = 0; at_ < bytes_.size();) {
      const auto [code, length] = code_at(bytes_, at_);
      if (code == no_code) fail(text("byte ", at_, " is not UTF-8"));
      if (!is_character(code)) fail(text("byte ", at_, " is a character that XML does not hold"));
      at_ += length;
    }
    at_ = 0;
  }

  void check_declaration() {
    const std::size_t start = at_;
    skip_past("?>", 2);
    const std::string_view declaration = bytes_.substr(start, at_ - start);
    std::size_t at = declaration.find("encoding");
    if (at == std::string_view::npos) return;
    at = declaration.find_first_of("'\"", at);
    const std::size_t end = at == std::string_view::npos ? at : declaration.find(declaration[at], at + 1);
    if (end == std::string_view::npos) fail("the encoding is not in quotes");
    std::string encoding(declaration.substr(at + 1, end - at - 1));
    std::transform(encoding.begin(), encoding.end(), encoding.begin(),
                   [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
    if (encoding != "UTF-8" && encoding != "UTF8" && encoding != "US-ASCII" && encoding != "ASCII") {
      fail("its encoding is not UTF-8, the only one that is read");
    }
  }

  void skip_past(std::string_view end, std::size_t opening) {
    const std::size_t found = bytes_.find(end, at_ + opening);
    if (found == std::string_view::npos) fail(text("no ", end, " follows"));
    at_ = found + end.size();
  }

  void check_text() {
    const std::size_t end = std::min(bytes_.find('<', at_), bytes_.size());
    if (open_.empty()) {
      for (; at_ < end; ++at_) {
        if (!is_space(bytes_[at_])) fail(has_root_ ? "text after the root element" : "text before the root element");
      }
    }
    check_references(end);
  }

  void check_references(std::size_t end) {
    const std::string_view before_end = bytes_.substr(0, end);
    for (at_ = before_end.find('&', at_); at_ != std::string_view::npos; at_ = before_end.find('&', at_ + 1)) {
      constexpr std::size_t longest = 12;
      const std::size_t semicolon = before_end.substr(0, at_ + longest).find(';', at_);
      if (semicolon == std::string_view::npos || referenced(bytes_.substr(at_ + 1, semicolon - at_ - 1)) == no_code) {
        fail("an entity that XML itself does not define");
      }
    }
    at_ = end;
  }

  void check_document_type() {
    if (!rest().starts_with("<!DOCTYPE") || has_root_) fail("a declaration that is not known");
    char quote = 0;
    for (; at_ < bytes_.size(); ++at_) {
      const char c = bytes_[at_];
      if (quote != 0) {
        if (c == quote) quote = 0;
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '[') {
        fail("the document type declares entities or elements, which is not read");
      } else if (c == '>') {
        ++at_;
        return;
      }
    }
    fail("the document type does not end");
  }

  std::string_view name() {
    const std::size_t start = at_;
    if (at_ == bytes_.size() || !begins_name(bytes_[at_])) fail("a name is missing");
    while (at_ < bytes_.size() && is_in_name(bytes_[at_])) ++at_;
    return bytes_.substr(start, at_ - start);
  }
  void skip_space() {
    while (at_ < bytes_.size() && is_space(bytes_[at_])) ++at_;
  }
  void require(char wanted) {
    if (at_ == bytes_.size() || bytes_[at_] != wanted) fail(text("'", wanted, "' is missing"));
    ++at_;
  }

  void close_element() {
    at_ += 2;
    const std::string_view closed = name();
    skip_space();
    require('>');
    if (open_.empty() || open_.back() != closed) fail(text("</", closed, "> closes nothing"));
    open_.pop_back();
  }

  void open_element() {
    if (open_.empty() && has_root_) fail("a second root element");
    has_root_ = true;
    ++at_;
    const std::string_view opened = name();
    count_node();
    std::vector<std::string_view> seen;
    for (;;) {
      const bool is_apart = at_ < bytes_.size() && is_space(bytes_[at_]);
      skip_space();
      if (at_ < bytes_.size() && bytes_[at_] == '>') {
        ++at_;
        if (open_.size() == max_depth) fail(text("elements nest deeper than ", max_depth));
        return open_.push_back(opened);
      }
      if (rest().starts_with("/>")) {
        at_ += 2;
        return;
      }
      if (!is_apart) fail(text("<", opened, "> does not end"));
      const std::string_view attribute = name();
      constexpr std::size_t most_attributes = 64;
      if (std::find(seen.begin(), seen.end(), attribute) != seen.end()) fail(text(attribute, " stands twice"));
      if (seen.size() == most_attributes) fail(text("more than ", most_attributes, " attributes"));
      seen.push_back(attribute);
      count_node();
      skip_space();
      require('=');
      skip_space();
      if (at_ == bytes_.size() || (bytes_[at_] != '"' && bytes_[at_] != '\'')) fail("a quote is missing");
      const std::size_t end = bytes_.find(bytes_[at_], at_ + 1);
      ++at_;
      if (end == std::string_view::npos) fail("a quote is missing");
      if (bytes_.substr(at_, end - at_).find('<') != std::string_view::npos) fail("'<' within quotes");
      check_references(end);
      at_ = end + 1;
    }
  }

  void count_node() {
    if (++nodes_ > max_nodes) fail(text("more than ", max_nodes, " elements and attributes"));
  }

  std::string_view bytes_;
  std::size_t at_ = 0;
  std::vector<std::string_view> open_;
  bool has_root_ = false;
  std::size_t nodes_ = 0;
};

std::string_view trim(std::string_view raw) {
  while (!raw.empty() && is_space(raw.front())) raw.remove_prefix(1);
  while (!raw.empty() && is_space(raw.back())) raw.remove_suffix(1);
  return raw;
}

}  // namespace

Document::Document(std::span<const unsigned char> bytes) : copy_(bytes.begin(), bytes.end()) {
  Check({copy_.data(), copy_.size()}).run();
  constexpr unsigned raw = pugi::parse_cdata | pugi::parse_ws_pcdata_single;
  const pugi::xml_parse_result result =
      document_.load_buffer_inplace(copy_.data(), copy_.size(), raw, pugi::encoding_utf8);
  if (result.status == pugi::status_out_of_memory) throw std::bad_alloc();
  if (!result) throw Malformed(text("is not XML: ", result.description()));
}

void append_utf8(std::string& out, std::uint32_t code) {
  const auto put = [&](std::uint32_t byte) { out += static_cast<char>(byte); };
  if (code < 0x80) return put(code);
  if (code < 0x800) {
    put(0xC0 | code >> 6);
  } else {
    if (code < 0x10000) {
      put(0xE0 | code >> 12);
    } else {
      put(0xF0 | code >> 18);
      put(0x80 | (code >> 12 & 0x3F));
    }
    put(0x80 | (code >> 6 & 0x3F));
  }
  put(0x80 | (code & 0x3F));
}

std::string decode(std::string_view raw) {
  std::string out;
  while (!raw.empty()) {
    const std::size_t reference = std::min(raw.find('&'), raw.size());
    out += raw.substr(0, reference);
    raw.remove_prefix(reference);
    if (raw.empty()) break;
    const std::size_t end = raw.find(';');
    const std::uint32_t code = end == std::string_view::npos ? no_code : referenced(raw.substr(1, end - 1));
    if (code == no_code) throw Malformed("an entity that XML itself does not define");
    append_utf8(out, code);
    raw.remove_prefix(end + 1);
  }
  return out;
}

std::string encode(std::string_view plain) {
  std::string out;
  for (std::size_t at = 0; at < plain.size();) {
    const auto [code, length] = code_at(plain, at);
    if (code == '&') {
      out += "&amp;";
    } else if (code == '<') {
      out += "&lt;";
    } else if (code == '>') {
      out += "&gt;";
    } else if (code == '"') {
      out += "&quot;";
    } else if (code == '\r') {
      out += "&#13;";
    } else if (code != no_code && is_character(code)) {
      out += plain.substr(at, length);
    }
    at += length;
  }
  return out;
}

std::string text_of(pugi::xml_node element) {
  std::string out;
  for (const pugi::xml_node child : element.children()) {
    if (child.type() == pugi::node_pcdata) {
      out += decode(child.value());
    } else if (child.type() == pugi::node_cdata) {
      out += child.value();
    } else {
      throw Malformed(text("<", shown(element.name()), "> holds <", shown(child.name()), ">"));
    }
  }
  return out;
}

std::string attribute(pugi::xml_node element, const char* name) { return decode(element.attribute(name).value()); }

double number(std::string_view raw, const std::string& what) {
  std::string_view digits = trim(raw);
  if (digits.starts_with('+')) digits.remove_prefix(1);
  double value = 0.0;
  const char* last = digits.data() + digits.size();
  const auto [end, error] = std::from_chars(digits.data(), last, value);
  const bool is_signed_twice = digits.starts_with('-') && raw.find('+') < raw.find('-');
  if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value))) {
    throw Malformed(text(what, " \"", shown(raw), "\" is not finite"));
  }
  if (error != std::errc() || end != last || is_signed_twice) {
    throw Malformed(text(what, " \"", shown(raw), "\" is no number"));
  }
  return value;
}

std::string number_text(double value) {
  char buffer[400];
  const double positive_zero = value == 0.0 ? 0.0 : value;
  const auto end = std::to_chars(std::begin(buffer), std::end(buffer), positive_zero, std::chars_format::fixed).ptr;
  return {std::begin(buffer), end};
}

std::string shown(std::string_view raw) {
  constexpr std::size_t longest = 40;
  std::string out;
  for (const char c : raw.substr(0, longest)) out += c >= ' ' && c != 0x7F ? c : '?';
  return raw.size() > longest ? out + "..." : out;
}

pugi::xml_node property_list(const Document& document) {
  if (std::strcmp(document.root().name(), "plist") != 0) throw Malformed("is no property list");
  pugi::xml_node object;
  for (const pugi::xml_node child : document.root().children()) {
    if (child.type() != pugi::node_element) throw Malformed("is a property list with text in it");
    if (object) throw Malformed("is a property list of two objects");
    object = child;
  }
  if (!object) throw Malformed("is an empty property list");
  return object;
}

Entries entries(pugi::xml_node dictionary, const std::string& what) {
  if (std::strcmp(dictionary.name(), "dict") != 0) throw Malformed(what + " is no dictionary");
  Entries found;
  std::set<std::string> seen;
  bool awaits_value = false;
  for (const pugi::xml_node child : dictionary.children()) {
    if (child.type() != pugi::node_element) throw Malformed(what + " has text between its entries");
    const bool is_key = std::strcmp(child.name(), "key") == 0;
    if (is_key == awaits_value) throw Malformed(what + (is_key ? " has a key without a value" : " lacks a key"));
    if (is_key) {
      std::string key = text_of(child);
      if (!seen.insert(key).second) throw Malformed(text(what, " has \"", shown(key), "\" twice"));
      found.emplace_back(std::move(key), pugi::xml_node());
    } else {
      found.back().second = child;
    }
    awaits_value = is_key;
  }
  if (awaits_value) throw Malformed(what + " has a key without a value");
  return found;
}

pugi::xml_node find(const Entries& entries, std::string_view key) {
  for (const auto& [name, value] : entries) {
    if (name == key) return value;
  }
  return {};
}

std::string as_text(pugi::xml_node value, const std::string& what) {
  if (std::strcmp(value.name(), "string") != 0) throw Malformed(what + " is no text");
  return text_of(value);
}

double as_number(pugi::xml_node value, const std::string& what) {
  const bool is_integer = std::strcmp(value.name(), "integer") == 0;
  if (!is_integer && std::strcmp(value.name(), "real") != 0) throw Malformed(what + " is no number");
  const double result = number(text_of(value), what);
  if (is_integer && result != std::trunc(result)) throw Malformed(what + " is no whole number");
  return result;
}

bool as_bool(pugi::xml_node value, const std::string& what) {
  const bool is_true = std::strcmp(value.name(), "true") == 0;
  if (!is_true && std::strcmp(value.name(), "false") != 0) throw Malformed(what + " is neither true nor false");
  return is_true;
}

std::vector<pugi::xml_node> as_array(pugi::xml_node value, const std::string& what) {
  if (std::strcmp(value.name(), "array") != 0) throw Malformed(what + " is no array");
  std::vector<pugi::xml_node> items;
  for (const pugi::xml_node child : value.children()) {
    if (child.type() != pugi::node_element) throw Malformed(what + " has text between its items");
    items.push_back(child);
  }
  return items;
}

}  // namespace glyphs::xml
