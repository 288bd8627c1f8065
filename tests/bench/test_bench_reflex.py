"""The parallel cascade with its delay's profile and errors, beside the same in NumPy and SciPy.

60 s at 1 kHz, 40 s identify. Both sides smooth and differentiate, search dynamics and delay from the
same starts, give Newey-West errors and the profile over 25 delays. The library also tests whether
there is a reflex, validates with an interval, and makes the past before the record part of the fit; the
peer does not. One thread.
"""

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import ulna

pytest.importorskip("scipy")
import peer_reflex  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
from test_reflex import TRUTH, simulate  # noqa: E402

best = {}


@pytest.fixture(scope="module")
def record():
    return simulate(noise=0.3, seed=3)


def test_ulna(benchmark, record):
    def run():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ulna.UncertainResult)
            return ulna.identify_reflex(
                record, "tau", "q", side="rising", lowpass_hz=50, reflex_irf_s=0, threads=1
            )

    found = benchmark.pedantic(run, rounds=3, warmup_rounds=1)
    assert found.delay_s == pytest.approx(TRUTH["delay"], abs=0.01)
    best["ulna"] = benchmark.stats.stats.min


def test_peer(benchmark, record, say):
    x, torque = np.array(record["q"]), np.array(record["tau"])
    run = benchmark.pedantic(
        lambda: peer_reflex.identify(x, torque, 1000.0), rounds=2, warmup_rounds=0
    )
    assert run[0][2] == pytest.approx(TRUTH["delay"], abs=0.01)
    if "ulna" in best:
        say(
            f"parallel cascade: {benchmark.stats.stats.min / best['ulna']:.1f} times NumPy and SciPy"
        )
