"""Linear systems: arithmetic against the response itself, and what other packages hand over."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import ulna
from ulna import systems

OMEGA = np.array([0.0, 0.3, 1.0, 7.0])


def response(num, den, omega):
    s = 1j * np.asarray(omega)
    return np.polyval(num, s) / np.polyval(den, s)


def test_response_of_a_transfer_function():
    h = ulna.TransferFunction([2, 0, 1], [1, 3, 3, 1])
    assert np.allclose(h.frequency_response(OMEGA), response([2, 0, 1], [1, 3, 3, 1], OMEGA))
    assert h.frequency_response(1.0).shape == ()
    assert h.frequency_response(OMEGA.reshape(2, 2)).shape == (2, 2)
    assert h.inputs == h.outputs == 1 and h.is_proper
    assert np.allclose(np.sort(h.poles().real), -1, atol=1e-4)  # a triple pole: eps ** (1/3)
    assert np.allclose(h.zeros() ** 2, -0.5)


def test_response_of_a_matrix():
    num = [[[1], [2, 1]], [[3], [4]], [[1, 0, 0], [5]]]
    den = [[[1, 1], [1, 2]], [[1, 3], [1, 4]], [[1, 5], [1, 6]]]
    h = ulna.TransferFunction(num, den)
    assert (h.outputs, h.inputs, h.is_proper) == (3, 2, False)
    values = h.frequency_response(OMEGA)
    assert values.shape == (4, 3, 2)
    for i in range(3):
        for j in range(2):
            assert np.allclose(values[:, i, j], response(num[i][j], den[i][j], OMEGA))
    space = h.to_state_space()
    assert np.allclose(space.frequency_response(OMEGA), values)
    s = 1j * OMEGA[2]
    by_hand = space.C @ np.linalg.solve(s * space.E - space.A, space.B) + space.D
    assert np.allclose(by_hand, values[2])


def test_a_common_denominator():
    h = ulna.TransferFunction([[[1], [0]], [[0], [2]]], [1, 3])
    assert np.allclose(h.frequency_response(0.0), np.diag([1 / 3, 2 / 3]))
    assert h.to_state_space().states == 2


def test_sums_products_and_loops():
    x, y = ulna.TransferFunction([1, 2], [1, 3, 7]), ulna.TransferFunction([4, 0], [1, 5])
    a, b = x.frequency_response(OMEGA), y.frequency_response(OMEGA)
    for p, q in ((x, y), (x.to_state_space(), y), (x, y.to_state_space())):
        for made, wanted in (
            (p + q, a + b),
            (p - q, a - b),
            (p * q, a * b),
            (-p, -a),
            (2 * p, 2 * a),
            (p * 2, 2 * a),
            (1 + p, 1 + a),
            (1 - p, 1 - a),
            (p.feedback(q), a / (1 + a * b)),
        ):
            assert np.allclose(made.frequency_response(OMEGA), wanted, atol=1e-13)
    matrix = ulna.TransferFunction([[[1], [2]], [[3], [4]]], [1, 1])
    assert np.allclose((np.eye(2) + matrix).frequency_response(0.0), [[2, 2], [3, 5]])


def test_pickle():
    h = ulna.TransferFunction([[[1, 2], [0]], [[3], [4, 5, 6]]], [[[1, 1], [1]], [[1, 3], [2, 1]]])
    again = pickle.loads(pickle.dumps(h))
    assert np.array_equal(again.frequency_response(OMEGA), h.frequency_response(OMEGA))
    space = pickle.loads(pickle.dumps(h.to_state_space()))
    assert np.allclose(space.frequency_response(OMEGA), h.frequency_response(OMEGA))


def test_leading_zeros_and_shared_powers_of_s():
    h = ulna.TransferFunction([0, 0, 1, 0], [0, 2, 0])
    assert repr(h) == "TransferFunction([1], [2])"
    assert repr(ulna.TransferFunction([0, 0], [1, 2])) == "TransferFunction([0], [1])"


def test_systems_of_scipy():
    signal = pytest.importorskip("scipy.signal")
    num, den = [1.0, 2.0], [1.0, 3.0, 5.0]
    wanted = response(num, den, OMEGA)
    for given in (
        signal.lti(num, den),
        signal.TransferFunction(num, den),
        signal.TransferFunction(num, den).to_ss(),
        signal.TransferFunction(num, den).to_zpk(),
    ):
        assert np.allclose(systems.as_system(given).frequency_response(OMEGA), wanted)
    with pytest.raises(ulna.ArgumentError, match="discrete time"):
        systems.as_system(signal.TransferFunction(num, den, dt=0.1))


def test_systems_of_python_control():
    control = pytest.importorskip("control")
    num, den = [1.0, 2.0], [1.0, 3.0, 5.0]
    wanted = response(num, den, OMEGA)
    for given in (control.tf(num, den), control.tf2ss(num, den), control.zpk([-2], np.roots(den), 1)):
        assert np.allclose(systems.as_system(given).frequency_response(OMEGA), wanted)
    matrix = control.tf([[[1], [2]], [[3], [4]]], [[[1, 1], [1, 2]], [[1, 3], [1, 4]]])
    found = systems.as_system(matrix).frequency_response(2.0)
    assert np.allclose(found, matrix(2j))
    for step in (0.1, True):
        with pytest.raises(ulna.ArgumentError, match="discrete time"):
            systems.as_system(control.tf(num, den, step))


def test_gains():
    assert np.allclose(systems.as_system(3.0).frequency_response(1.0), 3)
    assert np.allclose(systems.as_system([[1, 2], [3, 4]]).frequency_response(1.0), [[1, 2], [3, 4]])


def test_an_impedance_is_improper():
    m, b, k = np.diag([1.0, 2.0]), np.array([[3.0, 1.0], [0.0, 4.0]]), np.diag([5.0, 6.0])
    z = systems.impedance(m, b, k)
    assert np.allclose(z.frequency_response(2.0), 2j * m + b + k / 2j)
    assert not z.is_proper
    assert np.allclose(z.to_state_space().frequency_response(2.0), 2j * m + b + k / 2j)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_far_scales(scale):
    h = ulna.TransferFunction([scale, 0], [1 / scale, 0.2, scale])
    omega = scale * np.array([0.1, 1.0, 10.0])
    wanted = response([scale, 0], [1 / scale, 0.2, scale], omega)
    assert np.allclose(h.frequency_response(omega), wanted, rtol=1e-10)
    assert np.allclose(h.to_state_space().frequency_response(omega), wanted, rtol=1e-10)
    assert np.allclose(np.abs(h.poles()), scale, rtol=1e-10)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ulna.TransferFunction([], [1]),
        lambda: ulna.TransferFunction([1], []),
        lambda: ulna.TransferFunction([1], [0, 0]),
        lambda: ulna.TransferFunction([np.nan], [1]),
        lambda: ulna.TransferFunction([1], [np.inf, 1]),
        lambda: ulna.TransferFunction([1j], [1]),
        lambda: ulna.TransferFunction("s", [1]),
        lambda: ulna.TransferFunction([[1, 2], [3, 4]], [1, 1]),
        lambda: ulna.TransferFunction([[[1], [2]], [[3]]], [1, 1]),
        lambda: ulna.TransferFunction([[[1], [2]]], [[[1, 1]]]),
        lambda: ulna.TransferFunction([[[1], []]], [1, 1]),
        lambda: ulna.StateSpace([[1]], [[1]], [[1]], []),
        lambda: ulna.StateSpace([[1, 2]], [[1]], [[1]], [[0]]),
        lambda: ulna.StateSpace([[1]], [[1], [2]], [[1]], [[0]]),
        lambda: ulna.StateSpace([[1]], [[1]], [[1, 2]], [[0]]),
        lambda: ulna.StateSpace([[np.nan]], [[1]], [[1]], [[0]]),
        lambda: ulna.StateSpace([[0]], [[1]], [[1]], [[0]], E=[[0]]),
        lambda: ulna.StateSpace([[1]], [[1]], [[1]], [[0]], E=np.eye(2)),
        lambda: systems.as_system("nothing"),
        lambda: systems.as_system(None),
        lambda: systems.as_system(np.ones((2, 2, 2))),
        lambda: systems.impedance(np.eye(2), np.eye(3), np.eye(2)),
        lambda: ulna.TransferFunction([1], [1, 1]) + ulna.TransferFunction([[[1]] * 2] * 2, [1, 1]),
        lambda: ulna.TransferFunction([1], [1, 1]) * "gain",
        lambda: ulna.TransferFunction([[[1], [2]]], [1, 1]).zeros(),
        lambda: ulna.TransferFunction([0], [1]).zeros(),
    ],
)
def test_bad_systems(make):
    with pytest.raises(ulna.Error) as caught:
        make()
    words = str(caught.value)
    assert "\n" not in words and not words.endswith(".") and len(words) > 10
