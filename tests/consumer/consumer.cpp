#include <fontcore/measure.h>
#include <glyphs/font_file.h>

#include <iostream>

int main(int count, char** arguments) {
  if (count != 2) return 2;
  const glyphs::Font font = glyphs::load_font(arguments[1]);
  const double area = fontcore::signed_area(glyphs::compose(font, font.find("a")));
  std::cout << font.family << " a encloses " << area << " square units\n";
  return area == 0.0;
}
