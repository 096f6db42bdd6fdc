#!/usr/bin/env bash
# One effect of those that leave the displacement field as it is, 5 to 40 σ, two protocols, four noises: is it named, does the error fall to the true noise?
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin singles
effects=clock-offset,force-asymmetry,force-bias,actuator-lag,force-gradient,instantaneous-elasticity,second-retardation,fractional-damping,softening,tracking-drift
play singles "${COUNT:-200}" --only single --effect "$effects" --noise-kind white,ou,gain,outliers --seed 2001
finish
