"""A model that this program does not hold, served by the UM-Bridge package: a bead between a dashpot and a spring that stiffens with the cube of its stretch. `vitreo-uq sample` finds the parameters that
made the record, and works a second time when the server is gone.

Run from anywhere; needs umbridge, numpy.
"""

import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import time
import urllib.request

import numpy as np

import small_experiment

STIFFNESS, CUBIC, DRAG = 0.012, 6.0e4, 0.02  # N/m, N/m³, N s/m
NOISE_UM = 1.0
PORT = 42423

SERVER = '''
import sys
sys.path.insert(0, sys.argv[1])
import umbridge
from outside_model import positions_um

class Stiffening(umbridge.Model):
    def __init__(self):
        super().__init__("forward")
    def get_input_sizes(self, config):
        return [3]
    def get_output_sizes(self, config):
        return [len(config["time_s"])]
    def __call__(self, parameters, config):
        return [positions_um(*parameters[0], config["time_s"], config["force_n"])]
    def supports_evaluate(self):
        return True

umbridge.serve_models([Stiffening()], int(sys.argv[2]))
'''

BASE = """[base.forward]
url = "http://127.0.0.1:%d"
[base.forward.parameters.stiffness_n_per_m]
unit = "N/m"
prior = { distribution = "log_normal", median = 0.013, log_sd = 0.2 }
[base.forward.parameters.cubic_n_per_m3]
unit = "N/m^3"
prior = { distribution = "log_normal", median = 5e4, log_sd = 0.3 }
[base.forward.parameters.drag_n_s_per_m]
unit = "N s/m"
prior = { distribution = "log_normal", median = 0.018, log_sd = 0.2 }
"""


def positions_um(stiffness, cubic, drag, time_s, force_n):
    """drag x' + stiffness x + cubic x³ = F from rest, by Runge and Kutta's method; the force holds between times."""
    x, found = 0.0, []
    for row, now in enumerate(time_s):
        found.append(1e6 * x)
        if row + 1 == len(time_s):
            break
        whole, force = time_s[row + 1] - now, force_n[row]
        steps = max(1, int(np.ceil(whole / 0.05)))
        h = whole / steps
        slope = lambda at: (force - stiffness * at - cubic * at**3) / drag
        for _ in range(steps):
            k1 = slope(x)
            k2 = slope(x + 0.5 * h * k1)
            k3 = slope(x + 0.5 * h * k2)
            k4 = slope(x + h * k3)
            x += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return found


def write_experiment(folder):
    rng = random.Random(3)
    time_s = [0.1 * row for row in range(300)]
    force_n = [4e-6 if (row // 50) % 2 == 0 else -4e-6 for row in range(300)]
    lines = ["time_s,force_uN,position_um,cycle"]
    for row, x in enumerate(positions_um(STIFFNESS, CUBIC, DRAG, time_s, force_n)):
        lines.append(f"{time_s[row]:.2f},{1e6 * force_n[row]},{x + rng.gauss(0, NOISE_UM):.4f},{1 + row // 100}")
    place = pathlib.Path(folder) / "bead"
    place.mkdir()
    (place / "trajectory.csv").write_text("\n".join(lines) + "\n")
    (place / "experiment.toml").write_text(
        '[specimen]\nid = "bead"\n[instrument]\ncompliance_per_m = 1.0\n[measurement]\nfile = "trajectory.csv"\n'
        f'calibration_cycles = [1, 2]\nheldout_cycles = [3]\nnoise_um = {NOISE_UM}\nsource = "synthetic: Runge and Kutta"\n'
    )


def wait_for(port):
    for _ in range(200):
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{port}/Info", timeout=1)
            return
        except OSError:
            time.sleep(0.05)
    raise AssertionError("the server does not answer")


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.environ["VITREO_UQ_CACHE"] = str(pathlib.Path(folder) / "cache")
        write_experiment(folder)
        (pathlib.Path(folder) / "base.toml").write_text(BASE % PORT)
        here = str(pathlib.Path(__file__).resolve().parent)
        server = subprocess.Popen([sys.executable, "-c", SERVER, here, str(PORT)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_for(PORT)
            arguments = ["sample", "bead", "--base", "base.toml", "--json", "-", "--quiet", "--out"]
            first = json.loads(small_experiment.run(folder, *arguments, "first"))
        finally:
            server.terminate()
            server.wait()
        second = json.loads(small_experiment.run(folder, *arguments, "second"))
    assert first["parameters"] == second["parameters"]
    found = {own["name"]: own for own in first["parameters"]}
    truth = {"stiffness_n_per_m": STIFFNESS, "cubic_n_per_m3": CUBIC, "drag_n_s_per_m": DRAG, "noise_sd_um": NOISE_UM}
    for name, value in truth.items():
        mean, sd = found[name]["mean"], found[name]["sd"]
        # Four standard deviations: one record in four thousand is farther off in one of four parameters.
        assert abs(mean - value) < 4 * sd, f"{name}: {mean} ± {sd}, and {value} made the record"
    apart = first["heldout"]["surrogate_vs_fe_max_um"]
    assert 0 < apart < 0.3 * NOISE_UM, apart
    print(", ".join(f"{name} {found[name]['mean']:.4g} ± {found[name]['sd']:.2g} (made by {value:.4g})" for name, value in truth.items()))


if __name__ == "__main__":
    main()
