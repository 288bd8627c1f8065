"""A Gaussian process in place of a slow function (needs scikit-learn)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from ._call import AnalysisError
from ._factors import Factor, LogUniform
from .record import refuse

MOST_RUNS = 1000  # the cost grows with their third power
LEAST_Q2 = 0.8


def coordinate(factor: Factor, values: np.ndarray) -> np.ndarray:
    """A factor's values on the scale on which it is spread evenly."""
    return np.log(values) if isinstance(factor, LogUniform) else values


def check_runs(factors: int, runs: int) -> None:
    """Refuse so many runs as an emulator cannot be made of, or that there be one at all."""
    try:
        import sklearn  # noqa: F401
    except ImportError as failure:
        raise ImportError(
            "an emulator needs scikit-learn: install it with `pip install ulna[gp]`"
        ) from failure
    needed = max(16, 4 * (factors + 1))
    if not needed <= runs <= MOST_RUNS:
        raise refuse(
            f"an emulator of {factors} factors takes {needed} to {MOST_RUNS} good runs of a plain "
            f"sample, got {runs}",
            "n",
        )


class Emulator:
    """One output of a study, predicted from good runs of a plain sample.

    A straight line, a smooth deviation from it and noise, all in one Gaussian process; `q2` is the
    share of the output's variance that it predicts at runs it is not told of (leave-one-out), and
    `widened` what its standard errors are multiplied by because they were too small there.
    """

    def __init__(
        self, factors: Sequence[Factor], x: np.ndarray, y: np.ndarray, *, name: str, seed: int
    ) -> None:
        check_runs(len(factors), len(y))
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel

        self.factors = tuple(factors)
        points = self._points(x)
        self.middle, self.scale = points.mean(axis=0), points.std(axis=0)
        self.scale[self.scale == 0] = 1.0
        self.mean, self.deviation = float(np.mean(y)), float(np.std(y))
        self.q2, self.widened = 1.0, 1.0
        self.process: Any = None
        if self.deviation <= 1e-12 * max(1.0, abs(self.mean)):
            return  # constant: nothing to learn
        lengths = np.full(len(factors), 2.0)
        kernel = (
            ConstantKernel(1.0, (1e-4, 1e4)) * DotProduct(1.0, (1e-3, 1e3))
            + ConstantKernel(0.1, (1e-8, 1e4)) * RBF(lengths, (0.05, 1e3))
            + WhiteKernel(1e-4, (1e-10, 1e1))
        )
        self.process = GaussianProcessRegressor(kernel, random_state=seed % 2**32)
        z = (y - self.mean) / self.deviation
        with warnings.catch_warnings():
            # A parameter at its bound means that a factor does nothing, or that there is no noise.
            warnings.simplefilter("ignore", ConvergenceWarning)
            self.process.fit((points - self.middle) / self.scale, z)
        # Leave-one-out in closed form: Rasmussen and Williams (2006), (5.12).
        factor = np.linalg.inv(self.process.L_)
        inverse = factor.T @ factor
        missed = (inverse @ z) / np.diag(inverse)
        self.q2 = 1.0 - float(np.mean(missed**2))
        if self.q2 < LEAST_Q2:
            raise AnalysisError(
                f"the emulator predicts {100 * max(self.q2, 0.0):.0f} % of the variance of {name} "
                f"at runs it is not told of, {100 * LEAST_Q2:.0f} % are needed: make more runs, or "
                "use method 'reweight'",
                status="ULNA_ERROR_ANALYSIS",
                argument="n",
            )
        self.widened = max(1.0, float(np.sqrt(np.mean(missed**2 * np.diag(inverse)))))

    def _points(self, x: np.ndarray) -> np.ndarray:
        columns = [coordinate(f, x[:, k]) for k, f in enumerate(self.factors)]
        return np.column_stack(columns)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The output at rows of factor values, and the standard error of saying so."""
        if self.process is None:
            return np.full(len(x), self.mean), np.zeros(len(x))
        points = (self._points(x) - self.middle) / self.scale
        parts = [
            self.process.predict(points[at : at + 4096], return_std=True)
            for at in range(0, len(points), 4096)
        ]
        value = np.concatenate([part[0] for part in parts])
        error = np.concatenate([part[1] for part in parts])
        return self.mean + self.deviation * value, self.widened * self.deviation * error
