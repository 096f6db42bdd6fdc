#!/usr/bin/env bash
# What the tests of the finite elements and of the reduced models print beside what they assert.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin fe-errors
for test in fe_exact fe_shapes fe_time fe_spatial fe_poroelastic effects_kernels; do
    run_in "$test" cargo test --release --quiet --locked --test "$test" -- --nocapture --test-threads 1
done
finish
