#!/usr/bin/env bash
# emcee, hammer-and-sample and this program on one posterior, one thread each.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin peers
run_in peers benches/peers/compare.sh
finish
