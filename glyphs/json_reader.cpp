#include "glyphs/json_reader.h"

#include "fontcore/error.h"
#include "glyphs/font_file.h"

namespace glyphs {

using fontcore::text;

namespace {

constexpr int most_nested = 32;
constexpr std::size_t most_keys = 1000;  // of one object, whose keys are searched one by one

}  // namespace

Json parse_json(const std::string& json, std::size_t most_bytes) {
  if (json.size() > most_bytes) throw RequestError(text("is larger than ", most_bytes, " bytes"));
  std::vector<std::set<std::string>> open;
  const auto watch = [&](int depth, Json::parse_event_t event, Json& value) {
    if (depth > most_nested) throw RequestError(text("nests deeper than ", most_nested));
    if (event == Json::parse_event_t::object_start) open.emplace_back();
    if (event == Json::parse_event_t::object_end) open.pop_back();
    if (event == Json::parse_event_t::key && !open.back().insert(value.get<std::string>()).second) {
      throw RequestError(value.get<std::string>() + ": given twice");
    }
    if (event == Json::parse_event_t::key && open.back().size() > most_keys) {
      throw RequestError(text("an object has more than ", most_keys, " keys"));
    }
    return true;
  };
  try {
    return Json::parse(json, watch);
  } catch (const nlohmann::json::parse_error& error) {
    const auto upto = json.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, json.size()));
    throw RequestError(text("not JSON: error near line ", 1 + std::count(json.begin(), upto, '\n')));
  } catch (const nlohmann::json::out_of_range&) {
    throw RequestError("not JSON: a number that no double can hold");
  }
}

std::string read_text(const std::string& path) {
  try {
    const Bytes bytes = read_file(path);
    return {bytes.begin(), bytes.end()};
  } catch (const FontReadError& error) {
    throw RequestError(error.what());
  }
}

}  // namespace glyphs
