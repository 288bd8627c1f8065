"""Passivity of linear systems beside python-control's linear matrix inequality.

The peer is asked the same: is it passive, and its two indices (it has no relative index and cannot
take improper systems or poles on the axis). Here one call gives all of that and the relative index.
"""

import time

import numpy as np
import pytest
import ulna

control = pytest.importorskip("control")
pytest.importorskip("cvxopt")

LEAST = 20.0


def collocated(ports, states, seed):
    """Damped, with direct feedthrough and C near to B': passive, and the inequality is well posed."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(states, states))
    a = a - a.T - np.diag(rng.uniform(0.3, 2.0, states))
    b = rng.normal(size=(states, ports))
    c = b.T + 0.1 * rng.normal(size=(ports, states))
    return a, b, c, np.diag(rng.uniform(0.6, 1.0, ports))


SYSTEMS = {
    "one port, order 2": collocated(1, 2, 1),
    "one port, order 6": collocated(1, 6, 2),
    "two ports, order 4": collocated(2, 4, 3),
    "three ports, order 8": collocated(3, 8, 4),
}


def mine(parts):
    return ulna.passivity.indices(ulna.StateSpace(*parts))


def theirs(parts):
    system = control.ss(*parts)
    return (
        control.ispassive(system),
        control.get_input_ff_index(system),
        control.get_output_fb_index(system),
    )


@pytest.mark.parametrize("name", SYSTEMS)
def test_ulna(benchmark, name):
    benchmark.group = f"passivity: {name}"
    assert benchmark(mine, SYSTEMS[name]).verdict == "passive"


@pytest.mark.parametrize("name", SYSTEMS)
def test_python_control(benchmark, name):
    benchmark.group = f"passivity: {name}"
    assert benchmark.pedantic(theirs, (SYSTEMS[name],), rounds=5)[0]


def seconds(function, parts):
    begin = time.perf_counter()
    function(parts)
    return time.perf_counter() - begin


@pytest.mark.parametrize("name", SYSTEMS)
def test_ratio(say, name):
    parts = SYSTEMS[name]
    passive, nu, rho = theirs(parts)
    found = mine(parts)
    assert passive and found.verdict == "passive"
    # An interior-point solver stops some 1e-6 short.
    assert found.input == pytest.approx(nu, abs=1e-5)
    assert found.output == pytest.approx(rho, abs=1e-5)
    # By turns, so that what else the machine does slows both.
    rounds = [
        (seconds(theirs, parts), min(seconds(mine, parts) for _ in range(10))) for _ in range(8)
    ]
    ratio = min(peer for peer, _ in rounds) / min(own for _, own in rounds)
    say(f"passivity indices, {name}: {ratio:.0f} times as fast as python-control")
    assert ratio >= LEAST
