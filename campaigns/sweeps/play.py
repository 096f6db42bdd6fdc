"""play.py PROGRAM KIND FIRST END: writes the sweeps of so many seeds, has them diagnosed, and prints one JSON line a record.

J = 1/(E + iωc₁) + 1/(iωc₂), and of `spring` 1/E₀ more, of `body` 1/(E₂ + iωc₃); G* = 1/(3 J). E, c₁ and c₂ are drawn around Table I of the paper; 25 to 40
frequencies over three decades; errors of 2 % of |G*|, normal and independent in both moduli. `stated` writes them into the table, the others do not.
"""

import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

ERROR = 0.02


def law(stream, kind):
    """Creep compliance at s = iω, and the effect that the law lacks."""
    young_pa, c1_pa_s, c2_pa_s = (middle * math.exp(stream.gauss(0, 0.3)) for middle in (3.5, 1.4, 47.0))

    def base(s):
        return 1 / (young_pa + s * c1_pa_s) + 1 / (s * c2_pa_s)

    share = math.exp(stream.uniform(math.log(0.08), math.log(0.3)))
    if kind == "spring":
        return (lambda s: base(s) + share / young_pa), "instantaneous-elasticity"
    if kind == "body":
        body_pa, time_s = young_pa / share, math.exp(stream.uniform(math.log(2), math.log(12)))
        return (lambda s: base(s) + 1 / (body_pa * (1 + s * time_s))), "second-retardation"
    return base, None


def table(stream, kind):
    """Text of the table, and what it hides."""
    compliance, hidden = law(stream, kind)
    count, lowest_hz = stream.randint(25, 40), math.exp(stream.uniform(math.log(0.005), math.log(0.05)))
    lines = ["frequency_hz,storage_pa,loss_pa" + (",storage_sd_pa,loss_sd_pa" if kind == "stated" else "")]
    for k in range(count):
        frequency_hz = lowest_hz * 1000 ** (k / (count - 1))
        modulus_pa = 1 / (3 * compliance(2j * math.pi * frequency_hz))
        sd_pa = ERROR * abs(modulus_pa)
        cells = [frequency_hz, modulus_pa.real + stream.gauss(0, sd_pa), modulus_pa.imag + stream.gauss(0, sd_pa)]
        lines.append(",".join(f"{cell:.6g}" for cell in cells + ([sd_pa, sd_pa] if kind == "stated" else [])))
    return "\n".join(lines) + "\n", hidden


def played(program, kind, seed):
    """The verdict on one record."""
    text, hidden = table(random.Random(f"{kind} {seed}"), kind)
    with tempfile.TemporaryDirectory() as name:
        place = pathlib.Path(name)
        (place / "sweep.csv").write_text(text, encoding="utf-8")

        def run(*arguments):
            return subprocess.run([program, *arguments], cwd=place, capture_output=True, text=True, check=False)

        made = run("init", "sweep.csv", "--out", "experiment")
        if made.returncode:
            raise SystemExit(f"{kind} {seed}: init: {made.stderr}")
        told = run("diagnose", "experiment", "--out", "study", "--json", "-", "--quiet", "--seed", str(seed))
        if told.returncode > 1:
            raise SystemExit(f"{kind} {seed}: diagnose: {told.stderr}")
        document = json.loads(told.stdout)
    verdict = document["verdict"]
    named = verdict["effects"] + verdict["equivalent"]
    return {"kind": kind, "seed": seed, "hidden": hidden, "verdict": verdict["kind"], "named": named}


def main():
    program, kind, first, end = sys.argv[1:]
    for seed in range(int(first), int(end)):
        print(json.dumps(played(program, kind, seed), ensure_ascii=False))


main()
