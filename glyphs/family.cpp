#include "glyphs/family.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "glyphs/error.h"
#include "glyphs/proof.h"
#include "glyphs/safe_file.h"
#include "glyphs/ufo.h"

namespace glyphs {

namespace {

using fontcore::text;
using Json = nlohmann::ordered_json;

constexpr std::size_t most_shown = 100;  // glyphs of a font in the proof
constexpr std::size_t most_ranked = 20;  // glyphs in the report's list of those that moved most
constexpr double thousandths = 1000.0;   // of the em

/// What has to be known of all fonts before the first is worked on.
struct Surveyed {
  int selected = 0;  ///< glyphs
  bool is_folder = false;
  std::string name;  ///< of the output
};

/// The faults of several fonts, to be told in one line.
class Faults {
 public:
  template <typename Work>
  void gather(const std::string& font, const Work& work) {
    try {
      work();
    } catch (const FontReadError& error) {
      is_unreadable_ = true;
      add(font, error.what());
    } catch (const RequestError& error) {
      add(font, error.what());
    }
  }
  void throw_if_any() const {
    if (all_.empty()) return;
    if (is_unreadable_) throw FontReadError(all_);
    throw RequestError(all_);
  }

 private:
  void add(const std::string& font, const std::string& what) {
    const bool is_named = what.find(font) != std::string::npos;
    all_ += (all_.empty() ? "" : "; ") + (is_named ? what : font + ": " + what);
  }

