#!/usr/bin/env bash
# Two effects at once, 10 to 40 σ, two protocols, four noises: are both in the class that is reported?
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin pairs
plays_a_part=10
effects=clock-offset,force-asymmetry,force-bias,actuator-lag,force-gradient,instantaneous-elasticity,second-retardation,fractional-damping,softening,tracking-drift
play pairs "${COUNT:-50}" --only pair --effect "$effects" --noise-kind white,ou,gain,outliers --seed 3001
finish
