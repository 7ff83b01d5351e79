#pragma once

#include <string>
#include <vector>

namespace glyphs {

/// How grave a finding is, in fontbakery's words and order.
enum class Status { Debug, Pass, Skip, Info, Warn, Fail, Fatal, Error };

const char* name_of(Status status);
/// Throws  RequestError, naming the words there are.
Status status_of(const std::string& name);

/// One thing that a check has to say.
struct Finding {
  Status status = Status::Fail;
  std::string message;    ///< one line, which names the glyph
  std::string glyph;      ///< its name; empty if it is about the font
  std::string location;   ///< in the design space; empty: the font's own
  std::string more = {};  ///< a JSON object: its keys follow in the JSON
};

/// One law, and where it does not hold.
struct Check {
  std::string key;
  std::string description;  ///< the law
  std::string rationale;    ///< why it matters
  std::string filename;
  std::vector<Finding> findings = {};

  /// The gravest of its findings; Pass without any.
  Status result() const;
};

/// Rows of words and numbers under a heading; the first column is words.
struct Table {
  std::string title;
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
};

/// A picture as SVG, inline in a page.
struct Picture {
  std::string caption;
  std::string svg;
};

/// What a command has found: written as text for people, as JSON in fontbakery's shape, as JUnit XML, as
/// GitHub-flavoured Markdown or as one HTML page. Same report, same bytes.
struct Report {
  std::string title;
  std::string summary;  ///< one line
  std::string section;  ///< what the checks are about
  std::vector<Check> checks;
  std::vector<Table> tables = {};
  std::vector<Picture> pictures = {};  ///< of the HTML page alone
  std::vector<std::string> notes = {};
  std::vector<Status> possible = {};  ///< what its checks may come to, gravest first: JSON counts these; empty: all

  Status worst() const;
};

/// One line a finding, the gravest first, then tables, notes and the summary.
std::string report_text(const Report& report);

/// `{"result": {counts}, "sections": [{"key", "result", "checks": [{"key", "description", "rationale", "severity",
/// "result", "filename", "logs": [{"status", "message", "glyph", "location", ..}]}]}]}`. With `more`, a JSON object,
/// its keys follow at the end.
std::string report_json(const Report& report, const std::string& more = "");

/// A test suite; of every check a test case for each finding, a failure if FAIL and an error if worse, or one that
/// passed.
std::string report_junit(const Report& report);

std::string report_markdown(const Report& report);

/// A page of its own: styles and pictures inline, no script, nothing to be fetched.
std::string report_html(const Report& report);

}  // namespace glyphs
