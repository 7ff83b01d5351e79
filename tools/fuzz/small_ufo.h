#pragma once

#include <array>
#include <string>

#include "glyphs/font.h"

/// A UFO of two glyphs and a composite, with a file of every kind that is read.
inline glyphs::Folder small_ufo() {
  const auto plist = [](const std::string& body) {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<plist version=\"1.0\">" + body + "</plist>\n";
  };
  const auto glif = [](const std::string& name, const std::string& code, const std::string& outline) {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<glyph name=\"" + name +
           "\" format=\"2\"><advance width=\"500\"/><unicode hex=\"" + code + "\"/><outline>" + outline +
           "</outline></glyph>\n";
  };
  const std::string square =
      "<contour><point x=\"0\" y=\"0\" type=\"line\" name=\"a\"/><point x=\"400\" y=\"0\" type=\"line\"/>"
      "<point x=\"400.5\" y=\"700\" type=\"line\" identifier=\"p\"/><point x=\"0\" y=\"700\" type=\"line\"/></contour>";
  const std::string drop =
      "<contour><point x=\"0\" y=\"0\"/><point x=\"200\" y=\"-50\"/><point x=\"300\" y=\"300\" type=\"qcurve\" "
      "smooth=\"yes\"/><point x=\"200\" y=\"600\"/><point x=\"100\" y=\"600\"/><point x=\"0\" y=\"300\" "
      "type=\"curve\"/></contour>";
  const std::map<std::string, std::string> files{
      {"metainfo.plist", plist("<dict><key>creator</key><string>us</string><key>formatVersion</key><integer>3</integer>"
                               "</dict>")},
      {"fontinfo.plist", plist("<dict><key>unitsPerEm</key><integer>1000</integer><key>familyName</key>"
                               "<string>Made &amp; small</string><key>ascender</key><real>800.5</real></dict>")},
      {"layercontents.plist",
       plist("<array><array><string>public.default</string><string>glyphs</string></array></array>")},
      {"lib.plist",
       plist("<dict><key>public.glyphOrder</key><array><string>B</string><string>A</string></array></dict>")},
      {"glyphs/contents.plist", plist("<dict><key>A</key><string>A_.glif</string><key>B</key><string>B_.glif</string>"
                                      "<key>C</key><string>C_.glif</string></dict>")},
      {"glyphs/A_.glif", glif("A", "0041", square)},
      {"glyphs/B_.glif", glif("B", "0042", drop)},
      {"glyphs/C_.glif", glif("C", "00C1",
                              "<component base=\"A\"/><component base=\"B\" xScale=\"0.5\" yxScale=\"-0.25\" "
                              "xOffset=\"30\"/>")}};
  glyphs::Folder folder;
  for (const auto& [name, content] : files) folder[name] = {content.begin(), content.end()};
  return folder;
}
