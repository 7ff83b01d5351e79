#!/bin/sh
# Makes the prior of weight again: tools/bench/weight_prior.sh BUILD > fonts/priors/latin.json
#
# Families as Debian packages them: fonts-dejavu-core, fonts-roboto-unhinted, fonts-lato, fonts-inter, fonts-cantarell,
# fonts-noto-core, fonts-urw-base35, fonts-vollkorn. A family to be judged, and its siblings, are left out by name:
# LEAVE_OUT="DejaVu Sans,DejaVu Serif".
set -e
build=${1:?"usage: weight_prior.sh BUILD"}
set --
for family in "DejaVu Sans" "Roboto" "Lato" "Inter" "Cantarell" "Noto Sans" "Nimbus Sans" \
              "DejaVu Serif" "Noto Serif" "Vollkorn" "Nimbus Roman" "C059" "P052"; do
  case ",$LEAVE_OUT," in *",$family,"*) continue ;; esac
  for style in Regular Bold; do
    # Of the files that have the family in this style the first by name.
    file=$(fc-list ":family=$family:slant=0:width=100:weight=$([ $style = Bold ] && echo 200 || echo 80)" file |
           sed 's/: *$//' | grep -E '[.][ot]tf$' | sort | head -n 1)
    [ -n "$file" ] || { echo "weight_prior.sh: no $family $style" >&2; exit 1; }
    [ $style = Regular ] && set -- "$@" "$family"
    set -- "$@" "$file"
  done
done
exec "$build/bin/weight_prior" n,o,H,O "$@"
