#pragma once

// Private to the UFO reader and writer: XML checked before a library sees it, and property lists.

#include <cstdint>
#include <pugixml.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "glyphs/font.h"

namespace glyphs::xml {

/// What is wrong with a document, one line; who catches it adds the file.
struct Malformed : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The largest document, the deepest nesting, and the most elements and attributes together.
inline constexpr std::size_t max_size = std::size_t{32} << 20;
inline constexpr std::size_t max_depth = 128;
inline constexpr std::size_t max_nodes = 3'000'000;

/// A well-formed document in UTF-8 whose texts stand as they do in the file: references are not replaced, so that the
/// place of every text in the file is known.
///
/// Tags must match, references be those of XML itself; a document type may be named but must declare nothing. All this
/// is found by one pass over the bytes, in linear time and without recursion, before pugixml builds its tree.
class Document {
 public:
  /// Throws  Malformed.
  explicit Document(std::span<const unsigned char> bytes);

  pugi::xml_node root() const { return document_.document_element(); }
  /// Where a name or a value of the tree stands in the bytes.
  std::size_t offset(const char* text) const { return static_cast<std::size_t>(text - copy_.data()); }

 private:
  std::vector<char> copy_;
  pugi::xml_document document_;
};

/// Adds a code point, which must be one.
void append_utf8(std::string& out, std::uint32_t code);
/// A raw text with its references replaced.
std::string decode(std::string_view raw);
/// Text as it may stand in an element or between double quotes; what XML cannot hold is left out.
std::string encode(std::string_view text);
/// A text from outside as a message may show it: short, and on one line.
std::string shown(std::string_view raw);
/// The text of an element, decoded.
/// Throws  Malformed if it holds elements.
std::string text_of(pugi::xml_node element);
/// The decoded value of an attribute; empty if there is none.
std::string attribute(pugi::xml_node element, const char* name);

/// A finite number: an integer or a decimal fraction, an exponent allowed.
/// Throws  Malformed, saying `what` it is.
double number(std::string_view text, const std::string& what);
/// The shortest text that reads back to the number: no exponent, and no fraction if it is whole.
std::string number_text(double value);

/// The object of a property list.
/// Throws  Malformed if the document is none.
pugi::xml_node property_list(const Document& document);
using Entries = std::vector<std::pair<std::string, pugi::xml_node>>;
/// Keys and values of a dictionary, in its order.
/// Throws  Malformed, saying `what` it is, if it is no dictionary, or a key stands twice or without a value.
Entries entries(pugi::xml_node dictionary, const std::string& what);
/// The value of a key; none if it is not there.
pugi::xml_node find(const Entries& entries, std::string_view key);
/// Throws  Malformed, saying `what` it is, if the value has another type.
std::string as_text(pugi::xml_node value, const std::string& what);
double as_number(pugi::xml_node value, const std::string& what);
bool as_bool(pugi::xml_node value, const std::string& what);
std::vector<pugi::xml_node> as_array(pugi::xml_node value, const std::string& what);

}  // namespace glyphs::xml
