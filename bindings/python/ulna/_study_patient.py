"""What is known of a measured patient when not everything about the patient could be measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import AnalysisError, DataError
from ._factors import Discrete, Factor, Normal
from ._study_design import check_share
from ._study_emulator import Emulator, check_runs, coordinate
from .record import refuse

if TYPE_CHECKING:
    from .study import Runs

__all__ = ["Patient", "PatientQuantity"]

METHODS = ("reweight", "emulator")
LEAST_EFFECTIVE = 50.0  # runs behind an interval: its ends are then known to a tenth of its width
_EMULATED = 2**13  # points that an emulator is asked for
_NODES, _REST = 64, 64  # of a factor's distribution, and of what is left when it is known
_STANDARD = Normal(0.0, 1.0)


@dataclass(frozen=True, eq=False)
class PatientQuantity:
    """One quantity of a patient, and what would make it better known.

    A factor's share of width is that of the expected interval to the present one, the rest of the
    distribution keeping its shape.

    Attributes
    ----------
    name, unit : str
    mean, deviation : float
    interval : (float, float)
        At the patient's level: of the measurement and of the factors together.
    interval_error : (float, float)
        Standard errors of its ends, of so many runs.
    unobserved : (float, float)
        The interval before what was observed was taken into account.
    noise_deviation : float
        What of `deviation` is the measurement's own: left if every factor were known.
    known : dict of str to float
        Share of the width that is left when the factor is known exactly; of measurable factors.
    halved : dict of str to float
        The same when a measurement halves the factor's own uncertainty.
    to_halve : dict of str to float
        Standard error of a measurement of the factor that halves the width; the factors that can.
    together : tuple of (str, float)
        One factor after the other that takes most of the variance, each with the share of the
        standard deviation that is left when it and those before it are known.
    """

    name: str
    unit: str
    mean: float
    deviation: float
    interval: tuple[float, float]
    interval_error: tuple[float, float]
    unobserved: tuple[float, float]
    noise_deviation: float
    known: Mapping[str, float]
    halved: Mapping[str, float]
    to_halve: Mapping[str, float]
    together: tuple[tuple[str, float], ...]
    units: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def width(self) -> float:
        """Of the interval."""
        return self.interval[1] - self.interval[0]

    def advice(self) -> str:
        """One sentence: what to measure, and how well, to halve the interval."""
        if self.deviation == 0.0:
            return f"{self.name} is the same for all values of the factors."
        if not self.known:
            return f"Nothing can be measured better for {self.name}."
        if self.to_halve:
            ways = [
                f"measure {name} to ±{self.to_halve[name]:.2g}{_space(self.units.get(name, ''))}"
                for name in sorted(self.to_halve, key=lambda name: self.known[name])
            ]
            return f"To halve the interval of {self.name}: {', or '.join(ways)} (standard error)."
        alone = self.noise_deviation / self.deviation
        if alone > 0.5:
            return (
                f"The interval of {self.name} cannot be halved by measuring factors: the "
                f"measurement's own error makes {100 * alone:.0f} % of it. Measure longer, or again."
            )
        enough = next((k for k, (_, left) in enumerate(self.together) if left <= 0.5), None)
        if enough is not None and enough > 0:
            names = [name for name, _ in self.together[: enough + 1]]
            return (
                f"The interval of {self.name} cannot be halved by one factor; knowing "
                f"{' and '.join(names)} would leave {100 * self.together[enough][1]:.0f} %."
            )
        return f"The interval of {self.name} cannot be halved by one factor."

    def summary(self) -> str:
        """The interval, and a line for each factor."""
        unit = _space(self.unit)
        low, high = self.interval
        lines = [
            f"{self.name}: {self.mean:.4g}{unit}, {low:.4g} to {high:.4g} "
            f"(ends ±{max(self.interval_error):.1g})"
        ]
        if self.known:
            share = 100 * self.noise_deviation / self.deviation
            lines.append(f"  with all factors known {share:.0f} % of the deviation would be left")
            width = max(6, *map(len, self.known))
            lines.append(f"  {'factor':<{width}}  {'known':>7}  {'halved':>7}  to halve the interval")
            for name in sorted(self.known, key=lambda name: self.known[name]):
                how = "not by this factor alone"
                if name in self.to_halve:
                    unit = _space(self.units.get(name, ""))
                    how = f"measure it to ±{self.to_halve[name]:.2g}{unit}"
                known, halved = 100 * self.known[name], 100 * self.halved[name]
                lines.append(f"  {name:<{width}}  {known:5.0f} %  {halved:5.0f} %  {how}")
        lines += wrap(self.advice(), 80, initial_indent="  ", subsequent_indent="  ")
        return "\n".join(lines)

    def __repr__(self) -> str:
        low, high = self.interval
        return (
            f"<PatientQuantity {self.name}={self.mean:.4g}±{self.deviation:.2g}{_space(self.unit)}, "
            f"{low:.4g} to {high:.4g}>"
        )


@dataclass(frozen=True, eq=False)
class Patient:
    """A patient's quantities over all that is uncertain about the patient.

    Attributes
    ----------
    quantities : dict of str to PatientQuantity
    level : float
        Of the intervals.
    method : str
        "reweight" (the runs themselves) or "emulator" (a Gaussian process that learnt from them).
    runs, effective : float
        Good runs of the plain sample; how many equally likely ones they, or the emulator's points,
        are worth after what was observed.
    factors : dict of str to (float, float)
        Mean and standard deviation of each factor after what was observed.
    observed : dict of str to (float, float)
        What was observed, each with its standard error.
    distance : float
        Of what was observed from the closest run, in standard errors (root of the sum of squares).
    q2 : dict of str to float
        Of the emulators: share of each output's variance that they predict at unseen runs.
    """

    quantities: Mapping[str, PatientQuantity]
    level: float
    method: str
    runs: int
    effective: float
    factors: Mapping[str, tuple[float, float]]
    observed: Mapping[str, tuple[float, float]]
    distance: float
    q2: Mapping[str, float]

    def __getitem__(self, name: str) -> PatientQuantity:
        return self.quantities[name]

    def summary(self) -> str:
        """Intervals, and what to measure better."""
        seen = ", ".join(f"{name} {v:.4g}±{e:.2g}" for name, (v, e) in self.observed.items())
        lines = [
            f"{100 * self.level:g} % intervals from {self.runs} runs ({self.method}), effective "
            f"sample size {self.effective:.0f}"
        ]
        if seen:
            lines += wrap(f"observed: {seen}", 80, subsequent_indent="  ")
        if self.q2:
            worst = min(self.q2, key=lambda name: self.q2[name])
            lines.append(f"the emulator of {worst} predicts {100 * self.q2[worst]:.1f} %")
        return "\n".join([*lines, *(one.summary() for one in self.quantities.values())])

    def plot(self, axes: Any = None) -> Any:
        """Each quantity's interval, and what knowing a factor leaves of it (needs matplotlib)."""
        from . import plot

        return plot.patient(self, axes)

    def __repr__(self) -> str:
        return f"<Patient {' '.join(map(repr, self.quantities.values()))}>"


