"""The design of a study: which points are run, in what order."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from ._call import Handle, check, ffi, lib, long_call, options, out_array, result, view
from ._factors import Factor, Uniform, check_factors
from .record import refuse

__all__ = ["StudyDesign"]

SCHEMES = {
    "saltelli": lib.ULNA_SCHEME_SALTELLI,
    "radial": lib.ULNA_SCHEME_RADIAL,
    "trajectories": lib.ULNA_SCHEME_TRAJECTORIES,
    "sample": lib.ULNA_SCHEME_SAMPLE,
}
SAMPLERS = {
    "sobol": lib.ULNA_SAMPLER_SOBOL,
    "latin": lib.ULNA_SAMPLER_LATIN,
    "monte-carlo": lib.ULNA_SAMPLER_MONTE_CARLO,
    "pooled-latin": lib.ULNA_SAMPLER_POOLED_LATIN,
    "given": lib.ULNA_SAMPLER_MONTE_CARLO,
}
DUMMY = "dummy"


class _Sampling(Handle):
    kind = "ulna_sampling"
    __slots__ = ()


def one_of(table: Mapping[str, int], value: Any, argument: str) -> int:
    """The constant behind a word."""
    if not isinstance(value, str) or value not in table:
        known = ", ".join(repr(word) for word in table if word != "given")
        raise refuse(f"{argument} is {value!r}; it must be one of {known}", argument)
    return table[value]


def check_names(given: Iterable[str], known: tuple[str, ...], where: str = "") -> None:
    """Refuse a name that means nothing here, and say which may be meant."""
    for name in given:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"; known are {', '.join(known)}" if known else ""
            hint = f"; did you mean {close[0]!r}?" if close else hint
            raise refuse(f"{where}{name!r} means nothing here{hint}", name)


def check_share(value: Any, argument: str) -> None:
    """Refuse what does not lie between 0 and 1."""
    if not (isinstance(value, Real) and 0.0 < value < 1.0):
        raise refuse(f"{argument} is {value!r}; it must lie between 0 and 1", argument)


@dataclass(frozen=True, eq=False)
class StudyDesign:
    """Points of a study, a pure function of what is named here: made again from it anywhere.

    Attributes
    ----------
    factors : dict of str to Factor
    groups : dict of str to str, or None
        Group of each factor; a group moves as one.
    scheme : str
        "saltelli" (variance-based), "radial", "trajectories" (elementary effects), "sample".
    sampler : str
        "sobol" (scrambled Sobol' sequence, n a power of two), "latin", "monte-carlo", or
        "pooled-latin" (parity with the SAFE toolbox).
    n : int
        Blocks of one replicate: base points, or repetitions.
    replicates : int
        Independent designs in a row.
    second_order : bool
        Saltelli with the rows that second-order indices need.
    guard : float
        Radial: smallest step, in quantiles; 0 for none. None: 0.25, and 0 of a pooled hypercube,
        whose consecutive rows are not moved apart.
    levels : int
        Trajectories: of the grid.
    candidates : int
        Latin: the one of so many whose closest points are the farthest apart.
    seed : int
    dummy : bool
        The last column is a factor that the function never sees.
    rows, blocks, block_rows : int
        Runs; blocks of all replicates; runs of a block.
    """

    factors: Mapping[str, Factor]
    groups: Mapping[str, str] | None = None
    scheme: str = "saltelli"
    sampler: str = "sobol"
    n: int = 1024
    replicates: int = 1
    second_order: bool = False
    guard: float | None = None
    levels: int = 4
    candidates: int = 1
    seed: int = 0
    dummy: bool = False
    points: np.ndarray | None = field(default=None, repr=False)
    rows: int = field(init=False, default=0)
    blocks: int = field(init=False, default=0)
    block_rows: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        factors = check_factors(self.factors)
        if self.dummy:
            if DUMMY in factors:
                raise refuse(f"a factor is called {DUMMY!r} already", "dummy")
            factors[DUMMY] = Uniform(0.0, 1.0)
        put = object.__setattr__
        put(self, "factors", factors)
        if self.guard is None:
            put(self, "guard", 0.0 if self.sampler == "pooled-latin" else 0.25)
        if not (isinstance(self.guard, Real) and self.guard >= 0.0):
            raise refuse(
                f"guard is {self.guard!r}; it must be at least 0 and below 0.5, a share of a "
                "factor's probability",
                "guard",
            )
        chosen = self._options()
        if self.sampler == "given":
            points = None if self.points is None else view(self.points)
            handle = _Sampling.make(
                lib.ulna_sampling_given, chosen, ffi.NULL if points is None else points
            )
        else:
            if self.points is not None:
                raise refuse("points are given only with sampler 'given'", "points")
            out = ffi.new("ulna_sampling **")
            long_call(lib.ulna_sampling_new, chosen, ffi.NULL, out)
            handle = _Sampling(out[0])
        info = result("ulna_sampling_info")
        check(lib.ulna_sampling_get_info(handle.pointer, info))
        put(self, "_handle", handle)
        put(self, "rows", info.rows)
        put(self, "blocks", info.blocks)
        put(self, "block_rows", info.block_rows)
        put(self, "independent_steps", bool(info.independent_steps))
        put(self, "has_points", bool(info.has_points))

    def _options(self) -> Any:
        groups = None
        if self.groups is not None:
            unknown = set(self.groups) - set(self.factors)
            if unknown:
                raise refuse(f"groups name no factor: {', '.join(sorted(unknown))}", "groups")
            places = {name: i for i, name in enumerate(self.names)}
            groups = np.array([places[self._group(name)] for name in self.factors], dtype=np.int64)
        return options(
            "ulna_sampling_options",
            factors=len(self.factors),
            groups=groups,
            n=_whole(self.n, "n"),
            replicates=_whole(self.replicates, "replicates"),
            levels=_whole(self.levels, "levels"),
            candidates=_whole(self.candidates, "candidates"),
            seed=_seed(self.seed),
            guard=-1.0 if self.guard == 0 else self.guard,
            scheme=one_of(SCHEMES, self.scheme, "scheme"),
            sampler=one_of(SAMPLERS, self.sampler, "sampler"),
            second_order=bool(self.second_order),
        )

    def _group(self, name: str) -> str:
        return name if self.groups is None else self.groups.get(name, name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the groups that indices are given for: the factors, when they are not grouped."""
        return tuple(dict.fromkeys(self._group(name) for name in self.factors))

    @property
    def function_factors(self) -> tuple[str, ...]:
        """Names of the factors that the function takes."""
        return tuple(self.factors)[:-1] if self.dummy else tuple(self.factors)

    def unit(self, *, first: int = 0, count: int | None = None) -> np.ndarray:
        """Rows of the design in the unit cube, (count, factors). Any range is made by itself."""
        count = self.rows - first if count is None else count
        flat = out_array(lib.ulna_sampling_get_rows, self._handle.pointer, first, count)
        return flat.reshape(-1, len(self.factors))

    def values(self, *, first: int = 0, count: int | None = None) -> np.ndarray:
        """Rows of the design as values of the factors, (count, factors), in SALib's order.

        Examples
        --------
        >>> import ulna
        >>> design = ulna.StudyDesign({"a": ulna.Uniform(0, 2)}, n=4)
        >>> design.values().shape
        (12, 1)
        """
        out = self.unit(first=first, count=count)
        for column, factor in enumerate(self.factors.values()):
            out[:, column] = factor.quantile(out[:, column])
        return out

    def moves(self, *, block: int = 0) -> np.ndarray:
        """Which group each row of a block moves alone; -1 for none."""
        return out_array(lib.ulna_sampling_get_moves, self._handle.pointer, block)

    def __reduce__(self) -> Any:
        # A handle does not travel; the specification does, and gives the same points.
        factors = {k: v for k, v in self.factors.items() if not (self.dummy and k == DUMMY)}
        keywords = {
            name: getattr(self, name)
            for name in (
                "groups", "scheme", "sampler", "n", "replicates", "second_order", "guard",
                "levels", "candidates", "seed", "dummy", "points",
            )
        }  # fmt: skip
        return _rebuild, (factors, keywords)

    def __repr__(self) -> str:
        return (
            f"<StudyDesign {self.scheme}, {len(self.factors)} factors, {self.rows} runs in "
            f"{self.blocks} blocks, sampler {self.sampler}, seed {self.seed}>"
        )


def _rebuild(factors: dict[str, Factor], keywords: dict[str, Any]) -> StudyDesign:
    return StudyDesign(factors, **keywords)


def _whole(value: Any, name: str) -> int:
    # Zero bytes would mean the default.
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and value >= 1:
        return int(value)
    raise refuse(f"{name} is {value!r}; it must be a whole number of at least 1", name)


def _seed(value: Any) -> int:
    if isinstance(value, (int, np.integer)) and -(2**63) <= value < 2**63:
        return int(value)
    raise refuse(f"seed is {value!r}; it must be a whole number of 64 bits", "seed")
