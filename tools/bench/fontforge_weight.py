"""The letters of a font made bolder by FontForge's changeWeight: for weight_bench, which says by the environment of
which font (WEIGHT_BENCH_FONT), by how many units (WEIGHT_BENCH_UNITS) and where to (WEIGHT_BENCH_OUT)."""

import os

import fontforge

font = fontforge.open(os.environ["WEIGHT_BENCH_FONT"])
units = int(os.environ["WEIGHT_BENCH_UNITS"])
font.selection.select(("ranges", "unicode"), ord("A"), ord("Z"))
font.selection.select(("ranges", "unicode", "more"), ord("a"), ord("z"))
if units != 0:
    for glyph in font.selection.byGlyphs:
        glyph.changeWeight(units, "auto", 0, 0, "squish")
font.generate(os.environ["WEIGHT_BENCH_OUT"])
