#!/usr/bin/env bash
# All tests that `cargo test` leaves out, those included that take minutes each: many more runs of what it asks in few, and the largest full models. A part of the tests at a time, so that RESUME=1 goes on.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin long-tests none
run_in library cargo test --locked --lib --no-fail-fast -- --ignored
for binary in commands critique effects fe inference jobs; do
    run_in "$binary" cargo test --locked --test "$binary" --no-fail-fast -- --ignored
done
finish
