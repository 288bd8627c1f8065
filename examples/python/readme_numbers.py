"""Measure what the README says of accuracy and speed, and print it as a table.

    python examples/python/readme_numbers.py [--write]

`--write` replaces the table in README.md and the output of the demonstration there. Needs NumPy and
SciPy; takes about a minute.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
import time
import warnings
from pathlib import Path

# The peer runs on one core, as the library does here.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import numpy as np  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
for _folder in ("examples/python", "tests/bench"):
    sys.path.insert(0, str(ROOT / _folder))

import peer_impedance  # noqa: E402
import peer_models  # noqa: E402
import peer_simulation  # noqa: E402
import relaxed_arm  # noqa: E402

import ulna  # noqa: E402
from ulna.cli import main as ulna_command  # noqa: E402

ARM = relaxed_arm.P1
TRUTH = {"M": ARM.m_kg, "B": ARM.b_ns_m, "K": ARM.k_n_m, "x0": ARM.x0_m}
FILTERS = {"lowpass_hz": 5.0, "window": 101, "order": 6}


def record(run: relaxed_arm.Recordings, i: int = 0) -> ulna.Record:
    """One simulated recording."""
    channels = {}
    for axis, letter in enumerate("xy"):
        channels[letter] = run.position_m[i, :, axis]
        channels["F_" + letter] = run.force_n[i, :, axis]
        channels[letter + "_ref"] = run.reference_m[i, :, axis]
    return ulna.Record.from_arrays(run.time_s, channels)


def best(function, rounds: int) -> float:
    """Shortest time of several, in seconds: what other programs on the machine add is left out."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def accuracy() -> list[tuple[str, str]]:
    """Errors against a known truth."""
    still = relaxed_arm.simulate(seed=1, tremor_n=0.0, sensors=False)
    exact = ulna.identify_impedance(record(still))
    error = max(
        np.abs(getattr(exact, name) - true).max() / np.abs(true).max()
        for name, true in TRUTH.items()
    )
    bundled = ulna.identify_impedance(ulna.read(ROOT / "examples" / "data" / "relaxed-arm.csv"))
    truth = json.loads((ROOT / "examples" / "data" / "relaxed-arm-truth.json").read_text())

    def held(estimate):
        inside = 0
        for name in ("M", "B", "K"):
            low, high = estimate.interval(name)
            inside += int(((low <= truth[name]) & (truth[name] <= high)).sum())
        return inside

    inside = []
    for batch in range(4):
        run = relaxed_arm.simulate(seed=1000 + batch, repetitions=50)
        for i in range(50):
            estimate = ulna.identify_impedance(record(run, i))
            for name, true in TRUTH.items():
                low, high = estimate.interval(name)
                inside.append(((low <= true) & (true <= high)).ravel())
    share = 100 * np.concatenate(inside).mean()
    return [
        ("a recording without noise, largest relative error", f"{error:.0e}"),
        ("bundled recording, true parameters in their 95 % intervals", f"{held(bundled)} of 12"),
        ("the same by least squares, which is flagged", f"{held(bundled.least_squares)} of 12"),
        ("200 simulated recordings, 95 % intervals that hold the truth", f"{share:.1f} %"),
    ]


def speed() -> list[tuple[str, str]]:
    """Times on one thread, and of a script with NumPy and SciPy."""
    run = relaxed_arm.simulate(seed=1)
    arrays = run.time_s, run.position_m[0], run.force_n[0], run.reference_m[0]
    log = record(run)
    ours = best(lambda: ulna.identify_impedance(record(run), threads=1, **FILTERS), 60)
    theirs = best(lambda: peer_impedance.identify(*arrays, **FILTERS), 3)
    boot = best(
        lambda: ulna.identify_impedance(
            log, errors="bootstrap", bootstrap=1000, threads=1, **FILTERS
        ),
        3,
    )
    return [
        ("50 s, 1 kHz, 2 axes: arrays to estimate with errors", f"{1e3 * ours:.0f} ms"),
        (
            "the same steps in a NumPy and SciPy script",
            f"{1e3 * theirs:.0f} ms, {theirs / ours:.0f} times as long",
        ),
        ("the estimate with 1000 bootstrap refits", f"{boot:.2f} s"),
        *simulation_speed(run.reference_m[0]),
        *model_speed(),
    ]


def simulation_speed(reference: np.ndarray) -> list[tuple[str, str]]:
    """A simulated experiment beside SciPy's integrator on the same loop."""
    arm = ulna.sim.arms("5.6")["Method 1"]
    wave = 0.5 * (reference - reference[0])
    ours = best(lambda: ulna.sim.simulate(arm, wave, human=ulna.sim.Human(tremor_n=1.0)), 5)
    theirs = best(
        lambda: peer_simulation.simulate(
            arm, wave, kp=3000, kd=120, centre=np.array([0.383, 0.0]), tremor_n=1.0, seed=1
        ),
        1,
    )
    return [
        ("a simulated experiment of 50 s on the planar robot, 1 kHz", f"{1e3 * ours:.0f} ms"),
        ("the same loop by SciPy's solve_ivp", f"{theirs:.1f} s, {theirs / ours:.0f} times as long"),
    ]


def model_speed() -> list[tuple[str, str]]:
    """The system of Rao and Garnier: four poles, one zero, 7161 samples, 10 dB."""
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 1023), 7)
    clean = ulna.models.simulate(
        [-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0], u, rate_hz=100.0
    )
    y = clean + clean.std() / np.sqrt(10) * rng.standard_normal(len(u))
    order = {"poles": 4, "zeros": 1, "held_out": 0, "initial": "rest", "offset": False}
    ours = best(
        lambda: ulna.models.identify_transfer_function(u, y, rate_hz=100.0, **order), 20
    )
    theirs = best(lambda: peer_models.srivc(u, y, 100.0, 4, 1), 3)
    return [
        ("a transfer function of 4 poles from 7161 samples (SRIVC)", f"{1e3 * ours:.1f} ms"),
        (
            "the same in a NumPy and SciPy script",
            f"{1e3 * theirs:.0f} ms, {theirs / ours:.0f} times as long",
        ),
    ]


def table() -> str:
    """Both as Markdown."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ulna.UncertainResult)
        rows = accuracy() + speed()
    lines = ["| | |", "|---|---|", *(f"| {what} | {value} |" for what, value in rows), ""]
    lines.append(f"Times: one thread of a machine with {os.cpu_count()} cores, best of several.")
    return "\n".join(lines)


def excerpt() -> str:
    """What `make demo` prints, without the details."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        ulna_command(["assess", str(ROOT / "examples" / "data" / "relaxed-arm.csv")])
    lines = out.getvalue().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("Data"))
    last = next(i for i, line in enumerate(lines) if line.startswith("Passivity"))
    shown = [*lines[:first], "...", *lines[last : last + 4], "...", "report: out/demo/report.html"]
    return "\n".join(["```text", *(line.rstrip() for line in shown), "```"])


def put(readme: str, name: str, text: str) -> str:
    """The README with what stands between two marks replaced."""
    begin, end = f"<!-- {name}: examples/python/readme_numbers.py -->", f"<!-- end of {name} -->"
    before, rest = readme.split(begin, 1)
    return f"{before}{begin}\n{text}\n{end}{rest.split(end, 1)[1]}"


def main() -> int:
    """Print the table, and with --write put it into the README."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="replace what README.md shows")
    options = parser.parse_args()
    text = table()
    print(text)
    if options.write:
        path = ROOT / "README.md"
        readme = put(path.read_text(encoding="utf-8"), "numbers", text)
        path.write_text(put(readme, "output", excerpt()), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
