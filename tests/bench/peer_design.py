"""Designs as a laboratory would script them with NumPy and SciPy."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lsim


def multisine(lines_hz, phases, *, rate_hz, duration_s):
    """Sum of cosines and its first two derivatives, (3, rows)."""
    t = np.arange(round(duration_s * rate_hz)) / rate_hz
    out = np.zeros((3, len(t)))
    for f, phase in zip(lines_hz, phases, strict=True):
        w = 2 * np.pi * f
        angle = w * t + phase
        out[0] += np.cos(angle)
        out[1] -= w * np.sin(angle)
        out[2] -= w * w * np.cos(angle)
    return out


def low_crest_phases(lines_hz, start, *, span_s):
    """The same L_2p descent, with the gradient, through scipy.optimize.minimize."""
    points = int(16 * max(lines_hz) * span_s)
    t = span_s * np.arange(points) / points
    angle = 2 * np.pi * np.outer(t, lines_hz)

    def cost(phase, p):
        wave = angle + phase
        u = np.cos(wave).sum(axis=1)
        scale = np.abs(u).max()
        ratio = u / scale
        total = np.sum(ratio ** (2 * p))
        slope = -(2 * p / scale) * (ratio ** (2 * p - 1)) @ np.sin(wave)
        return np.log(total) / (2 * p) + np.log(scale), slope / (2 * p * total)

    for p in (2, 4, 8, 16, 32, 64, 128):
        start = minimize(cost, start, args=(p,), jac=True, method="BFGS", options={"maxiter": 25}).x
    return start


def peaks(reference, rate, *, arm, kp, kd, mass, rate_hz):
    """Largest force, displacement and velocity of arm and robot, by scipy.signal.lsim."""
    n = arm.n
    inverse = np.linalg.inv(arm.M + mass * np.eye(n))
    a = np.block([
        [np.zeros((n, n)), np.eye(n)],
        [-inverse @ (arm.K + kp * np.eye(n)), -inverse @ (arm.B + kd * np.eye(n))],
    ])  # fmt: skip
    b = np.vstack([np.zeros((n, n)), inverse])
    force = np.hstack([-arm.M @ a[n:] - np.hstack([arm.K, arm.B])])
    c = np.vstack([np.eye(2 * n), force])
    d = np.vstack([np.zeros((2 * n, n)), -arm.M @ inverse])
    t = np.arange(len(reference)) / rate_hz
    _, y, _ = lsim((a, b, c, d), kp * reference + kd * rate, t)
    return [np.linalg.norm(y[:, k : k + n], axis=1).max() for k in (2 * n, 0, n)]
