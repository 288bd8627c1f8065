"""The same estimates in NumPy and SciPy, as a practitioner writes them.

``srivc`` is the simplified refined instrumental variable method with filters from
``scipy.signal.cont2discrete``; ``output_error`` gives the simulation to ``scipy.optimize.least_squares``.
Both start from state-variable filters of the same cut-offs as the library.
"""

import numpy as np
from scipy import optimize, signal


def filtered(top, den, x, rate_hz, hold):
    b, a, _ = signal.cont2discrete((top, den), 1 / rate_hz, hold)
    return signal.lfilter(b[0], a, x)


def derivatives(den, count, x, rate_hz, hold):
    """p^(count-1)/A x ... x/A."""
    return np.column_stack(
        [filtered(np.eye(count)[i], den, x, rate_hz, hold) for i in range(count)]
    )


def simulate(num, den, u, rate_hz):
    return filtered(num, den, u, rate_hz, "zoh")


def stable(den):
    roots = np.roots(den)
    return np.real(np.poly(np.where(roots.real > 0, -roots.conj(), roots)))


def regression(filter_den, u, y, rate_hz, n, m):
    fy = derivatives(filter_den, n, y, rate_hz, "foh")
    fu = derivatives(filter_den, m + 1, u, rate_hz, "zoh")
    highest = y - fy @ filter_den[1:]
    return np.hstack([-fy, fu]), highest


def starts(u, y, rate_hz, n, m):
    high = 0.5 * np.pi * rate_hz
    cutoffs = np.geomspace(4 * np.pi * rate_hz / len(u), high, 5)
    found = []
    for cutoff in cutoffs:
        phi, highest = regression(np.poly([-cutoff] * n), u, y, rate_hz, n, m)
        theta = np.linalg.lstsq(phi, highest, rcond=None)[0]
        den = stable(np.concatenate([[1.0], theta[:n]]))
        num = theta[n:]
        error = y - simulate(num, den, u, rate_hz)
        found.append((error @ error, num, den))
    return min(found, key=lambda start: start[0])


def srivc(u, y, rate_hz, n, m, iterations=50):
    _, num, den = starts(u, y, rate_hz, n, m)
    theta = np.concatenate([den[1:], num])
    for _ in range(iterations):
        phi, highest = regression(den, u, y, rate_hz, n, m)
        clean = simulate(num, den, u, rate_hz)
        z, _ = regression(den, u, clean, rate_hz, n, m)
        before, theta = theta, np.linalg.solve(z.T @ phi, z.T @ highest)
        den, num = stable(np.concatenate([[1.0], theta[:n]])), theta[n:]
        if np.max(np.abs(theta / before - 1)) < 1e-5:
            break
    return num, den


def output_error(u, y, rate_hz, n, m):
    _, num, den = starts(u, y, rate_hz, n, m)
    scale = np.concatenate([den[1:], num])

    def residual(x):
        theta = x * scale
        return y - simulate(theta[n:], np.concatenate([[1.0], theta[:n]]), u, rate_hz)

    theta = optimize.least_squares(residual, np.ones(n + m + 1), method="lm").x * scale
    return theta[n:], np.concatenate([[1.0], theta[:n]])
