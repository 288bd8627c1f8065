"""Statistics of experiments in which the same subjects go through several conditions.

Axis 0 is the subject throughout. Subjects are the random sample: every test and interval here asks
what would happen with other subjects, not with other samples of the same recording.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._call import check, ffi, lib, long_call, options, result, view
from .record import refuse

__all__ = ["Anova", "Effect", "Interval", "Paired", "compare_pairs", "f_tail", "repeated_anova"]

Array = NDArray[np.float64]


def f_tail(f: float, *, dof: float, error_dof: float) -> float:
    """P(F > f) of the F distribution.

    Examples
    --------
    >>> round(f_tail(4.84, dof=1, error_dof=11), 4)
    0.0501
    """
    out = ffi.new("double *")
    check(lib.ulna_f_tail(float(f), float(dof), float(error_dof), out))
    return float(out[0])


# Analysis of variance -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Effect:
    """One effect of an analysis of variance.

    Attributes
    ----------
    name : str
        Of the factor, or of both with ``" x "`` between.
    f, p : float
        Ratio of the mean squares and its p value if the scores were spherical.
    dof, error_dof : float
    epsilon : float
        Greenhouse and Geisser's; 1 for two levels.
    p_corrected : float
        With both degrees of freedom times `epsilon`: the one to report.
    partial_eta_squared : float
    sum_of_squares, error_sum_of_squares : float
    """

    name: str
    f: float
    dof: float
    error_dof: float
    p: float
    epsilon: float
    p_corrected: float
    partial_eta_squared: float
    sum_of_squares: float
    error_sum_of_squares: float

    def __str__(self) -> str:
        dofs = f"{self.epsilon * self.dof:.4g}, {self.epsilon * self.error_dof:.4g}"
        p = "p < 0.0001" if self.p_corrected < 1e-4 else f"p = {self.p_corrected:.4f}"
        return (
            f"{self.name}: F({dofs}) = {self.f:.4g}, {p}, "
            f"partial eta^2 = {self.partial_eta_squared:.3f}"
        )


@dataclass(frozen=True)
class Anova:
    """Effects of one or two factors that every subject went through.

    Attributes
    ----------
    effects : tuple of Effect
        First factor, second factor, their interaction; one alone where there is one factor.
    subjects : int
    levels : tuple of int
    """

    effects: tuple[Effect, ...]
    subjects: int
    levels: tuple[int, ...]

    def __getitem__(self, name: str) -> Effect:
        for effect in self.effects:
            if effect.name == name:
                return effect
        raise KeyError(f"there is no effect {name!r}; there are {', '.join(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    def summary(self) -> str:
        """A line for every effect, degrees of freedom corrected.

        Examples
        --------
        >>> y = [[3, 5, 7, 2, 3, 4], [4, 4, 9, 3, 5, 6], [2, 6, 5, 1, 2, 4], [5, 7, 8, 4, 3, 7]]
        >>> print(repeated_anova(np.reshape(y, (4, 2, 3))).summary())
        4 subjects, 2 x 3 cells, Greenhouse-Geisser corrected
        session: F(1, 3) = 49, p = 0.0060, partial eta^2 = 0.942
        block: F(1.258, 3.774) = 28.92, p = 0.0062, partial eta^2 = 0.906
        session x block: F(1.036, 3.109) = 0.5676, p = 0.5103, partial eta^2 = 0.159
        """
        cells = " x ".join(str(count) for count in self.levels)
        head = f"{self.subjects} subjects, {cells} cells, Greenhouse-Geisser corrected"
        return "\n".join([head, *(str(effect) for effect in self.effects)])

    def __repr__(self) -> str:
        return "<Anova: " + "; ".join(str(effect) for effect in self.effects) + ">"


def repeated_anova(values: ArrayLike, *, names: Sequence[str] | None = None) -> Anova:
    """Analysis of variance of repeated measures with Greenhouse and Geisser's correction.

    Each effect is tested against its own interaction with the subjects: F_A = MS_A / MS_AxS,
    F_B = MS_B / MS_BxS, F_AB = MS_AB / MS_ABxS.

    Parameters
    ----------
    values
        Shape (subjects, levels) or (subjects, levels of A, levels of B): one number a cell, such as
        the mean effort of a subject in a session and block. A subject without one of the cells is
        refused; leave it out.
    names
        Of the factors; ``("session", "block")`` unless given.

    Returns
    -------
    Anova

    Examples
    --------
    >>> y = [[3, 5, 7, 2, 3, 4], [4, 4, 9, 3, 5, 6], [2, 6, 5, 1, 2, 4], [5, 7, 8, 4, 3, 7]]
    >>> effect = repeated_anova(np.reshape(y, (4, 2, 3)))["session"]
    >>> round(effect.f, 6), round(effect.p, 6)
    (49.0, 0.005986)
    """
    table = np.asarray(values, dtype=float)
    if table.ndim not in (2, 3):
        raise refuse(
            f"values has {table.ndim} axes: it must have 2 (subjects, levels) or 3 (subjects, "
            "levels of the first factor, levels of the second)",
            "values",
        )
    levels = table.shape[1:]
    factors = tuple(names) if names is not None else ("session", "block")[: len(levels)]
    if len(factors) != len(levels) or len(set(factors)) != len(factors):
        raise refuse(f"names must be {len(levels)} different names of the factors", "names")
    flat = view(table.reshape(table.shape[0], -1))
    second = levels[1] if len(levels) == 2 else 1
    labels = [(factors[0], lib.ULNA_ANOVA_FIRST)]
    if len(levels) == 2:
        labels += [
            (factors[1], lib.ULNA_ANOVA_SECOND),
            (f"{factors[0]} x {factors[1]}", lib.ULNA_ANOVA_INTERACTION),
        ]
    effects = []
    for label, kind in labels:
        out = result("ulna_anova_effect")
        check(lib.ulna_anova_repeated(flat, levels[0], second, kind, out))
        fields = [name for name in Effect.__dataclass_fields__ if name != "name"]
        effects.append(Effect(label, **{name: getattr(out, name) for name in fields}))
    return Anova(tuple(effects), table.shape[0], tuple(levels))


# Pairs --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Interval:
    """Values with standard errors and intervals, one entry a measure.

    Attributes
    ----------
    value, error, low, high : ndarray, shape (measures,)
        NaN where a value is not defined.
    """

    value: Array
    error: Array
    low: Array
    high: Array

    def __repr__(self) -> str:
        parts = [
            f"{v:.4g} ± {e:.2g} [{a:.4g}, {b:.4g}]"
            for v, e, a, b in zip(self.value, self.error, self.low, self.high, strict=True)
        ]
        return f"<{', '.join(parts)}>"


@dataclass(frozen=True, eq=False)
class Paired:
    """Change from a first to a second condition of the same subjects.

    Attributes
    ----------
    names : tuple of str
        Of the measures.
    difference : Interval
        Mean of second - first, in the unit of the measure.
    relative : Interval
        Mean of second over mean of first, less 1.
    standardised : Interval
        Mean difference over the standard deviation of the differences.
    subjects : int
    level : float
        Of the intervals.
    """

    names: tuple[str, ...]
    difference: Interval
    relative: Interval
    standardised: Interval
    subjects: int
    level: float

    def summary(self) -> str:
        """A line for every measure.

        Examples
        --------
        >>> rng = np.random.default_rng(1)
        >>> without = rng.normal(20, 3, size=12)
        >>> print(compare_pairs(without, without - 5 + rng.normal(size=12)).summary())
        12 subjects, 95 % intervals
        value: -5 [-5.35, -4.52], -24.2 % [-26.4, -22]
        """
        lines = [f"{self.subjects} subjects, {100 * self.level:g} % intervals"]
        for i, name in enumerate(self.names):
            d, r = self.difference, self.relative
            lines.append(
                f"{name}: {d.value[i]:.3g} [{d.low[i]:.3g}, {d.high[i]:.3g}], "
                f"{100 * r.value[i]:.3g} % [{100 * r.low[i]:.3g}, {100 * r.high[i]:.3g}]"
            )
        return "\n".join(lines)

    def __repr__(self) -> str:
        return "<Paired: " + "; ".join(self.summary().splitlines()) + ">"


def compare_pairs(
    first: ArrayLike,
    second: ArrayLike,
    *,
    names: Sequence[str] | None = None,
    level: float = 0.95,
    resamples: int = 5000,
    seed: int = 0,
    interval: str = "bca",
    expand: bool = True,
    progress: bool = False,
) -> Paired:
    """Change between two conditions with bootstrap intervals over subjects.

    Whole subjects are drawn, so the pairs stay together and so do the measures of one subject. A
    bootstrap of a dozen subjects is too narrow (of a hundred 95 % intervals 90 hold the truth), so its
    quantiles are moved out as Student's t would (Hesterberg 2015).

    Parameters
    ----------
    first, second
        Shape (subjects,) or (subjects, measures), at least 3 subjects.
    names
        Of the measures.
    level
        Of the intervals.
    resamples
        50 to a million.
    seed
        The same seed gives the same intervals, whatever the number of threads.
    interval : {"bca", "percentile"}
        Bias-corrected and accelerated (Efron 1987), or plain quantiles.
    expand
        Move the quantiles out for few subjects.
    progress
        Show a bar (needs tqdm).

    Returns
    -------
    Paired

    Examples
    --------
    >>> change = compare_pairs([10, 12, 8, 10], [8, 9, 7, 6])
    >>> change.difference.value, change.relative.value
    (array([-2.5]), array([-0.25]))
    """
    a, b = (_measures(values, word) for values, word in ((first, "first"), (second, "second")))
    if interval not in ("bca", "percentile"):
        raise refuse(f"interval is {interval!r}: it must be 'bca' or 'percentile'", "interval")
    if not 0 < level < 1:
        raise refuse("level must lie between 0 and 1", "level")
    labels = tuple(names) if names is not None else _labels(a.shape[1])
    if len(labels) != a.shape[1]:
        raise refuse(f"names has {len(labels)} entries for {a.shape[1]} measures", "names")
    chosen = options(
        "ulna_paired_options",
        level=float(level),
        # 0 would mean the default; the core refuses below 50.
        resamples=max(int(resamples), 1),
        seed=int(seed),
        percentile=interval == "percentile",
        plain=not expand,
    )
    out = np.empty((a.shape[1], 3, 4))
    pointer = ffi.cast("double *", out.__array_interface__["data"][0])
    count = ffi.new("int64_t *")
    long_call(
        lib.ulna_paired_compare,
        *(view(a), view(b), chosen, ffi.NULL, pointer, out.size, count),
        progress=progress,
        label="bootstrap",
    )
    parts = [Interval(*(out[:, which, column].copy() for column in range(4))) for which in range(3)]
    return Paired(labels, *parts, subjects=a.shape[0], level=float(level))


def _labels(count: int) -> tuple[str, ...]:
    return ("value",) if count == 1 else tuple(f"measure {i + 1}" for i in range(count))


def _measures(values: Any, word: str) -> Array:
    table = np.asarray(values, dtype=float)
    if table.ndim == 1:
        table = table[:, None]
    if table.ndim != 2 or table.shape[1] == 0:
        raise refuse(f"{word} must have the shape (subjects,) or (subjects, measures)", word)
    return table
