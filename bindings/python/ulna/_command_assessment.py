"""``ulna simulate assessment``: an exoskeleton moves an arm and says how stiff it is."""

from __future__ import annotations

import argparse
import inspect
import json
import math
import tomllib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from ._command import OK, Usage, add_command, check_file, not_negative, seed

# Status of the command for a run that did not end as ok: the description was sound.
FAILED = 1

_TABLES = ("scene", "soft", "protocol", "link")  # of a scene's file
_MOST_NOISE = 1e6  # N m; the library takes no more


def add_to(kinds: Any) -> None:
    """Add the kind ``assessment`` to ``ulna simulate``."""
    parser = add_command(
        kinds,
        "assessment",
        summary="passive mobilisation of an arm by an exoskeleton, and its stiffness",
        examples="  ulna simulate assessment --out log.csv\n"
        "  ulna simulate assessment --soft --out log.csv\n"
        "  ulna simulate assessment --scene scene.toml --balanced --noise 0.1 --out log.csv\n"
        "  ulna simulate assessment --scene swing.toml --balanced --out swing.csv\n"
        "  ulna assess swing.csv    # of a swing by a few degrees only: the log of a movement\n"
        "                           # through the range is for exo.identify_viscoelasticity",
    )
    parser.epilog = (
        parser.epilog or ""
    ) + "\n  1  the run did not end as ok; the reason is printed"
    parser.add_argument(
        "--scene", metavar="TOML",
        help="[scene]: settings of ulna.exo.exoskeleton, [soft]: of ulna.exo.Soft, [protocol]: of "
        "ulna.exo.Protocol, [[link]]: a device (default: the published device and arm)",
    )  # fmt: skip
    parser.add_argument(
        "--soft", action="store_true", help="cuffs, straps and soft tissue hold the arm"
    )
    parser.add_argument(
        "--reduced",
        action="store_true",
        help="the same as bushings, some twenty times as fast",
    )
    parser.add_argument("--out", metavar="CSV", help="the log")
    parser.add_argument(
        "--shape",
        choices=("logistic", "minimum_jerk", "ramp", "sinusoid"),
        help="of the movement",
    )
    parser.add_argument(
        "--balanced", action="store_true", help="extensors balance the flexors"
    )
    parser.add_argument(
        "--published", action="store_true", help="the published estimator"
    )
    parser.add_argument(
        "--noise",
        type=_noise,
        default=0.0,
        metavar="NM",
        help="rms of the torque's error",
    )
    parser.add_argument(
        "--seed", type=seed, default=0, help="of the error, from 0 (default: 0)"
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object, nothing else"
    )
    parser.set_defaults(run=_assess)


def _noise(text: str) -> float:
    """An rms error of a torque in N m."""
    value = not_negative(text)
    if value > _MOST_NOISE:
        raise argparse.ArgumentTypeError(f"{text} is above {_MOST_NOISE:.0f} N m")
    return value


def _check_out(out: str) -> None:
    """Refuse before the simulation where no log can be written after it."""
    check_file(Path(out))
    if not Path(out).parent.is_dir():
        raise Usage(f"--out {out}: there is no folder {Path(out).parent}")


def _assess(options: argparse.Namespace) -> int:
    from . import exo

    if options.out is not None:
        _check_out(options.out)
    plant, protocol = _scene(options)
    found = exo.mobilise(plant, protocol, published_estimator=options.published)
    record, joints = found.record, found.joints
    if record is not None and options.noise > 0:
        record = exo.with_errors(
            record, plant, torque_nm=options.noise, seed=options.seed
        )
    if record is not None and options.out is not None:
        record.to_csv(options.out)  # before anything that can be refused of it
    if record is not None and options.noise > 0 and found.status == "ok":
        joints = exo.identify_viscoelasticity(record, plant, published=options.published)
    if options.json:
        print(
            json.dumps(
                _result(found, joints, record, options.out), indent=2, allow_nan=False
            )
        )
    else:
        head = found.status if not found.reason else f"{found.status}: {found.reason}"
        print(head, *(joint.summary() for joint in joints), *found.notes, sep="\n")
        if record is not None and options.out is not None:
            print(f"log: {options.out}")
    return OK if found.status == "ok" else FAILED


def _scene(options: argparse.Namespace) -> tuple[Any, Any]:
    from . import exo

    described: dict[str, Any] = {}
    if options.scene is not None:
        try:
            described = tomllib.loads(Path(options.scene).read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as failure:
            raise Usage(f"--scene {options.scene} is not TOML: {failure}") from failure
    for name in described:
        if name not in _TABLES:
            raise Usage(
                f"--scene {options.scene} has {name!r}, which there is not; there are "
                f"[{'], ['.join(_TABLES[:-1])}] and [[link]]"
            )
    scene = _table(described, "scene", options.scene)
    settings = _table(described, "protocol", options.scene)
    known = set(inspect.signature(exo.exoskeleton).parameters) - {"device", "soft"}
    soft: Any = options.soft or options.reduced
    if "soft" in described:
        soft = _table(described, "soft", options.scene)
        _refuse_unknown(soft, {f.name for f in fields(exo.Soft)}, "soft", options.scene)
    _refuse_unknown(scene, known, "scene", options.scene)
    _refuse_unknown(
        settings, {f.name for f in fields(exo.Protocol)}, "protocol", options.scene
    )
    if options.shape is not None:
        settings["shape"] = options.shape
    if options.balanced:
        settings["balanced"] = True
    device = {"link": described["link"]} if "link" in described else None
    plant = exo.exoskeleton(device, soft=soft, **scene)
    return plant.reduced() if options.reduced else plant, exo.Protocol(**settings)


def _table(described: dict[str, Any], name: str, path: str) -> dict[str, Any]:
    table = described.get(name, {})
    if not isinstance(table, dict):
        raise Usage(f"--scene {path}: {name} must be a table, [{name}]")
    return dict(table)


def _refuse_unknown(
    table: dict[str, Any], known: set[str], name: str, path: str
) -> None:
    for key in table:
        if key not in known:
            raise Usage(
                f"--scene {path}: [{name}] has {key!r}, which there is not; there are "
                f"{', '.join(sorted(known))}"
            )


def _result(found: Any, joints: Any, record: Any, out: str | None) -> dict[str, Any]:
    def plain(value: Any) -> Any:
        if isinstance(value, float) and not math.isfinite(value):
            return None
        return [plain(v) for v in value] if isinstance(value, (list, tuple)) else value

    return {
        "status": found.status,
        "reason": found.reason,
        "joints": [{k: plain(v) for k, v in asdict(joint).items()} for joint in joints],
        "notes": list(found.notes),
        "simulated_s": found.simulated_s,
        "start_s": found.start_s,
        "largest_slip_rad": plain(found.largest_slip_rad),
        "rows": 0 if record is None else len(record.time),
        "log": out if record is not None else None,
    }
