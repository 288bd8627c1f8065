"""The parallel cascade in NumPy and SciPy: what a user would write who knows the method.

Variable projection over frequency, damping ratio and delay by `scipy.optimize.least_squares`, from the
same starts as the library, then the profile over the same delays and the Newey-West covariance.
"""

import numpy as np
from scipy import optimize, signal


def prepared(x, torque, rate, *, cutoff_hz=50.0, window=11, order=6):
    """Position, velocity, acceleration, torque and rectified velocity, smoothed alike."""
    sos = signal.butter(5, cutoff_hz, fs=rate, output="sos")

    def smooth(values):
        return signal.sosfiltfilt(sos, values)

    def differentiate(values, derivative):
        return smooth(signal.savgol_filter(values, window, order, deriv=derivative, delta=1 / rate))

    x, v, a = (differentiate(x, k) for k in range(3))
    y = -differentiate(torque, 0)
    return x - x.mean(), v, a, y, smooth(np.maximum(v, 0.0))


class Cascade:
    """Residual of the best linear parameters for given dynamics and delay."""

    def __init__(self, signals, rate, rows, stride=4):
        x, v, a, y, self.drive = signals
        self.rate = rate
        self.rows = np.arange(rows.start, rows.stop, stride)
        linear = np.column_stack([a, v, x, np.ones_like(x)])[self.rows]
        self.basis = np.linalg.qr(linear)[0]
        self.linear = linear
        self.y = y[self.rows]
        self.left = self.y - self.basis @ (self.basis.T @ self.y)

    def column(self, q):
        w, z, delay = np.exp(q[0]), np.exp(q[1]), q[2]
        b, a, _ = signal.cont2discrete(([w * w], [1, 2 * z * w, w * w]), 1 / self.rate, "foh")
        response = signal.lfilter(np.ravel(b), a, self.drive)
        return np.interp(self.rows - delay * self.rate, np.arange(len(response)), response)

    def residual(self, q):
        column = self.column(q)
        column = column - self.basis @ (self.basis.T @ column)
        return self.left - column * (column @ self.left) / (column @ column)

    def fit(self, start, low, high):
        return optimize.least_squares(
            self.residual, start, bounds=(low, high), x_scale=[0.3, 0.3, 0.01], diff_step=1e-4
        )

    def covariance(self, q, lag):
        columns = np.column_stack([self.linear, self.column(q)])
        theta = np.linalg.lstsq(columns, self.y, rcond=None)[0]
        steps = np.diag([1e-3, 1e-3, 1e-4])
        slopes = [
            theta[-1] * (self.column(q + s) - self.column(q - s)) / (2 * s.max()) for s in steps
        ]
        jacobian = np.column_stack([columns, *slopes])
        scores = jacobian * (self.y - columns @ theta)[:, None]
        meat = scores.T @ scores
        for k in range(1, lag + 1):
            part = scores[k:].T @ scores[:-k]
            meat += (1 - k / (lag + 1)) * (part + part.T)
        bread = np.linalg.inv(jacobian.T @ jacobian)
        return bread @ meat @ bread


def identify(x, torque, rate, *, train_s=40.0, delays=25):
    """Dynamics, delay, covariance and profile from arrays."""
    signals = prepared(x, torque, rate)
    cascade = Cascade(signals, rate, slice(200, int(train_s * rate)))
    low = np.array([0.0, np.log(0.1), 0.0])
    high = np.array([np.log(2 * np.pi * 62), np.log(5.0), 0.12])
    starts = [
        np.array([np.log(w), np.log(0.8), d]) for w in (6, 15, 45) for d in (0.01, 0.04, 0.08)
    ]
    starts.sort(key=lambda q: np.sum(cascade.residual(q) ** 2))
    best = min((cascade.fit(q, low, high) for q in starts[:2]), key=lambda found: found.cost)
    profile = []
    for delay in np.linspace(0.0, 0.12, delays):
        held = optimize.least_squares(
            lambda p, d=delay: cascade.residual(np.array([*p, d])),
            best.x[:2], bounds=(low[:2], high[:2]), x_scale=[0.3, 0.3], diff_step=1e-4,
        )  # fmt: skip
        profile.append(2 * held.cost)
    return best.x, cascade.covariance(best.x, int(0.4 * rate / 4)), np.array(profile)
