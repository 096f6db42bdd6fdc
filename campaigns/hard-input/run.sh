#!/usr/bin/env bash
# Mutated files to every reader, one in a hundred through the program, too: counts panics, hangs and what is left half-written. Input number k of a seed is
# always the same. Then valid variants to every reader of files that people and other programs write, so many for each. Half an hour; `COUNT=1000` for a look.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin hard-input
# Its exit code is 1 where anything panicked, hung or was left half-written: figures.py says what.
run_in mutated "$root/target/release/examples/hard_input" "${COUNT:-100000}" 20 1000000 "$program"
# Its exit code is 1 where anything panicked, was slow or large, or where a reader refused more than half.
run_in variants "$root/target/release/examples/hard_input" variants "${COUNT:-100000}" 22
finish
