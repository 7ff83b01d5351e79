#!/usr/bin/env bash
# Installs what glyphwave needs from Debian and is not there yet, and the packages named as arguments; does nothing if
# nothing is missing.
# As another user than root it prints the one line to run and ends with 1.
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config
  libfreetype-dev libharfbuzz-dev libcairo2-dev libwoff-dev zlib1g-dev libpugixml-dev libeigen3-dev libcgal-dev
  nlohmann-json3-dev libcli11-dev
  catch2 libbenchmark-dev clang-format opentype-sanitizer
  "$@"
)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi
if ((EUID != 0)); then
  echo "setup: as root, run: apt-get update && apt-get install -y --no-install-recommends ${missing[*]}" >&2
  exit 1
fi
echo "setup: installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
apt-get update
apt-get install -y --no-install-recommends "${missing[@]}"
