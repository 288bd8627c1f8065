"""A trial of 50 s at 1 kHz of the relaxed loop, beside the same loop by SciPy's solve_ivp.

The promise is 0.1 s for one trial. The peer's controller is continuous and its right-hand side is
NumPy; both make tremor, noise and quantisation.
"""

import numpy as np
import pytest

from ulna import sim

pytest.importorskip("scipy")
import peer_simulation  # noqa: E402

best = {}
ARM = sim.arms("5.6")["Method 1"]


@pytest.fixture(scope="module")
def reference():
    rng = np.random.default_rng(0)
    t = np.arange(50_000) / 1000
    waves = [
        sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) for f in np.arange(1, 11) * 0.3 - a)
        for a in (0.0, 0.15)
    ]
    return 0.002 * np.transpose(waves)


def ours(reference, **keywords):
    robot = sim.Robot(kp_n_m=3000, kd_n_s_m=120)
    return sim.simulate(ARM, reference, robot=robot, human=sim.Human(tremor_n=1.0), **keywords)


@pytest.mark.benchmark(group="simulated trial: 50 s, 1 kHz, 2 axes")
def test_ulna(benchmark, reference):
    log = benchmark(lambda: ours(reference))
    best["ulna"] = benchmark.stats.stats.min
    assert len(log.time) == 50_000
    assert best["ulna"] < 0.1


@pytest.mark.benchmark(group="simulated trial: 50 s, 1 kHz, 2 axes")
def test_solve_ivp(benchmark, reference, say):
    def run():
        return peer_simulation.simulate(
            ARM, reference, kp=3000, kd=120, centre=np.array([0.383, 0.0]), tremor_n=0.0, seed=1
        )

    position, _, _ = benchmark.pedantic(run, rounds=1, iterations=1)
    # The same motion, but for the sampled control and the start: 1 ms of delay in a 5 mm motion.
    log = sim.simulate(ARM, reference, sensors=sim.Sensors.exact(), settle_s=0)
    moved = np.column_stack([log["x"], log["y"]])[5000:] - position[5000:]
    assert np.abs(moved).max() < 2e-4
    ratio = benchmark.stats.stats.min / best["ulna"]
    say(f"simulated trial: solve_ivp takes {ratio:.0f} times as long")
    assert ratio > 20


@pytest.mark.benchmark(group="simulated trials: 40 of 50 s")
def test_batch(benchmark, reference):
    benchmark.pedantic(
        lambda: sim.batch(ARM, reference, runs=40, human=sim.Human(tremor_n=1.0)), rounds=1
    )
