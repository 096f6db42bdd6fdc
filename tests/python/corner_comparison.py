"""Draws the same posteriors with corner.py and with vitreo-uq for visual comparison, and compares the titles of vitreo-uq with NumPy.

The figures go to target/corner-comparison. Needs numpy, matplotlib, corner.
"""

import csv
import pathlib
import re
import subprocess

import corner
import matplotlib
import numpy as np

matplotlib.use("Agg")


def banana(rng, n):
    a, b, c, d = rng.standard_normal((4, n))
    return {
        "young_modulus_pa": 3.527 + 0.12 * a,
        "viscosity_1_pa_s": 1.402 + 0.05 * (0.7 * (a**2 - 1) + 0.4 * b),
        "viscosity_2_pa_s": 47.37 * np.exp(0.06 * (0.9 * a + 0.44 * c)),
        "noise_sd_um": 4.0 * np.exp(0.05 * d),
    }


def bimodal(rng, n):
    left = rng.random(n) < 0.35
    a, b, c = rng.standard_normal((3, n))
    return {
        "young_modulus_pa": np.where(left, 2.1 + 0.10 * a, 3.5 + 0.18 * a),
        "viscosity_1_pa_s": np.where(left, 1.9 + 0.08 * b, 1.3 + 0.06 * (0.8 * a + 0.6 * b)),
        "softening.rate_per_s": np.abs(0.002 * c),
    }


def check_titles(svg, draws):
    """Every title gives the median and the distances to the 16 % and 84 % quantiles, correct to the shown digits."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", svg)
    for name, values in draws.items():
        low, median, high = np.quantile(values, [0.16, 0.5, 0.84])
        for expected in (median, high - median, low - median):
            numbers = [(float(t), t) for t in (m.replace("\u2212", "-") for text in texts for m in re.findall(r"[+\u2212-]?\d+\.\d+", text))]
            # Small numbers are given as multiples of 10⁻³.
            digits = [
                abs(number * scale - expected) <= 0.5000001 * scale * 10.0 ** -len(text.split(".")[1])
                for number, text in numbers
                for scale in (1.0, 1e-3)
            ]
            assert any(digits), f"{name}: no title says {expected}"


def main():
    out = pathlib.Path("target/corner-comparison")
    program = ["cargo", "run", "--quiet", "--example", "corner_plot", "--"]
    rng = np.random.default_rng(7)
    for name, draws in [("banana", banana(rng, 10_000)), ("bimodal", bimodal(rng, 10_000))]:
        folder = out / name
        folder.mkdir(parents=True, exist_ok=True)
        table = np.column_stack(list(draws.values()))
        with open(folder / f"{name}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(draws)
            writer.writerows(table.tolist())
        figure = corner.corner(
            table, labels=list(draws), quantiles=[0.16, 0.5, 0.84], show_titles=True, levels=(0.5, 0.9)
        )
        figure.savefig(folder / "corner_py.png", dpi=100)
        subprocess.run([*program, folder, folder / f"{name}.csv"], check=True, stdout=subprocess.DEVNULL)
        check_titles((folder / "corner.svg").read_text(), draws)
    print(f"titles of two corner plots equal NumPy's quantiles; see {out} beside corner.py's")


if __name__ == "__main__":
    main()
