#!/usr/bin/env bash
# Mutated files to every reader, one in a hundred through the program, too: counts panics, hangs and what is left half-written. Input number k of a seed is
# always the same. An hour or two of one core; `COUNT=1000` for a look.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin hard-input
# Its exit code is 1 where anything panicked, hung or was left half-written: figures.py says what.
run_in mutated "$root/target/release/examples/hard_input" "${COUNT:-100000}" 20 1000000 "$program"
finish
