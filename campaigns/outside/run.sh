#!/usr/bin/env bash
# Physics that no effect of the library holds, 10 and 20 σ: is it called unexplained, or taken for an effect?
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin outside
plays_a_part=16
play outside "${COUNT:-96}" --only outside --signal 10,20 --noise-kind white,ou,gain,outliers --seed 4001
finish
