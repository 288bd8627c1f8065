"""SALib's way of naming a problem, and its methods for data that were made in any way."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ._call import DataError
from ._factors import Factor, LogUniform, Normal, Triangular, TruncatedNormal, Uniform
from .record import refuse

if TYPE_CHECKING:
    from .study import Runs

__all__ = ["GivenData"]


def problem_of(
    factors: Mapping[str, Factor], groups: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Factors as SALib's ``problem``."""
    bounds, kinds = [], []
    for name, factor in factors.items():
        match factor:
            case Uniform():
                kinds.append("unif")
                bounds.append([factor.low, factor.high])
            case Normal():
                kinds.append("norm")
                bounds.append([factor.mean, factor.deviation])
            case TruncatedNormal():
                kinds.append("truncnorm")
                bounds.append([factor.low, factor.high, factor.mean, factor.deviation])
            case Triangular():
                kinds.append("triang")
                turn = (factor.mode - factor.low) / (factor.high - factor.low)
                bounds.append([factor.low, factor.high, turn])
            case LogUniform():
                kinds.append("logunif")
                bounds.append([factor.low, factor.high])
            case _:
                raise refuse(f"SALib has no distribution for factor {name!r}, {factor!r}", "factors")
    problem = {"num_vars": len(factors), "names": list(factors), "bounds": bounds, "dists": kinds}
    if groups is not None:
        problem["groups"] = [groups.get(name, name) for name in factors]
    return problem


def factors_of_problem(
    problem: Mapping[str, Any],
) -> tuple[dict[str, Factor], dict[str, str] | None]:
    """Factors and groups of SALib's ``problem``."""
    try:
        names = list(problem["names"])
        bounds = list(problem["bounds"])
    except KeyError as failure:
        raise refuse(f"the problem has no {failure.args[0]!r}", "problem") from failure
    kinds = problem.get("dists") or ["unif"] * len(names)
    if not len(names) == len(bounds) == len(kinds) or len(set(names)) != len(names):
        raise refuse("names, bounds and dists of the problem must be as many, names unique", "problem")
    factors: dict[str, Factor] = {}
    for name, bound, kind in zip(names, bounds, kinds, strict=True):
        b = [float(v) for v in bound]
        match kind, len(b):
            case "unif", 2:
                factors[name] = Uniform(*b)
            case "norm", 2:
                factors[name] = Normal(*b)
            case "truncnorm", 4:
                factors[name] = TruncatedNormal(b[2], b[3], b[0], b[1])
            case "triang", 3:
                factors[name] = Triangular(b[0], b[0] + b[2] * (b[1] - b[0]), b[1])
            case "logunif", 2:
                factors[name] = LogUniform(*b)
            case _:
                raise refuse(
                    f"factor {name!r} has distribution {kind!r} with {len(b)} bounds, which is none "
                    "of unif, norm, truncnorm, triang, logunif with theirs",
                    "problem",
                )
    given = problem.get("groups")
    groups = None
    if given is not None:
        if len(given) != len(names):
            raise refuse("the problem's groups must name one for each factor", "problem")
        groups = dict(zip(names, map(str, given), strict=True))
    return factors, groups


@dataclass(frozen=True, eq=False)
class GivenData:
    """Indices of a method that takes any sample.

    Attributes
    ----------
    names : tuple of str
    method : str
        "pawn", "delta" or "rbd_fast".
    value : ndarray
        Median distance (pawn), delta, or first-order index (rbd_fast).
    half_width : ndarray
        Of the interval; NaN where the method has none (pawn).
    rows : int
        Runs that were used.
    output : str
    """

    names: tuple[str, ...]
    method: str
    value: np.ndarray
    half_width: np.ndarray
    rows: int
    output: str

    def summary(self) -> str:
        """A table of the indices."""
        width = max(6, *(len(name) for name in self.names))
        lines = [f"{self.method} indices of {self.output} from {self.rows} runs (SALib)"]
        for name, value, half in zip(self.names, self.value, self.half_width, strict=True):
            spread = "" if np.isnan(half) else f" ± {half:.3f}"
            lines.append(f"  {name:<{width}}  {value:7.3f}{spread}")
        return "\n".join(lines)


@contextlib.contextmanager
def _undisturbed(seed: int) -> Iterator[None]:
    """SALib draws from NumPy's global generator, ignores seed 0 and resets how warnings look."""
    state, look = np.random.get_state(), warnings.formatwarning  # noqa: NPY002
    try:
        with warnings.catch_warnings():
            np.random.seed(seed % 2**32)  # noqa: NPY002
            yield
    finally:
        np.random.set_state(state)  # noqa: NPY002
        warnings.formatwarning = look


def given_data(
    runs: Runs, *, method: str, output: str | None, level: float, resamples: int, seed: int
) -> GivenData:
    """Indices of `Runs.given_data`."""
    if method not in ("pawn", "delta", "rbd_fast"):
        raise refuse(f"method is {method!r}; it must be 'pawn', 'delta' or 'rbd_fast'", "method")
    if not runs.design.has_points:
        raise refuse("given-data methods need the values of the factors: read_outputs(y, x=...)", "x")
    try:
        from SALib.analyze import delta, pawn, rbd_fast
    except ImportError as failure:
        raise ImportError(
            "given-data methods need SALib: install it with `pip install SALib`"
        ) from failure
    y = runs.output(output)
    rows = runs.base_rows()
    rows = rows[(runs.status[rows] == 0) & np.isfinite(y[rows])]
    if rows.size < 50:
        raise DataError(
            f"given-data methods need at least 50 good runs, there are {rows.size}",
            status="ULNA_ERROR_DATA",
            argument="runs",
        )
    # In quantiles, where every factor is uniform: the indices do not depend on monotone maps.
    unit = runs.design.unit()[rows]
    names = list(runs.design.factors)
    problem = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    none = np.full(len(names), np.nan)
    with _undisturbed(seed):
        if method == "pawn":
            out = pawn.analyze(problem, unit, y[rows], S=10, seed=seed)
            value, half = np.asarray(out["median"]), none
        elif method == "delta":
            out = delta.analyze(
                problem, unit, y[rows], num_resamples=resamples, conf_level=level, seed=seed,
                method="delta",
            )  # fmt: skip
            key = "delta" if "delta" in out else "delta_raw"  # 1.6 names three variants
            value, half = np.asarray(out[key]), np.asarray(out[key + "_conf"])
        else:
            out = rbd_fast.analyze(
                problem, unit, y[rows], num_resamples=resamples, conf_level=level, seed=seed
            )
            value, half = np.asarray(out["S1"]), np.asarray(out["S1_conf"])
    return GivenData(
        names=tuple(names),
        method=method,
        value=value,
        half_width=half,
        rows=int(rows.size),
        output=runs.outputs[runs._place(output)],
    )