def _space(unit: str) -> str:
    return f" {unit}" if unit else ""


# Sample and weights ------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Sample:
    """Factor values, and at each a mean and a standard error of every output that is needed."""

    x: np.ndarray
    value: Mapping[str, np.ndarray]
    error: Mapping[str, np.ndarray]  # of the emulator
    runs: int
    q2: Mapping[str, float]


def _good_rows(runs: Runs, on_failure: str) -> np.ndarray:
    rows = runs.base_rows()
    good = (runs.status[rows] == 0) & np.isfinite(runs.y[rows]).all(axis=1)
    if not good.all() and on_failure == "error":
        raise DataError(
            f"{np.count_nonzero(~good)} of {rows.size} runs have no result; on_failure='drop_block' "
            f"leaves them out, which excludes such patients; {runs._why_failed()}",
            status="ULNA_ERROR_DATA",
            argument="runs",
            detail=f"row {rows[~good][0]}",
        )
    return rows[good]


def _sample(
    runs: Runs, rows: np.ndarray, names: Sequence[str], positive: set[str], method: str, seed: int
) -> _Sample:
    factors = [runs.design.factors[name] for name in runs.design.function_factors]
    unit = runs.design.unit()[rows, : len(factors)]
    x = np.column_stack([f.quantile(unit[:, k]) for k, f in enumerate(factors)])
    y = {name: runs.output(name)[rows] for name in names}
    if method == "reweight":
        nothing = np.zeros(rows.size)
        return _Sample(x, y, dict.fromkeys(names, nothing), rows.size, {})
    from ._study_design import StudyDesign

    named = dict(zip(runs.design.function_factors, factors, strict=True))
    points = StudyDesign(named, scheme="sample", n=_EMULATED, seed=seed).values()
    value, error, q2 = {}, {}, {}
    for name in names:
        # Standard errors are positive: they are learnt as logarithms.
        logs = name in positive and bool((y[name] > 0).all())
        known = np.log(y[name]) if logs else y[name]
        emulator = Emulator(factors, x, known, name=name, seed=seed)
        value[name], error[name] = emulator.predict(points)
        if logs:
            value[name] = np.exp(value[name])
        q2[name] = emulator.q2
    return _Sample(points, value, error, rows.size, q2)


