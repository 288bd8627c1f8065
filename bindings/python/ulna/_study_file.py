"""A study in a TOML file: factors, model, design, outputs, budget."""

from __future__ import annotations

import dataclasses
import inspect
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ._factors import (
    Discrete,
    Factor,
    LogUniform,
    Normal,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from ._study_design import check_names, one_of
from ._study_indices import ON_FAILURE, OPTIONS
from ._study_model import FileModel, ProgramModel
from ._study_two_phase import phases
from .record import refuse
from .study import Study, StudyDesign, check_running

_DISTRIBUTIONS: dict[str, type[Factor]] = {
    "uniform": Uniform,
    "normal": Normal,
    "truncated-normal": TruncatedNormal,
    "triangular": Triangular,
    "log-uniform": LogUniform,
    "discrete": Discrete,
}
_TOP = ("title", "model", "program", "outputs", "units", "vectorized", "factors", "groups",
        "design", "run", "budget", "analysis")  # fmt: skip
_SCREEN = ("scheme", "guard", "levels")
_RANK = ("second_order", "replicates", "dummy")
_DESIGN = {
    "two-phase": ("r", "n", "seed", "share", "keep", "decide_by", "fix_at", *_SCREEN, *_RANK),
    "sobol": ("n", "seed", "sampler", *_RANK),
    "screen": ("r", "seed", "sampler", "replicates", "dummy", *_SCREEN),
    "sample": ("n", "seed", "sampler", "candidates"),
}
_RUN = ("workers", "isolate", "timeout_s", "retries", "task_s", "on_failure")
_BUDGET = ("runs", "hours")
_ANALYSIS = {
    "two-phase": OPTIONS["sobol"],
    "sobol": OPTIONS["sobol"],
    "screen": OPTIONS["screen"],
    "sample": (),
}


@dataclass(frozen=True)
class StudyFile:
    """What a file says, checked."""

    path: Path
    title: str
    study: Study
    units: Mapping[str, str]
    kind: str
    design: Mapping[str, Any]
    run: Mapping[str, Any]
    analysis: Mapping[str, Any]
    on_failure: str
    most_runs: int | None
    budget_s: float | None

    def first_design(self) -> tuple[str, StudyDesign]:
        """The first design and the folder of its journal."""
        chosen = dict(self.design)
        if self.kind in ("two-phase", "screen"):
            names = ("seed", *_SCREEN) if self.kind == "two-phase" else self._of(_DESIGN["screen"])
            options = {name: chosen[name] for name in names if name in chosen and name != "r"}
            options = {"scheme": "radial", "sampler": "latin", **options, "n": chosen["r"]}
            return ("screen" if self.kind == "two-phase" else "runs"), self.study.design(**options)
        scheme = "saltelli" if self.kind == "sobol" else "sample"
        return "runs", self.study.design(scheme=scheme, **chosen)

    def _of(self, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in names if name in self.design)

    def largest_ranking(self) -> StudyDesign | None:
        """The second design of two phases, if nothing were fixed."""
        if self.kind != "two-phase":
            return None
        chosen = {name: self.design[name] for name in self._of(_RANK)}
        return self.study.design(n=self.design["n"], seed=self.design["seed"], **chosen)

    def options(self, analysis: str) -> dict[str, Any]:
        """Options of an analysis, "screen" or "sobol"."""
        chosen = self._told(analysis)
        return {"on_failure": self.on_failure, "seed": self.design["seed"], **chosen}

    def two_phases(self) -> dict[str, Any]:
        """Options of both phases."""
        names = ("r", "n", "share", "seed", "keep", "decide_by")
        return {
            **{name: self.design[name] for name in names},
            "values": self.design["fix_at"],
            "on_failure": self.on_failure,
            "screening": {name: self.design[name] for name in self._of(_SCREEN)}
            | self._told("screen"),
            "ranking": {name: self.design[name] for name in self._of(_RANK)} | self._told("sobol"),
        }

    def _told(self, analysis: str) -> dict[str, Any]:
        return {name: self.analysis[name] for name in OPTIONS[analysis] if name in self.analysis}

    def check_analyses(self) -> None:
        """Refuse what the analyses would refuse after all runs."""
        if self.kind == "two-phase":
            phases(self.study, **self.two_phases())
        elif self.kind != "sample":
            self.study._rehearse(self.first_design()[1], self.kind, self.options(self.kind))


def read_study(path: str | os.PathLike[str]) -> StudyFile:
    """Read a file and check all that can be known before a run."""
    source = Path(path)
    with source.open("rb") as stream:
        try:
            given = tomllib.load(stream)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as failure:
            raise refuse(f"{source} is no TOML file ({failure})", "file") from failure
    try:
        return _checked(source, given)
    except ValueError as failure:  # ArgumentError is one
        text = str(failure)
        raise refuse(text if text.startswith(str(source)) else f"{source}: {text}", "file") from failure


def _checked(source: Path, given: dict[str, Any]) -> StudyFile:
    check_names(given, _TOP, "")
    factors, units = _factors(given.get("factors"))
    groups = given.get("groups")
    if groups is not None and not (
        isinstance(groups, dict) and all(isinstance(g, str) for g in groups.values())
    ):
        raise refuse('[groups] must map factors to the names of their groups, as k = "g"', "groups")
    outputs = given.get("outputs")
    if outputs is not None and not (
        isinstance(outputs, list) and outputs and all(isinstance(o, str) for o in outputs)
    ):
        raise refuse('outputs must be a list of names, as ["K", "D"]', "outputs")
    more = given.get("units", {})
    if not isinstance(more, dict) or set(more) - set(outputs or ["y"]):
        raise refuse('[units] must map outputs to text, as K = "N m/rad"', "units")
    units |= more
    run = _section(given, "run", _RUN)
    on_failure = run.pop("on_failure", "drop_block")
    one_of(ON_FAILURE, on_failure, "[run] on_failure")
    # A program is a process of its own, which needs no other one to be ended.
    check_running(**({**run, "isolate": None} if "program" in given else run))
    analysis = _section(given, "analysis", None)
    budget = _section(given, "budget", _BUDGET)
    design = _section(given, "design", None)
    kind = design.pop("kind", "two-phase")
    if kind not in _DESIGN:
        raise refuse(f"[design] kind is {kind!r}; it must be one of {', '.join(_DESIGN)}", "design")
    check_names(design, _DESIGN[kind], f"[design] of kind {kind!r}: ")
    check_names(analysis, _ANALYSIS[kind], f"[analysis] of kind {kind!r}: ")
    defaults: dict[str, Any] = {"seed": 0}
    if kind in ("two-phase", "screen"):
        defaults["r"] = 64
    if kind != "screen":
        defaults["n"] = 1024
    if kind == "two-phase":
        defaults |= {"share": 0.05, "keep": [], "decide_by": [], "fix_at": {}}
    design = {**defaults, **design}
    for name in ("r", "n"):
        if name in design and (not isinstance(design[name], int) or design[name] < 1):
            raise refuse(f"[design] {name} must be a whole number of at least 1", "design")
    hours, most = budget.get("hours"), budget.get("runs")
    if hours is not None and not (isinstance(hours, (int, float)) and hours > 0):
        raise refuse("[budget] hours must be positive", "budget")
    if most is not None and not (isinstance(most, int) and most > 0):
        raise refuse("[budget] runs must be a whole number above 0", "budget")
    function = _model(given, source.parent, factors, outputs, run.get("timeout_s"))
    if isinstance(function, ProgramModel):
        # A program is a process of its own, which ends itself when it takes too long.
        run.pop("timeout_s", None)
        run["isolate"] = False
    study = Study(
        factors,
        function,
        outputs=outputs,
        groups=groups,
        vectorized=given.get("vectorized", False),
        units={name: unit for name, unit in units.items() if unit},
    )
    found = StudyFile(
        path=source,
        title=str(given.get("title", source.stem)),
        study=study,
        units=units,
        kind=kind,
        design=design,
        run=run,
        analysis=analysis,
        on_failure=on_failure,
        most_runs=most,
        budget_s=None if hours is None else 3600.0 * hours,
    )
    found.check_analyses()
    designs = [found.first_design()[1], found.largest_ranking()]
    rows = sum(one.rows for one in designs if one is not None)
    if most is not None and rows > most:
        raise refuse(
            f"the design needs up to {rows} runs, [budget] runs allows {most}: take a smaller "
            "n or r",
            "budget",
        )
    return found


def _section(given: dict[str, Any], name: str, known: tuple[str, ...] | None) -> dict[str, Any]:
    section = given.get(name, {})
    if not isinstance(section, dict):
        raise refuse(f"{name} must be a table: [{name}]", name)
    if known is not None:
        check_names(section, known, f"[{name}] ")
    return dict(section)


def _factors(given: Any) -> tuple[dict[str, Factor], dict[str, str]]:
    if not isinstance(given, dict) or not given:
        raise refuse("there must be a table [factors.NAME] for each factor", "factors")
    factors: dict[str, Factor] = {}
    units: dict[str, str] = {}
    for name, table in given.items():
        if not isinstance(table, dict):
            raise refuse(f"[factors.{name}] must be a table", "factors")
        words = dict(table)
        units[name] = str(words.pop("unit", ""))
        family = words.pop("distribution", "uniform")
        if family not in _DISTRIBUTIONS:
            raise refuse(
                f"[factors.{name}] distribution is {family!r}; it must be one of "
                f"{', '.join(_DISTRIBUTIONS)}",
                "factors",
            )
        kind = _DISTRIBUTIONS[family]
        fields = tuple(f.name for f in dataclasses.fields(kind))
        check_names(words, fields, f"[factors.{name}] ")
        needed = [
            f.name for f in dataclasses.fields(kind)
            if f.default is dataclasses.MISSING and f.name not in words
        ]  # fmt: skip
        if needed:
            raise refuse(f"[factors.{name}] lacks {', '.join(needed)}", "factors")
        for field, value in words.items():
            if not all(_is_number(v) for v in (value if isinstance(value, list) else [value])):
                raise refuse(f"[factors.{name}] {field} is {value!r}, which is no number", "factors")
        try:
            factors[name] = kind(**words)
        except (ValueError, TypeError) as failure:
            raise refuse(f"[factors.{name}] {failure}", "factors") from failure
    return factors, units


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _model(
    given: dict[str, Any],
    folder: Path,
    factors: Mapping[str, Factor],
    outputs: Any,
    timeout_s: Any,
) -> FileModel | ProgramModel | None:
    if "model" in given and "program" in given:
        raise refuse("there is a model and a program: one of them is too many", "model")
    if "program" in given:
        words = given["program"]
        if not isinstance(words, list):
            raise refuse("program must be a list of words, as ['./simulate', '{k}']", "program")
        return ProgramModel(words, list(factors), outputs or ["y"], folder, timeout_s)
    if "model" not in given:
        return None
    if not isinstance(given["model"], str):
        raise refuse("model must be text, as 'file.py:function'", "model")
    model = FileModel(given["model"], folder)
    try:
        inspect.signature(model.function()).bind(**dict.fromkeys(factors, 0.0))
    except TypeError as failure:
        raise refuse(f"the model does not take these factors ({failure})", "model") from failure
    except ValueError:  # a builtin without a signature
        pass
    return model
