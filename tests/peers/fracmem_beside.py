"""fracmem beside springpot: the force of a springpot along 155 s at 1 kHz, with equal numbers of head samples and modes.

    python3 -m venv /tmp/peers && /tmp/peers/bin/pip install -r tests/peers/requirements.txt
    cargo build --release -p host-sim
    /tmp/peers/bin/python tests/peers/fracmem_beside.py target/release/host-sim

F = c D^0.2 x along x = 1.25 mm (1 - cos 2 pi t / 7), Gruenwald-Letnikov, from rest. The reference is the whole sum by a Fourier
transform in f64, computed here. The error is the RMS of the difference over the standard deviation of the reference. fracmem keeps a
head of L samples of x and p exponentials whose weights come from its construction alone or, as it recommends, from training signals;
springpot keeps increments of x. Time is not compared: fracmem runs in numpy here, and the C that it exports has at most 32 modes.
"""

import csv
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from fracmem import CompressedFractionalFilter
from scipy.signal import fftconvolve

ORDER, MODULUS, RATE_HZ, SAMPLES = 0.2, 62_740.0, 1000.0, 155_001
HEAD, MODES = 12, 36

PARAMETERS = f"""schema = 1
name = "springpot"
[actuator]
relative_permittivity = 4.7
length_m = 0.04
width_m = 0.06
thickness_m = 160e-6
mass_kg = 0.0
[model]
topology = "parallel"
main = {{ c = {MODULUS}, alpha = {ORDER} }}
branches = []
"""


def exact(x):
    weights = np.cumprod(np.concatenate([[1.0], 1.0 - (1.0 + ORDER) / np.arange(1, len(x))]))
    return MODULUS * RATE_HZ**ORDER * fftconvolve(x, weights)[: len(x)]


def relative_rms(force, reference):
    return np.sqrt(np.mean((force - reference) ** 2)) / np.std(reference)


def host_sim(tool, x, reference, precision):
    """The relative RMS error of host-sim's compressed memory."""
    with tempfile.TemporaryDirectory() as folder:
        parameters, recording = Path(folder) / "p.toml", Path(folder) / "x.csv"
        parameters.write_text(PARAMETERS)
        with open(recording, "w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["time_s", "displacement_m", "force_n"])
            rows.writerows([f"{k / RATE_HZ:.3f}", repr(float(x)), repr(float(f))] for k, (x, f) in enumerate(zip(x, reference)))
        command = [tool, "replay", "--params", parameters, recording, "--drive", "displacement", "--precision", precision, "--json"]
        run = subprocess.run(command, check=True, capture_output=True, text=True)
        return json.loads(run.stdout)["recordings"][0]["rmse_n"] / np.std(reference)


def main():
    tool = sys.argv[1] if len(sys.argv) > 1 else "target/release/host-sim"
    time_s = np.arange(SAMPLES) / RATE_HZ
    x = 1.25e-3 * (1.0 - np.cos(2.0 * np.pi * time_s / 7.0))
    reference = exact(x)
    print(f"head {HEAD}, {MODES} modes: relative RMS error over 155 s at 1 kHz, springpot of order {ORDER}")
    for precision in ("f64", "f32"):
        print(f"host-sim, {precision}: {host_sim(tool, x, reference, precision):.1e}")
    analytic = CompressedFractionalFilter.from_analytic(ORDER, 1.0 / RATE_HZ, HEAD, MODES, j_max=SAMPLES)
    print(f"fracmem, from its construction: {relative_rms(MODULUS * analytic.predict(x), reference):.1e}")
    random = np.random.default_rng(1)
    training = [random.standard_normal(20_000).cumsum() * 1e-5 for _ in range(8)]
    fitted = CompressedFractionalFilter(ORDER, 1.0 / RATE_HZ, HEAD, MODES)
    started = time.perf_counter()
    fitted.fit(training, j_max=SAMPLES)
    seconds = time.perf_counter() - started
    print(f"fracmem, fitted to 8 random walks of 20 s ({seconds:.0f} s): {relative_rms(MODULUS * fitted.predict(x), reference):.1e}")


if __name__ == "__main__":
    main()
