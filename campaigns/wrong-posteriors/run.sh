#!/usr/bin/env bash
# 400 posteriors started 10 % off and 400 started from the prior: how many have a standard deviation that is off by half or more? The test asserts none.
source "$(dirname "${BASH_SOURCE[0]}")/../common.sh"
begin wrong-posteriors
run_in truth cargo test --release --quiet --locked --test inference -- ensemble_truth:: --ignored --nocapture --test-threads 1
finish
