"""The steps of identify_impedance as a laboratory would script them with NumPy and SciPy.

Two things use it: the benchmark, as the peer to be faster than, and the tests, as an independent
reference. It does less than the library: no conditioning, no check for a lag, no share of motion.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, savgol_filter, sosfiltfilt


def prepare(
    signals, derivatives, *, rate_hz, lowpass_hz=5.0, window=101, order=6, smooth=savgol_filter
):
    """Smoothed columns and, where asked for, their first and second derivatives; ends cut off."""
    half = (window - 1) // 2
    sos = butter(5, lowpass_hz, fs=rate_hz, output="sos")
    out = []
    for derivative in range(derivatives + 1):
        columns = [
            smooth(column, window, order, deriv=derivative, delta=1 / rate_hz)[half:-half]
            for column in signals.T
        ]
        out.append(np.column_stack([sosfiltfilt(sos, column) for column in columns]))
    return out


def newey_west(scores, bread, lag):
    """Covariance of the parameters: a direct loop over the lags with Bartlett weights."""
    meat = scores.T @ scores
    for step in range(1, lag + 1):
        cross = scores[step:].T @ scores[:-step]
        meat += (1 - step / (lag + 1)) * (cross + cross.T)
    return bread @ meat @ bread.T


def identify(time, position, force, reference=None, *, train_s=40.0, lag_s=0.4, **filters):
    """Estimates by least squares and, with a reference, by instrumental variables.

    Returns {"ls": (theta, covariance, vaf), "iv": ...}: theta is (3 n + 1, n), the rows those of
    inertia, damping, stiffness (each transposed) and the constant; the covariance is of its columns
    one after the other.
    """
    rate_hz = 1 / (time[1] - time[0])
    x, v, a = prepare(position, 2, rate_hz=rate_hz, **filters)
    (f,) = prepare(force, 0, rate_hz=rate_hz, **filters)
    cut = (len(time) - len(x)) // 2
    train = time[cut : len(time) - cut] < train_s - 0.5 / rate_hz
    one = np.ones((len(x), 1))
    regressors = np.hstack([a, v, x - x[train].mean(0), one])
    phi, y = regressors[train], -f[train]
    instruments = {"ls": phi}
    if reference is not None:
        r, r1, r2 = prepare(reference, 2, rate_hz=rate_hz, **filters)
        instruments["iv"] = np.hstack([r2, r1, r - r[train].mean(0), one])[train]
    out = {}
    for name, z in instruments.items():
        if name == "ls":
            theta = np.linalg.lstsq(phi, y, rcond=None)[0]
        else:
            theta = np.linalg.solve(z.T @ phi, z.T @ y)
        error = y - phi @ theta
        scores = np.hstack([z * error[:, [i]] for i in range(y.shape[1])])
        bread = np.kron(np.eye(y.shape[1]), np.linalg.inv(z.T @ phi))
        covariance = newey_west(scores, bread, round(lag_s * rate_hz))
        fresh = ~train
        left = -f[fresh] - regressors[fresh] @ theta
        vaf = 100 * (1 - left.var(0) / f[fresh].var(0))
        out[name] = theta, covariance, vaf
    return out
