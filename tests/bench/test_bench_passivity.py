"""Passivity of a two-port of order four, beside python-control's linear matrix inequality.

The peer is asked the same: is it passive, and its two indices (it has no relative index and cannot
take improper systems or poles on the axis). Here one call gives all of that and the relative index.
"""

import time

import numpy as np
import pytest
import ulna

control = pytest.importorskip("control")
pytest.importorskip("cvxopt")

# Damped, and with direct feedthrough: the peer's inequality is well posed.
A = np.array([[-1.0, 2.0, 0, 0], [-2.0, -1.0, 0, 0], [0, 0, -0.4, 3.0], [0, 0, -3.0, -0.4]])
B = np.array([[1.0, 0.0], [0.2, 0.5], [0.0, 1.0], [0.3, 0.1]])
C = B.T + np.array([[0.0, 0.1, 0.0, 0.2], [0.0, 0.0, 0.1, 0.0]])
D = np.array([[0.6, 0.1], [0.0, 0.8]])
LEAST = 20.0


def mine():
    return ulna.passivity.indices(ulna.StateSpace(A, B, C, D))


def theirs():
    system = control.ss(A, B, C, D)
    return (
        control.ispassive(system),
        control.get_input_ff_index(system),
        control.get_output_fb_index(system),
    )


@pytest.mark.benchmark(group="passivity of a two-port of order four")
def test_ulna(benchmark):
    assert benchmark(mine).verdict == "passive"


@pytest.mark.benchmark(group="passivity of a two-port of order four")
def test_python_control(benchmark):
    assert benchmark.pedantic(theirs, rounds=5)[0]


def best_of(function, rounds):
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def test_ratio(say):
    passive, nu, rho = theirs()
    found = mine()
    assert passive and found.verdict == "passive"
    # An interior-point solver stops some 1e-6 short.
    assert found.input == pytest.approx(nu, abs=1e-5)
    assert found.output == pytest.approx(rho, abs=1e-5)
    ratio = best_of(theirs, 5) / best_of(mine, 50)
    say(f"passivity indices: {ratio:.0f} times as fast as python-control")
    assert ratio >= LEAST
