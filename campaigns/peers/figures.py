def figures(raw):
    rows = [line.strip("| \n").split(" | ") for line in (raw / "peers.txt").read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    rows = [row for row in rows if len(row) == 5 and row[0] != "sampler" and not row[0].startswith("-")]
    return {name: f"{densities} log-densities/s, {ess} bulk ESS/s" for name, _, densities, ess, _ in rows}, {"rows": rows}
