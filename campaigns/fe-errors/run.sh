#!/usr/bin/env bash
# What the tests of the finite elements and of the reduced models print beside what they assert.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin fe-errors
for test in fe::exact fe::shapes fe::time fe::spatial fe::poroelastic effects::kernels; do
    binary=${test%%::*} module=${test##*::}
    run_in "${binary}_$module" cargo test --release --quiet --locked --test "$binary" -- "$module::" --include-ignored --nocapture --test-threads 1
done
finish
