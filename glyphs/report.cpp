#include "glyphs/report.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "fontcore/error.h"
#include "glyphs/error.h"

namespace glyphs {

namespace {

using fontcore::text;
using Json = nlohmann::ordered_json;

// In the order of `Status`.
constexpr std::array<const char*, 8> names{"DEBUG", "PASS", "SKIP", "INFO", "WARN", "FAIL", "FATAL", "ERROR"};

// A page or a comment that lists more is read by nobody.
constexpr std::size_t most_listed = 200;

/// Length of the UTF-8 character at an index; 0 if there is none.
std::size_t character_length(const std::string& bytes, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
  const unsigned char lead = byte(at);
  const std::size_t length = lead < 0x80   ? 1
                             : lead < 0xC2 ? 0
                             : lead < 0xE0 ? 2
                             : lead < 0xF0 ? 3
                             : lead < 0xF5 ? 4
                                           : 0;
  if (length == 0 || at + length > bytes.size()) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
  if (lead == 0xE0 && byte(at + 1) < 0xA0) return 0;
  if (lead == 0xED && byte(at + 1) > 0x9F) return 0;
  if (lead == 0xF0 && byte(at + 1) < 0x90) return 0;
  if (lead == 0xF4 && byte(at + 1) > 0x8F) return 0;
  return length;
}

/// What XML and HTML take as it stands: names in broken fonts may hold anything.
std::string escaped(const std::string& bytes) {
  std::string out;
  for (std::size_t i = 0; i < bytes.size();) {
    const std::size_t length = character_length(bytes, i);
    const char c = bytes[i];
    if (length == 0 || (length == 1 && (static_cast<unsigned char>(c) < 0x20 || c == 0x7F))) {
      out += c == '\n' ? "\n" : "?";
      i += 1;
      continue;
    }
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else
      out.append(bytes, i, length);
    i += length;
  }
  return out;
}

/// One line of Markdown in which nothing is taken for markup.
std::string plain(const std::string& bytes) {
  std::string out;
  for (const char c : escaped(bytes)) {
    if (std::string_view("\\`*_[]|#~").find(c) != std::string_view::npos) out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out;
}

std::vector<const Finding*> gravest_first(const Report& report) {
  std::vector<const Finding*> all;
  for (const Check& check : report.checks)
    for (const Finding& finding : check.findings) all.push_back(&finding);
  std::stable_sort(all.begin(), all.end(), [](const auto* a, const auto* b) { return a->status > b->status; });
  return all;
}

/// Characters as a person counts them.
std::size_t width(const std::string& bytes) {
  return static_cast<std::size_t>(
      std::count_if(bytes.begin(), bytes.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

std::string aligned(const Table& table) {
  std::vector<std::size_t> widths;
  for (const std::string& cell : table.head) widths.push_back(width(cell));
  for (const auto& row : table.rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width(row[i]));
  const auto line = [&](const std::vector<std::string>& row) {
    std::string out;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string room(widths[i] - width(row[i]), ' ');
      out += i == 0 ? row[i] + room : "  " + room + row[i];
    }
    out.erase(out.find_last_not_of(' ') + 1);
    return out + "\n";
  };
  std::string out = table.title + "\n" + line(table.head);
  for (const auto& row : table.rows) out += line(row);
  return out;
}

constexpr const char* style = R"(
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; color: #222; background: #fff }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
table { border-collapse: collapse } th, td { padding: .2rem .7rem; border-bottom: 1px solid #ddd; text-align: right }
th:first-child, td:first-child { text-align: left } td.words, th.words { text-align: left }
.status { font-weight: 600; font-size: .8rem } .FAIL, .FATAL, .ERROR { color: #b00020 } .WARN { color: #8a5a00 } .PASS { color: #1a6b2f }
.rationale { color: #666; max-width: 48rem }
figure { display: inline-block; margin: 0 1.5rem 1.5rem 0; vertical-align: top } figcaption { max-width: 42rem; color: #444 }
svg { display: block; background: #fafafa; border: 1px solid #eee }
)";

}  // namespace

const char* name_of(Status status) { return names[static_cast<std::size_t>(status)]; }

Status status_of(const std::string& name) {
  const auto* const found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw RequestError(name + ": one of DEBUG, PASS, SKIP, INFO, WARN, FAIL, FATAL, ERROR is expected");
  return static_cast<Status>(found - names.begin());
}

Status Check::result() const {
  Status worst = Status::Pass;
  for (const Finding& finding : findings) worst = std::max(worst, finding.status);
  return worst;
}

Status Report::worst() const {
  Status worst = Status::Pass;
  for (const Check& check : checks) worst = std::max(worst, check.result());
  return worst;
}

std::string report_text(const Report& report) {
  std::string out;
  for (const Finding* finding : gravest_first(report))
    out += text(name_of(finding->status), " ", finding->message, "\n");
  for (const Table& table : report.tables) out += (out.empty() ? "" : "\n") + aligned(table);
  if (!report.tables.empty()) out += "\n";
  for (const std::string& note : report.notes) out += note + "\n";
  return out + report.summary + "\n";
}

std::string report_json(const Report& report, const std::string& more) {
  Json counts = Json::object();
  for (const Status status : report.possible) counts[name_of(status)] = 0;
  if (report.possible.empty()) {
    for (auto name = names.rbegin(); name != names.rend(); ++name) counts[*name] = 0;
  }
  Json listed = Json::array();
  for (const Check& check : report.checks) {
    Json logs = Json::array();
    for (const Finding& finding : check.findings) {
      Json log{{"status", name_of(finding.status)}, {"message", finding.message}};
      if (!finding.glyph.empty()) log["glyph"] = finding.glyph;
      if (!finding.location.empty()) log["location"] = finding.location;
      if (!finding.more.empty()) log.update(Json::parse(finding.more));
      logs.push_back(std::move(log));
    }
    const char* result = name_of(check.result());
    counts[result] = counts[result].get<int>() + 1;
    listed.push_back({{"key", check.key},
                      {"description", check.description},
                      {"rationale", check.rationale},
                      {"severity", nullptr},
                      {"result", result},
                      {"filename", check.filename},
                      {"logs", std::move(logs)}});
  }
  Json json{
      {"result", counts},
      {"sections",
       Json::array({{{"key", report.section}, {"result", name_of(report.worst())}, {"checks", std::move(listed)}}})}};
  if (!more.empty()) json.update(Json::parse(more));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string report_junit(const Report& report) {
  std::string cases;
  int tests = 0;
  int failures = 0;
  int errors = 0;
  for (const Check& check : report.checks) {
    const auto add = [&](const std::string& name, const std::string& inside) {
      ++tests;
      cases += text("    <testcase classname=\"", escaped(check.key), "\" name=\"", escaped(name), "\" time=\"0\"",
                    inside.empty() ? "/>" : ">" + inside + "</testcase>", "\n");
    };
    bool has_failed = false;
    std::string remarks;
    for (const Finding& finding : check.findings) {
      if (finding.status < Status::Fail) {
        remarks += text(name_of(finding.status), " ", finding.message, "\n");
        continue;
      }
      has_failed = true;
      const char* const element = finding.status == Status::Fail ? "failure" : "error";
      ++(finding.status == Status::Fail ? failures : errors);
      const std::string name = finding.glyph.empty() ? check.description : finding.glyph;
      add(finding.location.empty() ? name : name + " at " + finding.location,
          text("<", element, " type=\"", name_of(finding.status), "\" message=\"", escaped(finding.message), "\"/>"));
    }
    if (!has_failed || !remarks.empty())
      add(check.description, remarks.empty() ? "" : "<system-out>" + escaped(remarks) + "</system-out>");
  }
  return text("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n  <testsuite name=\"", escaped(report.title),
              "\" tests=\"", tests, "\" failures=\"", failures, "\" errors=\"", errors,
              "\" skipped=\"0\" time=\"0\">\n", cases, "  </testsuite>\n</testsuites>\n");
}

std::string report_markdown(const Report& report) {
  std::string out = text("## ", plain(report.title), "\n\n", plain(report.summary), "\n");
  const std::vector<const Finding*> findings = gravest_first(report);
  if (!findings.empty()) out += "\n| | |\n|---|---|\n";
  for (std::size_t i = 0; i < std::min(findings.size(), most_listed); ++i)
    out += text("| **", name_of(findings[i]->status), "** | ", plain(findings[i]->message), " |\n");
  if (findings.size() > most_listed) out += text("\nand ", findings.size() - most_listed, " more\n");
  for (const Table& table : report.tables) {
    out += text("\n<details><summary>", escaped(table.title), "</summary>\n\n|");
    for (const std::string& cell : table.head) out += " " + plain(cell) + " |";
    out += "\n|";
    for (std::size_t i = 0; i < table.head.size(); ++i) out += i == 0 ? "---|" : "---:|";
    for (std::size_t i = 0; i < std::min(table.rows.size(), most_listed); ++i) {
      out += "\n|";
      for (const std::string& cell : table.rows[i]) out += " " + plain(cell) + " |";
    }
    out += "\n";
    if (table.rows.size() > most_listed) out += text("\nand ", table.rows.size() - most_listed, " more\n");
    out += "\n</details>\n";
  }
  for (const std::string& note : report.notes) out += "\n" + plain(note) + "\n";
  return out;
}

std::string report_html(const Report& report) {
  std::string out = text(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; img-src "
      "data:\">\n<link rel=\"icon\" href=\"data:,\">\n<title>",
      escaped(report.title), "</title>\n<style>", style, "</style>\n</head>\n<body>\n<h1>", escaped(report.title),
      "</h1>\n<p><span class=\"status ", name_of(report.worst()), "\">", name_of(report.worst()), "</span> ",
      escaped(report.summary), "</p>\n");
  for (const std::string& note : report.notes) out += "<p>" + escaped(note) + "</p>\n";
  for (const Picture& picture : report.pictures)
    out += text("<figure>", picture.svg, "<figcaption>", escaped(picture.caption), "</figcaption></figure>\n");
  for (const Check& check : report.checks) {
    out += text("<h2><span class=\"status ", name_of(check.result()), "\">", name_of(check.result()), "</span> ",
                escaped(check.description), "</h2>\n<p class=\"rationale\">", escaped(check.rationale), "</p>\n");
    if (check.findings.empty()) continue;
    out += "<table>\n";
    for (const Finding& finding : check.findings)
      out += text("<tr><td><span class=\"status ", name_of(finding.status), "\">", name_of(finding.status),
                  "</span></td><td class=\"words\">", escaped(finding.message), "</td></tr>\n");
    out += "</table>\n";
  }
  for (const Table& table : report.tables) {
    out += text("<h2>", escaped(table.title), "</h2>\n<table>\n<tr>");
    for (const std::string& cell : table.head) out += "<th>" + escaped(cell) + "</th>";
    out += "</tr>\n";
    for (const auto& row : table.rows) {
      out += "<tr>";
      for (const std::string& cell : row) out += "<td>" + escaped(cell) + "</td>";
      out += "</tr>\n";
    }
    out += "</table>\n";
  }
  return out + "</body>\n</html>\n";
}

}  // namespace glyphs