def _observation(
    observed: Mapping[str, Any], covariance: Any
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, values and covariance of what was observed, checked."""
    names = list(observed)
    if covariance is None:
        values, errors = np.empty(len(names)), np.empty(len(names))
        for k, name in enumerate(names):
            pair = np.asarray(observed[name], dtype=float)
            if pair.shape != (2,) or not np.isfinite(pair).all() or pair[1] <= 0.0:
                raise refuse(
                    f"observed[{name!r}] is {observed[name]!r}; it must be a value and its "
                    "standard error above 0, or give their covariance",
                    "observed",
                )
            values[k], errors[k] = pair
        return names, values, np.diag(errors**2)
    values = np.array([np.asarray(observed[name], dtype=float) for name in names], dtype=float)
    matrix = np.asarray(covariance, dtype=float)
    if values.shape != (len(names),) or not np.isfinite(values).all():
        raise refuse("with a covariance, observed maps names to finite values", "observed")
    if matrix.shape != (len(names), len(names)) or not np.isfinite(matrix).all():
        raise refuse(
            f"covariance must be {len(names)} x {len(names)} finite numbers, in the order of "
            f"observed, got shape {matrix.shape}",
            "covariance",
        )
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0) or np.linalg.eigvalsh(matrix)[0] <= 0:
        raise refuse("covariance must be symmetric and positive definite", "covariance")
    return names, values, matrix


def _likelihood(
    sample: _Sample, names: Sequence[str], values: np.ndarray, covariance: np.ndarray
) -> tuple[np.ndarray, float]:
    """Logarithm of each point's weight, and the smallest distance in standard errors."""
    gap = np.column_stack([sample.value[name] for name in names]) - values
    extra = np.column_stack([sample.error[name] for name in names]) ** 2
    if not extra.any():
        root = np.linalg.cholesky(covariance)
        square = np.sum(np.linalg.solve(root, gap.T) ** 2, axis=0)
        return -0.5 * square, float(np.sqrt(square.min()))
    # What the emulator does not know of the prediction is as good as an error of the observation.
    matrices = covariance + extra[:, :, None] * np.eye(len(names))
    square = np.einsum("ij,ij->i", gap, np.linalg.solve(matrices, gap[:, :, None])[:, :, 0])
    return -0.5 * (square + np.linalg.slogdet(matrices)[1]), float(np.sqrt(square.min()))


def _weights(
    sample: _Sample, observed: Mapping[str, Any] | None, covariance: Any, method: str
) -> tuple[np.ndarray, dict[str, tuple[float, float]], float]:
    count = len(sample.x)
    if not observed:
        return np.full(count, 1.0 / count), {}, 0.0
    names, values, matrix = _observation(observed, covariance)
    logs, distance = _likelihood(sample, names, values, matrix)
    # A run at random lies farther than this once in 10 000: Wilson and Hilferty's chi-squared.
    k = len(names)
    most = np.sqrt(k * (1 - 2 / (9 * k) + 3.719 * np.sqrt(2 / (9 * k))) ** 3)
    if distance > most:
        raise AnalysisError(
            f"what was observed lies {distance:.1f} standard errors from the closest of {count} "
            "points: the ranges of the factors, or the model, do not allow for it",
            status="ULNA_ERROR_ANALYSIS",
            argument="observed",
        )
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    effective = 1.0 / float(np.sum(weights**2))
    if effective < LEAST_EFFECTIVE:
        more = 2.0 ** np.ceil(np.log2(sample.runs * LEAST_EFFECTIVE / effective))
        cure = (
            f"run about {more:.0f}, or use method 'emulator'"
            if method == "reweight"
            else "narrow the factors' ranges to what agrees"
        )
        raise AnalysisError(
            f"of {count} points few agree with what was observed: the effective sample size is "
            f"{effective:.1f}, at least {LEAST_EFFECTIVE:.0f} is needed; {cure}",
            status="ULNA_ERROR_ANALYSIS",
            argument="observed",
        )
    errors = np.sqrt(np.diag(matrix))
    told = {n: (float(v), float(e)) for n, v, e in zip(names, values, errors, strict=True)}
    return weights, told, distance


# Quantiles ---------------------------------------------------------------------------------------


def _quantiles(
    value: np.ndarray, error: np.ndarray, weight: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """Quantiles of a weighted mixture of normal distributions."""
    if not error.any():
        order = np.argsort(value, kind="stable")
        reached = np.cumsum(weight[order]) - 0.5 * weight[order]
        return np.interp(share, reached, value[order])
    # A point without error is a step; a tiny error keeps one formula for all.
    spread = np.maximum(error, 1e-9 * error.max())
    used = weight > 1e-12 * weight.max()
    value, spread, weight = value[used], spread[used], weight[used] / weight[used].sum()
    low = np.full(len(share), float(np.min(value - 9 * spread)))
    high = np.full(len(share), float(np.max(value + 9 * spread)))
    for _ in range(50):
        middle = 0.5 * (low + high)
        z = (middle[:, None] - value) / spread
        below = _STANDARD.probability(z.ravel()).reshape(z.shape) @ weight
        low, high = np.where(below < share, middle, low), np.where(below < share, high, middle)
    return 0.5 * (low + high)


def _interval(
    value: np.ndarray, error: np.ndarray, weight: np.ndarray, level: float, effective: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ends of the interval, and their standard errors from the spread of order statistics."""
    tail = 0.5 * (1.0 - level)
    step = min(0.8 * tail, float(np.sqrt(tail * (1 - tail) / effective)))
    share = np.array([tail, 1 - tail, tail - step, tail + step, 1 - tail - step, 1 - tail + step])
    at = _quantiles(value, error, weight, share)
    return (float(at[0]), float(at[1])), (float(at[3] - at[2]) / 2, float(at[5] - at[4]) / 2)


# What one factor explains ------------------------------------------------------------------------


def _legendre(z: np.ndarray, degree: int) -> np.ndarray:
    return np.polynomial.legendre.legvander(z, degree)


def _solve(columns: np.ndarray, y: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Weighted least squares of few columns of size one, by the normal equations."""
    weighted = columns * w[:, None]
    return np.linalg.lstsq(columns.T @ weighted, weighted.T @ y, rcond=1e-13)[0]


def _fit(
    basis: Callable[[int], np.ndarray], most: int, y: np.ndarray, w: np.ndarray, effective: float
) -> tuple[np.ndarray, int]:
    """Weighted least squares with as many terms as Schwarz's criterion allows; and how many."""
    best: tuple[float, np.ndarray, int] | None = None
    scale = float(w @ (y - w @ y) ** 2)
    for terms in range(most + 1):
        columns = basis(terms)
        solved = _solve(columns, y, w)
        left = float(w @ (y - columns @ solved) ** 2)
        # Below rounding more terms mean nothing.
        score = effective * np.log(max(left, 1e-24 * scale, 1e-300)) + terms * np.log(effective)
        if best is None or score < best[0] - 1e-9 * abs(best[0]):
            best = score, solved, terms
    assert best is not None
    return best[1], best[2]


class _Along:
    """A quantity over one factor: its mean, what is left of it, and both at nodes of the factor."""

    def __init__(
        self, factor: Factor, x: np.ndarray, value: np.ndarray, error: np.ndarray, weight: np.ndarray,
        effective: float,
    ) -> None:  # fmt: skip
        self.scale = coordinate(factor, x)
        self.deviation = _deviation(self.scale, weight)
        used = self.scale[weight > 1e-9 * weight.max()]
        low, high = float(used.min()), float(used.max())
        if not high > low:
            low, high = low - 1.0, high + 1.0
        share = (np.arange(_NODES) + 0.5) / _NODES
        if isinstance(factor, Discrete):
            seen = np.unique(x)
            columns = (x[:, None] == seen).astype(float)
            mean = (columns.T @ (weight * value)) / np.maximum(columns.T @ weight, 1e-300)
            at = np.searchsorted(seen, _pick(x, weight, share))
            self.nodes = coordinate(factor, seen)[at]
            trend, here, terms = columns @ mean, mean[at], len(seen) - 1
            inside = np.zeros((len(x), 1)), np.zeros((_NODES, 1))
        else:
            self.nodes = _quantiles(self.scale, np.zeros(len(x)), weight, share)
            z = np.clip(2 * (self.scale - low) / (high - low) - 1, -1, 1)
            at_nodes = np.clip(2 * (self.nodes - low) / (high - low) - 1, -1, 1)
            most = int(np.clip(effective // 20, 1, 6))
            solved, terms = _fit(lambda d: _legendre(z, d), most, value, weight, effective)
            trend, here = _legendre(z, terms) @ solved, _legendre(at_nodes, terms) @ solved
            inside = _legendre(z, 2)[:, 1:], _legendre(at_nodes, 2)[:, 1:]
        rest = value - trend
        # Spread of the rest along the factor: its square, by the same criterion.
        square = rest**2 + error**2
        ones = np.ones((len(x), 1)), np.ones((_NODES, 1))
        tall, wide = np.hstack([ones[0], inside[0]]), np.hstack([ones[1], inside[1]])
        solved, used_terms = _fit(
            lambda d: tall[:, : d + 1], tall.shape[1] - 1, square, weight, effective
        )
        mean_square = float(weight @ square)
        floor = 1e-4 * mean_square if mean_square > 0 else 1.0
        spread = np.sqrt(np.maximum(tall[:, : used_terms + 1] @ solved, floor))
        spread_here = np.sqrt(np.maximum(wide[:, : used_terms + 1] @ solved, floor))
        # A trend of so many terms hugs its points: what is left looks smaller than it is.
        hugged = 1.0 / np.sqrt(max(0.2, 1.0 - (terms + 1) / effective))
        shares = (np.arange(_REST) + 0.5) / _REST
        left = hugged * _quantiles(*_smeared(rest / spread, error / spread, weight), shares)
        self.values = here[:, None] + spread_here[:, None] * left
        order = np.argsort(self.values, axis=None, kind="stable")
        self.sorted = self.values.ravel()[order]
        self.node_of = order // _REST

    def width(self, measured: float, level: float) -> float:
        """Expected width of the interval after a measurement of the factor with this standard error.

        Infinite: none; 0: the factor is known.
        """
        tail = 0.5 * (1.0 - level)
        if np.isinf(measured):
            shares = np.full((1, _NODES), 1.0 / _NODES)
            outcome = np.ones(1)
        elif measured <= 0.0:
            shares, outcome = np.eye(_NODES), np.full(_NODES, 1.0 / _NODES)
        else:
            # Outcomes of the measurement: nodes with three of its errors (Gauss and Hermite).
            z = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])
            readings = (self.nodes[::2, None] + measured * z).ravel()
            outcome = np.tile(np.array([1, 4, 1]) / 6.0, _NODES // 2) / (_NODES // 2)
            logs = -0.5 * ((readings[:, None] - self.nodes) / measured) ** 2
            shares = np.exp(logs - logs.max(axis=1, keepdims=True))
            shares /= shares.sum(axis=1, keepdims=True)
        widths = []
        for row in shares[:, self.node_of] / _REST:
            # Points without weight between two others are no place for a quantile.
            used = row > 1e-9 * row.max()
            weight = row[used]
            reached = np.cumsum(weight) - 0.5 * weight
            low, high = np.interp([tail, 1 - tail], reached, self.sorted[used])
            widths.append(high - low)
        return float(outcome @ np.array(widths))


def _smeared(
    value: np.ndarray, error: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points with normal errors as 32 times so many without: many quantiles of them are fast."""
    if not error.any():
        return value, error, weight
    z = _STANDARD.quantile((np.arange(32) + 0.5) / 32)
    points = (value[:, None] + error[:, None] * (z / z.std())).ravel()
    return points, np.zeros(points.size), np.repeat(weight / 32, 32)


def _pick(x: np.ndarray, weight: np.ndarray, share: np.ndarray) -> np.ndarray:
    order = np.argsort(x, kind="stable")
    reached = np.cumsum(weight[order])
    return x[order][np.minimum(np.searchsorted(reached, share), len(x) - 1)]


def _deviation(value: np.ndarray, weight: np.ndarray) -> float:
    return float(np.sqrt(max(0.0, weight @ (value - weight @ value) ** 2)))


def _needed(along: _Along, level: float, now: float, known: float) -> float | None:
    """Standard error of a measurement that halves the width; None where even knowing does not."""
    if known > 0.5:
        return None
    low, high = np.log(1e-3 * along.deviation), np.log(10 * along.deviation)
    for _ in range(14):
        middle = 0.5 * (low + high)
        if along.width(float(np.exp(middle)), level) > 0.5 * now:
            high = middle
        else:
            low = middle
    return float(np.exp(0.5 * (low + high)))


def _together(
    scale: Mapping[str, np.ndarray], value: np.ndarray, error: np.ndarray, weight: np.ndarray,
    effective: float,
) -> tuple[tuple[str, float], ...]:  # fmt: skip
    """Factors by what they explain together, by quadratic surfaces; share of the deviation left."""
    noise = float(weight @ error**2)
    own = _deviation(value, weight) ** 2
    total = own + noise
    z = {
        name: (x - weight @ x) / (_deviation(x, weight) or 1.0) for name, x in scale.items()
    }
    chosen: list[str] = []
    out: list[tuple[str, float]] = []
    while len(chosen) < len(z):
        count = len(chosen) + 1
        terms = 1 + 2 * count + count * (count - 1) // 2
        if effective < 4 * terms:
            break
        left = {}
        for name in z.keys() - set(chosen):
            parts = [z[one] for one in (*chosen, name)]
            columns = np.column_stack(
                [np.ones(len(value)), *parts]
                + [parts[i] * parts[j] for i in range(count) for j in range(i + 1)]
            )
            solved = _solve(columns, value, weight)
            missed = float(weight @ (value - columns @ solved) ** 2)
            left[name] = min(own, missed / (1 - terms / effective))
        name = min(sorted(left), key=lambda one: left[one])
        chosen.append(name)
        out.append((name, float(np.sqrt((left[name] + noise) / total))))
    return tuple(out)


# The whole ---------------------------------------------------------------------------------------


def _wanted(runs: Runs, quantities: Any) -> dict[str, str | float | None]:
    """Quantities, each with the output that holds its standard error, a number, or None."""
    if isinstance(quantities, str):
        quantities = (quantities,)
    if isinstance(quantities, Mapping):
        wanted = dict(quantities)
    else:
        wanted = dict.fromkeys(runs.outputs if quantities is None else quantities)
    if not wanted:
        raise refuse("quantities must name at least one output", "quantities")
    for name, error in wanted.items():
        runs._place(name)
        if isinstance(error, str):
            runs._place(error)
        elif error is not None and not (np.isfinite(error) and error >= 0):
            raise refuse(f"the standard error of {name} is {error!r}; it must be 0 or more", "quantities")
    return wanted


def check_question(
    runs: Runs,
    *,
    quantities: Any,
    observed: Mapping[str, Any] | None,
    covariance: Any,
    measurable: Sequence[str] | None,
    method: str,
    level: float,
    on_failure: str,
) -> None:
    """Refuse a question that no results could answer: of `runs` only the design is looked at."""
    if method not in METHODS:
        raise refuse(f"method is {method!r}; it must be one of {', '.join(METHODS)}", "method")
    check_share(level, "level")
    if on_failure not in ("error", "drop_block"):
        raise refuse(
            f"on_failure is {on_failure!r}; a patient's runs are left out ('drop_block') or an "
            "error ('error')",
            "on_failure",
        )
    _wanted(runs, quantities)
    names_of = runs.design.function_factors
    if isinstance(measurable, str) or set(measurable or ()) - set(names_of):
        raise refuse(f"measurable must be names of factors: {', '.join(names_of)}", "measurable")
    _check_observed(runs, observed, covariance)
    if not runs.design.has_points:
        raise refuse("a patient needs the values of the factors: read_outputs(y, x=...)", "x")


def _check_observed(runs: Runs, observed: Mapping[str, Any] | None, covariance: Any) -> None:
    if observed is not None and not isinstance(observed, Mapping):
        raise refuse("observed must map outputs to a value and its standard error", "observed")
    for name in observed or {}:
        if name not in runs.outputs:
            raise refuse(
                f"observed names no output {name!r}; there are {', '.join(runs.outputs)}", "observed"
            )
    if observed:
        _observation(observed, covariance)
    elif covariance is not None:
        raise refuse("a covariance of nothing observed", "covariance")


def check_size(runs: Runs, rows: np.ndarray, method: str) -> None:
    """Refuse too few good rows for a method, and too many."""
    if method == "emulator":
        check_runs(len(runs.design.function_factors), rows.size)
    elif rows.size < LEAST_EFFECTIVE:
        raise refuse(
            f"{rows.size} good runs of a plain sample are too few, at least {LEAST_EFFECTIVE:.0f} "
            "are needed" + (f"; {runs._why_failed()}" if runs.failed.size else ""),
            "n",
        )


def patient(
    runs: Runs,
    *,
    quantities: Any,
    observed: Mapping[str, Any] | None,
    covariance: Any,
    measurable: Sequence[str] | None,
    method: str,
    level: float,
    seed: int,
    on_failure: str,
) -> Patient:
    """See `Runs.patient`."""
    check_question(
        runs,
        quantities=quantities,
        observed=observed,
        covariance=covariance,
        measurable=measurable,
        method=method,
        level=level,
        on_failure=on_failure,
    )
    wanted = _wanted(runs, quantities)
    chosen = runs.design.function_factors if measurable is None else tuple(measurable)
    rows = _good_rows(runs, on_failure)
    check_size(runs, rows, method)
    errors = {error for error in wanted.values() if isinstance(error, str)}
    for name in errors:
        if (runs.output(name)[rows] < 0).any():
            raise DataError(
                f"the output {name} is to be a standard error and is below 0",
                status="ULNA_ERROR_DATA",
                argument="quantities",
            )
    names = list(dict.fromkeys([*wanted, *errors, *(observed or {})]))
    sample = _sample(runs, rows, names, errors, method, seed)
    weight, told, distance = _weights(sample, observed, covariance, method)
    effective = 1.0 / float(np.sum(weight**2))
    units = dict(runs.units)
    factors = {name: runs.design.factors[name] for name in runs.design.function_factors}
    found = {}
    for name, error in wanted.items():
        if isinstance(error, str):
            own = np.maximum(sample.value[error], 0.0)
        else:
            own = np.full(len(sample.x), float(error or 0.0))
        own = np.hypot(own, sample.error[name])
        found[name] = _quantity(
            name, factors, sample.x, sample.value[name], own, weight, level, effective, units, chosen
        )  # fmt: skip
    return Patient(
        quantities=found,
        level=level,
        method=method,
        runs=sample.runs,
        effective=effective,
        factors={
            name: (float(weight @ sample.x[:, k]), _deviation(sample.x[:, k], weight))
            for k, name in enumerate(factors)
        },
        observed=told,
        distance=distance,
        q2=sample.q2,
    )


def _quantity(
    name: str, factors: Mapping[str, Factor], x: np.ndarray, value: np.ndarray, error: np.ndarray,
    weight: np.ndarray, level: float, effective: float, units: Mapping[str, str],
    measurable: Sequence[str],
) -> PatientQuantity:  # fmt: skip
    mean = float(weight @ value)
    noise = float(np.sqrt(weight @ error**2))
    deviation = float(np.hypot(_deviation(value, weight), noise))
    if deviation <= 1e-12 * abs(mean):
        deviation = 0.0
    interval, ends = _interval(value, error, weight, level, effective)
    even = np.full(len(value), 1.0 / len(value))
    before, _ = _interval(value, error, even, level, len(value))
    known: dict[str, float] = {}
    halved: dict[str, float] = {}
    to_halve: dict[str, float] = {}
    together: tuple[tuple[str, float], ...] = ()
    if deviation > 0.0:
        scale = {}
        for k, (one, factor) in enumerate(factors.items()):
            if one not in measurable:
                continue
            along = _Along(factor, x[:, k], value, error, weight, effective)
            scale[one] = along.scale
            now = along.width(np.inf, level)
            known[one] = min(1.0, along.width(0.0, level) / now)
            # Two normal distributions of deviations s and s/sqrt(3) give one of s/2.
            halved[one] = min(1.0, along.width(along.deviation / np.sqrt(3.0), level) / now)
            needed = None
            if not isinstance(factor, Discrete):
                needed = _needed(along, level, now, known[one])
            if needed is not None:
                to_halve[one] = _in_units(factor, needed, float(weight @ x[:, k]))
        together = _together(scale, value, error, weight, effective)
    return PatientQuantity(
        name=name,
        unit=units.get(name, ""),
        mean=mean,
        deviation=deviation,
        interval=interval,
        interval_error=ends,
        unobserved=before,
        noise_deviation=noise,
        known=known,
        halved=halved,
        to_halve=to_halve,
        together=together,
        units={one: units.get(one, "") for one in factors},
    )


def _in_units(factor: Factor, error: float, mean: float) -> float:
    """A standard error on the factor's even scale, in its own units at its mean."""
    from ._factors import LogUniform

    return error * mean if isinstance(factor, LogUniform) else error
