#!/usr/bin/env bash
# Robots that move by 2, 3 and 3.6 radii in Oldroyd-B fluids: is the geometry named, does its amplitude come out at 1, are E, c₁ and c₂ the gel's own? About two minutes a record; `COUNT=90` for more.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin large
count=${COUNT:-24} size=6
for ((first = 0; first < count; first += size)); do
    run_in "records.$first" "$root/target/release/examples/large_displacements" $((count - first < size ? count - first : size)) "$first" 1
done
finish
