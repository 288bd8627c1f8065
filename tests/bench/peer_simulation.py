"""The relaxed loop as one writes it with NumPy and SciPy: a state equation for solve_ivp.

The controller is continuous here, not sampled, so that the solver may choose its steps; the arm, the
robot and the tremor are the same. The tremor is made beforehand and interpolated.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

ALPHA = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)
LINKS = (0.254, 0.2667)


def simulate(arm, reference, *, kp, kd, centre, tremor_n, seed, rate_hz=1000.0):
    """Position, force by the human and reference, each (rows, 2); rtol 1e-6."""
    a1, a2, a3, a4, a5 = ALPHA
    d1, d2 = LINKS
    m, b, k, x0 = arm.M, arm.B, arm.K, arm.x0_m
    rows = len(reference)
    rng = np.random.default_rng(seed)
    pole = np.exp(-2 * np.pi * 2.0 / rate_hz)
    noise = lfilter([1 - pole], [1, -pole], rng.normal(size=(rows, 2)), axis=0)
    own = tremor_n * noise / noise.std(axis=0)
    slope = np.gradient(reference, 1 / rate_hz, axis=0)

    def at(table, t):
        i = min(max(int(t * rate_hz), 0), rows - 2)
        part = t * rate_hz - i
        return table[i] + part * (table[i + 1] - table[i])

    def motion(t, s):
        (q1, q2), w = s[:2], s[2:]
        s1, c1, s2, c2 = np.sin(q1), np.cos(q1), np.sin(q2), np.cos(q2)
        x = np.array([d1 * c1 + d2 * s2, d1 * s1 - d2 * c2])
        j = np.array([[-d1 * s1, d2 * c2], [d1 * c1, d2 * s2]])
        j_rate = np.array([[-d1 * c1 * w[0], -d2 * s2 * w[1]], [-d1 * s1 * w[0], d2 * c2 * w[1]]])
        v = j @ w
        pull = kp * (at(reference, t) + centre - x) + kd * (at(slope, t) - v)
        force = at(own, t) - b @ v - k @ (x - x0)
        coupling, turn = -0.5 * a2 * np.sin(q1 - q2), 0.5 * a2 * np.cos(q1 - q2)
        total = np.array([[a1, coupling], [coupling, a3]]) + j.T @ m @ j
        friction = np.array([turn * w[1] ** 2 + a4 * w[0], -turn * w[0] ** 2 + a5 * w[1]])
        acceleration = np.linalg.solve(total, j.T @ (pull + force - m @ (j_rate @ w)) - friction)
        return x, force - m @ (j @ acceleration + j_rate @ w), acceleration

    distance = np.hypot(*centre)
    q1 = np.arccos((distance**2 + d1**2 - d2**2) / (2 * d1 * distance)) + np.arctan2(*centre[::-1])
    q2 = q1 + np.arccos((d1**2 + d2**2 - distance**2) / (2 * d1 * d2)) - np.pi / 2
    times = np.arange(rows) / rate_hz
    solved = solve_ivp(
        lambda t, s: np.concatenate([s[2:], motion(t, s)[2]]),
        (0, times[-1]),
        [q1, q2, 0, 0],
        t_eval=times,
        rtol=1e-6,
        atol=1e-9,
        max_step=5e-3,
    )
    seen = [motion(t, s)[:2] for t, s in zip(times, solved.y.T, strict=True)]
    position, force = (np.array(v) for v in zip(*seen, strict=True))
    position += 2e-6 * rng.normal(size=position.shape)
    force += rng.normal(size=force.shape) / 24
    return np.round(position / 2e-6) * 2e-6, np.round(force * 24) / 24, reference + centre
