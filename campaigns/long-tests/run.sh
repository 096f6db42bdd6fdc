#!/usr/bin/env bash
# Tests that `cargo test` leaves out because they take minutes: many more runs of what it asks in few, and the largest full models.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin long-tests
run_in tests cargo test --locked --no-fail-fast -- --ignored
finish
