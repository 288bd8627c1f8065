"""Distributions of the factors of a study.

A design lives in the unit cube; the value of a factor is the quantile of its coordinate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._call import lib, out_array, view
from .record import refuse

__all__ = [
    "Discrete",
    "Factor",
    "LogUniform",
    "Normal",
    "Triangular",
    "TruncatedNormal",
    "Uniform",
]


class Factor:
    """What all distributions can do."""

    _family: int

    def _parameters(self) -> Any:
        raise NotImplementedError

    def _map(self, function: Any, values: Any) -> np.ndarray:
        given = np.asarray(values, dtype=float)
        parameters = view(np.asarray(self._parameters(), dtype=float))
        flat = np.ascontiguousarray(given.reshape(-1))
        return out_array(function, self._family, parameters, view(flat)).reshape(given.shape)

    def quantile(self, probability: Any) -> np.ndarray:
        """Values below which the distribution has so much probability.

        Examples
        --------
        >>> import ulna
        >>> ulna.Uniform(2.0, 4.0).quantile([0.0, 0.25, 1.0]).tolist()
        [2.0, 2.5, 4.0]
        """
        return self._map(lib.ulna_factor_quantile, probability)

    def probability(self, value: Any) -> np.ndarray:
        """Probability of values at most so large; of discrete values the middle of their step."""
        return self._map(lib.ulna_factor_probability, value)


@dataclass(frozen=True)
class Uniform(Factor):
    """Equally likely between `low` and `high`."""

    low: float
    high: float
    _family = lib.ULNA_FACTOR_UNIFORM

    def __post_init__(self) -> None:
        self.quantile(0.5)

    def _parameters(self) -> Any:
        return self.low, self.high


@dataclass(frozen=True)
class Normal(Factor):
    """Normal, with its mean and standard deviation."""

    mean: float
    deviation: float
    _family = lib.ULNA_FACTOR_NORMAL

    def __post_init__(self) -> None:
        self.quantile(0.5)

    def _parameters(self) -> Any:
        return self.mean, self.deviation


@dataclass(frozen=True)
class TruncatedNormal(Factor):
    """Normal (`mean`, `deviation`), given that it falls between `low` and `high`."""

    mean: float
    deviation: float
    low: float
    high: float
    _family = lib.ULNA_FACTOR_TRUNCATED_NORMAL

    def __post_init__(self) -> None:
        self.quantile(0.5)

    def _parameters(self) -> Any:
        return self.mean, self.deviation, self.low, self.high


@dataclass(frozen=True)
class Triangular(Factor):
    """A triangle from `low` over `mode` to `high`."""

    low: float
    mode: float
    high: float
    _family = lib.ULNA_FACTOR_TRIANGULAR

    def __post_init__(self) -> None:
        self.quantile(0.5)

    def _parameters(self) -> Any:
        return self.low, self.mode, self.high


@dataclass(frozen=True)
class LogUniform(Factor):
    """Its logarithm is equally likely between those of `low` and `high`, both positive."""

    low: float
    high: float
    _family = lib.ULNA_FACTOR_LOG_UNIFORM

    def __post_init__(self) -> None:
        self.quantile(0.5)

    def _parameters(self) -> Any:
        return self.low, self.high


@dataclass(frozen=True)
class Discrete(Factor):
    """One of `values`, with `weights` (equal when left out)."""

    values: Sequence[float]
    weights: Sequence[float] | None = None
    _family = lib.ULNA_FACTOR_DISCRETE

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(v) for v in self.values))
        if self.weights is not None:
            object.__setattr__(self, "weights", tuple(float(w) for w in self.weights))
            if len(self.weights) != len(self.values):
                raise refuse(
                    f"weights must be as many as values, {len(self.values)}, "
                    f"got {len(self.weights)}",
                    "weights",
                )
        self.quantile(0.5)

    def _parameters(self) -> Any:
        if self.weights is None:
            return np.reshape(self.values, (-1, 1))
        return np.column_stack([self.values, self.weights])


def check_factors(factors: Mapping[str, Factor]) -> dict[str, Factor]:
    """A copy with plain names, or one sentence about what is wrong."""
    if not isinstance(factors, Mapping) or not factors:
        raise refuse(
            'factors must map names to distributions, as {"a": ulna.Uniform(0, 1)}', "factors"
        )
    for name, factor in factors.items():
        if not isinstance(name, str) or not name:
            raise refuse(f"the name of a factor must be text, got {name!r}", "factors")
        if not isinstance(factor, Factor):
            raise refuse(
                f"factor {name!r} must be a distribution as ulna.Uniform(low, high), "
                f"got {factor!r}",
                "factors",
            )
    return dict(factors)
