#!/usr/bin/env bash
# All tests: what is missing, a Release build, ctest. Arguments go to cmake, such as -DGLYPHWAVE_WERROR=ON.
# BUILD names another build folder than build/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools/setup.sh

build=${BUILD:-build}
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release "$@"
cmake --build "$build"

status=0
ctest --test-dir "$build" --output-on-failure --no-tests=error -j "$(nproc)" | tee "$build/tests.log" || status=$?
echo
if ((status == 0)); then
  echo "All tests passed: the list is in $build/tests.log."
else
  echo "Tests failed: see above, $build/tests.log and $build/Testing/Temporary/LastTest.log."
fi
exit "$status"
