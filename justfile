# Run the main job on the embedded replica.
sample:
    cargo run --release -- sample --chains 32

# The README's test command.
test:
    cargo test

# Everything that must hold before a change lands.
check:
    .ci/run

# Figures against corner.py, NetCDF against ArviZ, VTU against VTK, diagnostics against ArviZ.
python-checks:
    scripts/python-checks.sh

# The workbench in a real browser, and its page's types.
browser-checks:
    scripts/browser-checks.sh

# Lists of tasks under HyperQueue and Slurm, on this machine.
cluster-checks:
    scripts/cluster-checks.sh

# JSON Schemas of the documents, made anew from their types.
schemas:
    cargo run --example write_schemas

# All benchmarks.
bench:
    cargo bench

# vitreo-uq beside emcee and hammer-and-sample on one posterior.
peers:
    benches/peers/compare.sh

# The synthetic replica's data, made anew.
replica:
    cargo run --release --example make_porcine_replica

# The synthetic cohort's data, made anew.
cohort:
    cargo run --release --example make_cohort
