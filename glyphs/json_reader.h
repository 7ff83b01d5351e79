#pragma once

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "fontcore/contour.h"
#include "glyphs/error.h"

namespace glyphs {

using Json = nlohmann::ordered_json;

/// One object of a JSON file, read key by key; what is left unread at the end is unknown and refused.
///
/// Throws  RequestError, `PATH.KEY: why`.
class ObjectReader {
 public:
  ObjectReader(const Json& object, std::string path) : object_(object), path_(std::move(path)) {
    if (!object.is_object()) fail("", "must be an object");
  }

  [[noreturn]] void fail(const std::string& key, const std::string& why) const {
    const std::string place = where(key);
    throw RequestError(place.empty() ? why : place + ": " + why);
  }
  std::string where(const std::string& key) const {
    return key.empty() ? path_ : path_.empty() ? key : path_ + "." + key;
  }
  bool has(const std::string& key) const { return object_.contains(key); }

  const Json& take(const std::string& key) {
    if (!has(key)) fail(key, "is missing");
    taken_.insert(key);
    return object_.at(key);
  }
  std::string take_text(const std::string& key, const std::string& otherwise) {
    if (!has(key)) return otherwise;
    const Json& value = take(key);
    if (!value.is_string()) fail(key, "must be a string");
    return value.get<std::string>();
  }
  bool take_flag(const std::string& key, bool otherwise) {
    if (!has(key)) return otherwise;
    const Json& value = take(key);
    if (!value.is_boolean()) fail(key, "must be true or false");
    return value.get<bool>();
  }
  double take_number(const std::string& key) {
    const Json& value = take(key);
    if (!value.is_number()) fail(key, "must be a number");
    return value.get<double>();
  }
  fontcore::Point take_point(const std::string& key) {
    const Json& value = take(key);
    if (!value.is_array() || value.size() != 2 || !value[0].is_number() || !value[1].is_number())
      fail(key, "must be two numbers, [x, y]");
    return {value[0].get<double>(), value[1].get<double>()};
  }
  std::string take_choice(const std::string& key, const std::vector<std::string>& choices,
                          const std::string& otherwise) {
    std::string value = take_text(key, otherwise);
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
    std::string list;
    for (const std::string& choice : choices) list += (list.empty() ? "\"" : ", \"") + choice + "\"";
    fail(key, "\"" + value + "\" is not one of " + list);
  }
  std::optional<int> take_contour() {
    if (!has("contour")) return {};
    const Json& index = take("contour");
    if (!index.is_number_integer() || index.get<std::int64_t>() < 0 || index.get<std::int64_t>() > 65535) {
      fail("contour", "must be a whole number from 0");
    }
    return index.get<int>();
  }
  void finish() const {
    for (const auto& [key, value] : object_.items()) {
      if (!taken_.contains(key)) fail(key, "unknown key");
    }
  }

 private:
  const Json& object_;
  std::string path_;
  std::set<std::string> taken_;
};

/// JSON as RFC 8259 has it; a key given twice is refused, since only one of the two could be honoured, and so is what
/// is larger or deeper than any file of ours is: 16 MB are far more than any recipe or library is, and read within a
/// second and some hundred megabytes.
/// Throws  RequestError: why, and near which line.
Json parse_json(const std::string& json, std::size_t most_bytes = std::size_t{16} << 20);

/// `read(text)`, with the file's name before what it refuses, and nothing that no terminal should see.
template <typename Read>
auto naming_file(const std::string& name, const std::string& json, const Read& read) {
  try {
    return read(json);
  } catch (const RequestError& error) {
    std::string why = error.what();  // with keys and values of the file, which may hold anything
    std::replace_if(
        why.begin(), why.end(), [](char c) { return (c >= 0 && c < ' ') || c == 0x7F; }, '?');
    throw RequestError(name + ": " + why);
  }
}

/// A file's text, for what is no font: what cannot be read is a slip of the request.
/// Throws  RequestError.
std::string read_text(const std::string& path);

}  // namespace glyphs
