#!/usr/bin/env bash
# Draws the pictures of the README anew, into docs/: the same program draws the same bytes.
#   tools/pictures.sh [PROGRAM]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
glyphwave=${1:-build/bin/glyphwave}
serif=fonts/liberation-serif/LiberationSerif-Regular.ttf
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$glyphwave" restyle "$serif" fonts/recipes/demo.json -o "$work/swelled.ttf" -q
"$glyphwave" proof "$work/swelled.ttf" --against "$serif" --text "a good Reason sings" -o docs/proof.png -q
"$glyphwave" character apply "$serif" fonts/libraries/dry_brush.json -o "$work/worn.ttf" -q
"$glyphwave" proof "$work/worn.ttf" --text "Worn by many hands" -o docs/character.png -q
"$glyphwave" proof "$serif" --text "Rag&S" --show comb,nodes --sizes 280 -o docs/comb.png -q
"$glyphwave" proof "$serif" --glyphs S --show level=60,level=200,level=600,level=2000 --sizes 280 -o docs/levels.png -q