  std::string all_;
  bool is_unreadable_ = false;
};

std::string file_name(std::string path) {
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  return path.substr(path.rfind('/') + 1);
}

/// A font's file name as report and proof can show it: bytes that are not UTF-8 are replaced.
std::string shown_name(const std::string& path) {
  return Json::parse(Json(file_name(path)).dump(-1, ' ', false, Json::error_handler_t::replace));
}

/// A web font and a collection have an ending that is not written.
std::string output_name(const Font& font, const std::string& path) {
  std::string name = file_name(path);
  if (font.container == Container::Sfnt && !font.is_collection) return name;
  name.erase(std::min(name.size(), name.rfind('.')));
  return name + ending_of(kind_of(font));
}

RestyleOptions options_for(const Font& font, const FamilyOptions& options) {
  RestyleOptions own{.jobs = options.jobs};
  if (options.only) own.only = options.only(font);
  return own;
}

std::vector<Surveyed> survey(const std::vector<std::string>& fonts, const Recipe& recipe,
                             const FamilyOptions& options) {
  std::vector<Surveyed> surveyed(fonts.size());
  Faults faults;
  for (std::size_t k = 0; k < fonts.size(); ++k) {
    faults.gather(fonts[k], [&] {
      const Font font = load_font(fonts[k], options.load);
      surveyed[k].selected = static_cast<int>(glyphs_to_restyle(font, recipe, options_for(font, options)).size());
      surveyed[k].is_folder = font.folder != nullptr;
      surveyed[k].name = output_name(font, fonts[k]);
      require_kind(font, surveyed[k].name);
    });
  }
  faults.throw_if_any();
  return surveyed;
}

void run(const std::vector<std::string>& fonts, const std::vector<Surveyed>& surveyed, const Recipe& recipe,
         const FamilyOptions& options, const std::function<void(std::size_t, const Font&, RestyleResult)>& take) {
  int total = 0;
  for (const Surveyed& one : surveyed) total += one.selected;
  int before = 0;
  for (std::size_t k = 0; k < fonts.size(); ++k) {
    const Font font = load_font(fonts[k], options.load);
    RestyleOptions own = options_for(font, options);
    if (options.jobs.progress) own.jobs.progress = [&](int done, int) { options.jobs.progress(before + done, total); };
    take(k, font, restyle(font, recipe, own));
    before += surveyed[k].selected;
  }
}

/// Two fonts of one name, and a font that would go where another is read from.
void require_own_places(const std::vector<std::string>& fonts, const std::vector<Output>& outputs) {
  const auto place = [](const std::string& path) {
    std::error_code error;
    std::string real = std::filesystem::weakly_canonical(path, error).string();
    while (real.size() > 1 && real.back() == '/') real.pop_back();
    return error ? path : real;
  };
  Faults faults;
  std::map<std::string, std::size_t> seen;
  std::map<std::string, std::size_t> inputs;
  for (std::size_t k = 0; k < fonts.size(); ++k) inputs.emplace(place(fonts[k]), k);
  for (std::size_t k = 0; k < fonts.size(); ++k) {
    faults.gather(fonts[k], [&] {
      const auto [first, is_new] = seen.emplace(outputs[k].path, k);
      if (!is_new)
        throw RequestError(text(fonts[first->second], " and ", fonts[k], " would both be ", outputs[k].path));
      const auto input = inputs.find(place(outputs[k].path));
      if (input != inputs.end() && input->second != k && outputs[input->second].path != outputs[k].path) {
        throw RequestError(text(fonts[k], ": would overwrite ", fonts[input->second], ", which is read"));
      }
    });
  }
  faults.throw_if_any();
}

// ---- report

double moved(const FamilyFont& font, const GlyphReport& glyph) {
  return thousandths * glyph.largest_displacement / font.units_per_em;
}

/// The glyphs of all fonts that moved most, the farthest first.
Json ranked(const std::vector<FamilyFont>& fonts) {
  std::vector<std::pair<const FamilyFont*, const GlyphReport*>> all;
  for (const FamilyFont& font : fonts) {
    for (const GlyphReport& glyph : font.result.glyphs) {
      if (glyph.changed) all.emplace_back(&font, &glyph);
    }
  }
  const auto last = all.begin() + static_cast<std::ptrdiff_t>(std::min(most_ranked, all.size()));
  std::ranges::stable_sort(all, std::ranges::greater(), [](const auto& one) { return moved(*one.first, *one.second); });
  Json list = Json::array();
  for (auto one = all.begin(); one != last; ++one) {
    list.push_back({{"font", shown_name(one->first->font)},
                    {"name", one->second->name},
                    {"displacement_in_thousandths", moved(*one->first, *one->second)}});
  }
  return list;
}

/// The report of one font, indented, with its name at the head.
std::string section(const std::string& name, const std::string& report) {
  constexpr const char* indent = "    ";
  std::string out = text("{\n      \"font\": ", Json(name).dump(), ",");
  for (std::size_t at = report.find('\n'); at + 1 < report.size();) {
    const std::size_t end = report.find('\n', at + 1);
    out += text("\n", indent, report.substr(at + 1, end - at - 1));
    at = end;
  }
  return out;
}

std::string report_of(const std::vector<FamilyFont>& fonts, const std::vector<std::string>& sections) {
  OutlineSize size;
  int changed = 0;
  int refused = 0;
  for (const FamilyFont& font : fonts) {
    size += font.result.size;
    changed += font.result.changed();
    refused += font.result.refused();
  }
  const Json head = {{"version", 1},
                     {"changed", changed},
                     {"refused", refused},
                     {"points_before", size.points_before},
                     {"points_after", size.points_after},
                     {"bytes_before", size.bytes_before},
                     {"bytes_after", size.bytes_after},
                     {"moved_most", ranked(fonts)}};
  std::string out = head.dump(2);
  out.erase(out.size() - 2);  // the closing brace
  out += ",\n  \"fonts\": [";
  for (std::size_t k = 0; k < sections.size(); ++k) out += (k == 0 ? "\n    " : ",\n    ") + sections[k];
  return out + "\n  ]\n}\n";
}

// ---- proof

void add_to(GlyphProof& proof, const std::string& name, const Font& before, const RestyleResult& result) {
  std::vector<const GlyphReport*> shown;
  for (const GlyphReport& glyph : result.glyphs) {
    if (glyph.changed) shown.push_back(&glyph);
  }
  std::string title = text(name, ": ", shown.size(), shown.size() == 1 ? " glyph" : " glyphs", " changed");
  if (shown.empty()) {
    for (const GlyphReport& glyph : result.glyphs) shown.push_back(&glyph);
  }
  if (shown.size() > most_shown) {
    std::ranges::stable_sort(shown, std::ranges::greater(), &GlyphReport::largest_displacement);
    shown.resize(most_shown);
    title += text(", the ", most_shown, " that moved most");
  }
  std::vector<int> ids;
  ids.reserve(shown.size());
  for (const GlyphReport* const glyph : shown) ids.push_back(glyph->glyph);
  const Font after = result.font.folder ? load_ufo(name, *result.font.folder) : load_font_bytes(name, result.font.data);
  proof.add(after, &before, ids, title);
}

}  // namespace

void restyle_family(const std::vector<std::string>& fonts, const Recipe& recipe, const FamilyOptions& options,
                    const std::function<void(std::size_t, const Font&, RestyleResult)>& take) {
  run(fonts, survey(fonts, recipe, options), recipe, options, take);
}

FamilyResult restyle_family_into(const FamilyOutputs& outputs, const std::vector<std::string>& fonts,
                                 const Recipe& recipe, const FamilyOptions& options) {
  if (fonts.empty()) throw RequestError("family: no font");
  const ProofFormat format = outputs.proof.empty() ? ProofFormat::Png : proof_format(outputs.proof);
  const std::vector<Surveyed> surveyed = survey(fonts, recipe, options);
  std::vector<Output> files;
  files.reserve(surveyed.size() + 2);
  for (const Surveyed& one : surveyed) files.push_back({outputs.folder + "/" + one.name, one.is_folder});
  require_own_places(fonts, files);
  for (const std::string& extra : {outputs.report, outputs.proof}) {
    if (!extra.empty()) files.push_back({extra});
  }

  const OutputFolder folder(outputs.folder);
  OutputBatch batch(files);
  GlyphProof proof;
  FamilyResult family;
  std::vector<std::string> sections;
  bool is_refused = false;
  run(fonts, surveyed, recipe, options, [&](std::size_t k, const Font& font, RestyleResult result) {
    FamilyFont& done = family.fonts.emplace_back();
    done.font = fonts[k];
    done.name = surveyed[k].name;
    done.units_per_em = font.units_per_em;
    done.refusals = glyphs::refusals(font, result.font, result);
    is_refused = is_refused || !done.refusals.empty();
    sections.push_back(section(shown_name(done.font), report_json(font, result)));
    if (!is_refused || !outputs.strict) {
      if (!outputs.proof.empty()) add_to(proof, shown_name(done.font), font, result);
      if (result.font.folder) {
        batch.stage(k, *result.font.folder);
      } else {
        batch.stage(k, std::move(result.font.data));
      }
    }
    result.font.data = {};
    result.font.folder.reset();
    done.result = std::move(result);
  });
  family.report = report_of(family.fonts, sections);
  if (outputs.strict && is_refused) return family;

  std::size_t next = fonts.size();
  if (!outputs.report.empty()) batch.stage(next++, Bytes(family.report.begin(), family.report.end()));
  if (!outputs.proof.empty()) batch.stage(next, proof.draw(format));
  batch.put_in_place();
  family.is_written = true;
  return family;
}

}  // namespace glyphs
