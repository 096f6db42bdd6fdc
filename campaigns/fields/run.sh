#!/usr/bin/env bash
# One effect that changes the displacement field, by full finite elements on a finer mesh: minutes a truth, so few of each.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin fields
plays_a_part=2
effects=inertia,interface-slip,liquefied-pocket,poroelasticity,strain-stiffening,shear-thinning,yield-stress
play fields "${COUNT:-14}" --only single --effect "$effects" --noise-kind white,ou,gain,outliers --seed 1
finish
