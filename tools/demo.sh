#!/usr/bin/env bash
# The main job on a bundled font: what is missing, a Release build in build/, then a recipe applied to Liberation Serif.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools/setup.sh

echo "demo: building in build/ (a few minutes the first time)"
mkdir -p build
if ! { cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release && cmake --build build --target glyphwave; } \
  >build/demo-build.log 2>&1; then
  tail -n 30 build/demo-build.log
  echo "demo: the build failed; all of it is in build/demo-build.log" >&2
  exit 1
fi

font=fonts/liberation-serif/LiberationSerif-Regular.ttf
out=build/demo
mkdir -p "$out"
build/bin/glyphwave restyle "$font" fonts/recipes/demo.json -o "$out/LiberationSerif-Swelled.ttf" \
  --report "$out/report.json" --proof "$out/glyphs.png" --no-progress
build/bin/glyphwave proof "$out/LiberationSerif-Swelled.ttf" --against "$font" --text "a good Reason sings" \
  -o "$out/proof.png" --no-progress
echo
echo "Look at $out/proof.png (before, after, overlaid) and $out/glyphs.png (every changed glyph);"
echo "the new font is $out/LiberationSerif-Swelled.ttf, the numbers are in $out/report.json."
