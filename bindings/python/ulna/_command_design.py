"""``ulna design``: make a perturbation, check it against limits, foresee its errors, write it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ._command import (
    OK,
    Usage,
    add_command,
    check_file,
    count,
    not_negative,
    number,
    positive,
    require_matplotlib,
    seed,
)

_EXAMPLES = """  ulna design multisine --out design.csv
  ulna design multisine --peak 15 --unit mm --limit-force 20 --tremor 1 --plot
  ulna design steps --size 2 --unit N --seed 3 --out design.csv
  ulna design binary --axes y --minutes 10 --json"""


def add_to(commands: Any) -> None:
    """Add the command ``design`` with its three kinds."""
    parser = add_command(
        commands,
        "design",
        summary="make a perturbation for a robot, check it and foresee its errors",
        examples=_EXAMPLES,
    )
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    multisine = _add_kind(
        kinds, "multisine", "sums of sinusoids",
        "  ulna design multisine --peak 15 --unit mm --out design.csv --plot",
    )  # fmt: skip
    size = multisine.add_mutually_exclusive_group()
    size.add_argument("--peak", type=positive, help="largest magnitude of each axis, in --unit")
    size.add_argument("--rms", type=positive, help="root mean square of each axis, in --unit")
    multisine.add_argument("--lines", type=count, default=10, help="an axis (default: 10)")
    multisine.add_argument(
        "--band", type=_band, default=(0.0, 3.0), metavar="LOW,HIGH", help="Hz (default: 0,3)"
    )
    multisine.add_argument(
        "--phases", choices=("optimised", "random", "schroeder"), default="optimised",
        help="of the sinusoids (default: optimised for a low crest factor)",
    )  # fmt: skip
    multisine.add_argument("--shared", action="store_true", help="all axes have the same lines")
    multisine.add_argument("--period", type=positive, help="lines are multiples of 1 / period, s")
    multisine.add_argument(
        "--slope", type=number, default=0.0, help="amplitude ~ frequency to this power (default: 0)"
    )
    multisine.add_argument(
        "--fade", type=not_negative, default=0.0, help="smooth rise and fall, s (default: 0)"
    )
    _add_duration(multisine)

    steps = _add_kind(
        kinds, "steps", "underdamped steps in random directions",
        "  ulna design steps --size 2 --unit N --seed 3 --out design.csv",
    )  # fmt: skip
    steps.add_argument("--size", type=positive, help="of a step, in --unit (default: 5 mm or 2 N)")
    steps.add_argument("--directions", type=count, help="about the circle (default: 8)")
    steps.add_argument("--repeats", type=count, default=2, help="of each direction (default: 2)")
    steps.add_argument(
        "--hold", type=_band, default=(1.5, 2.0), metavar="LEAST,MOST", help="s (default: 1.5,2)"
    )
    steps.add_argument(
        "--wait", type=_band, default=(2.0, 7.0), metavar="LEAST,MOST",
        help="from a hold to the next step, s (default: 2,7)",
    )  # fmt: skip
    _add_filter(steps)

    binary = _add_kind(
        kinds, "binary", "a random binary sequence through an underdamped filter",
        "  ulna design binary --amplitude 2 --axes y --out design.csv", unit="N", axes="y",
    )  # fmt: skip
    binary.add_argument(
        "--amplitude", type=positive, help="plus or minus this, in --unit (default: 2 N or 5 mm)"
    )
    binary.add_argument(
        "--clock",
        type=positive,
        default=0.5,
        help="the sign is drawn anew this often, s (default: 0.5)",
    )
    _add_duration(binary)
    _add_filter(binary)


def _add_kind(
    kinds: Any, name: str, summary: str, examples: str, unit: str = "m", axes: str = "x,y"
) -> argparse.ArgumentParser:
    parser = add_command(kinds, name, summary=summary, examples=examples)
    parser.add_argument(
        "--unit",
        default=unit,
        help=f"m, mm, rad, deg, N, Nm: what the robot follows (default: {unit})",
    )
    parser.add_argument("--axes", default=axes, metavar="X,Y", help=f"names (default: {axes})")
    parser.add_argument("--rate", type=positive, default=1000.0, help="Hz (default: 1000)")
    parser.add_argument("--seed", type=seed, default=0, help="from 0 (default: 0)")
    parser.add_argument("--out", metavar="CSV", help="write the table for the robot's controller")
    parser.add_argument(
        "--derivatives", action="store_true", help="with velocity and acceleration of the reference"
    )
    parser.add_argument(
        "--plot", action="store_true", help="write a figure beside --out, or design.png"
    )
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )
    expected = parser.add_argument_group("what is expected")
    expected.add_argument(
        "--arm", metavar="JSON",
        help="file with M, B and K, as `ulna assess --json` prints (default: a relaxed arm; of that "
        "its entry along y for one axis)",
    )  # fmt: skip
    expected.add_argument("--stiffness", type=not_negative, help="of the robot, N/m or N m/rad")
    expected.add_argument("--damping", type=not_negative, help="of the robot, N s/m or N m s/rad")
    expected.add_argument(
        "--mass", type=not_negative, default=1.1, help="of the robot (default: 1.1)"
    )
    expected.add_argument(
        "--tremor", type=not_negative, default=1.0, help="standard deviation, N or N m (default: 1)"
    )
    expected.add_argument("--minutes", type=positive, help="of the experiment (default: once)")
    expected.add_argument("--limit-force", type=positive, metavar="N", help="N or N m")
    expected.add_argument("--limit-displacement", type=positive, metavar="M", help="m or rad")
    expected.add_argument("--limit-velocity", type=positive, metavar="M/S", help="m/s or rad/s")
    expected.add_argument(
        "--fit", action="store_true", help="make the design as large as the limits allow"
    )
    parser.set_defaults(run=_design)
    return parser


def _add_duration(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--duration", type=positive, default=50.0, help="s (default: 50)")


def _add_filter(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--damping-ratio", type=positive, default=0.1, help="of the filter (default: 0.1)"
    )
    parser.add_argument(
        "--natural",
        type=positive,
        default=15.0,
        metavar="RAD/S",
        help="of the filter (default: 15)",
    )


def _band(text: str) -> tuple[float, float]:
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not two numbers, as 0,3")
    low, high = not_negative(parts[0]), positive(parts[1])
    if low > high:
        raise argparse.ArgumentTypeError(f"{text!r}: the smaller number comes first")
    return low, high


def _design(options: argparse.Namespace) -> int:
    from .design import Limits, Noise, Robot

    target = None if options.out is None else Path(options.out)
    if target is not None:
        check_file(target)
    if options.plot:
        require_matplotlib("--plot")
    limits = Limits(
        force=options.limit_force,
        displacement=options.limit_displacement,
        velocity=options.limit_velocity,
    )
    robot = Robot(stiffness=options.stiffness, damping=options.damping, mass=options.mass)
    noise = Noise(tremor=options.tremor)
    made = _make(options)
    arm = _arm(options.arm, made.n)
    checked = made.check(arm, robot=robot, limits=limits, noise=noise)
    if options.fit:
        made, checked = _fitted(made, checked, arm, robot, limits, noise)
    planned = made.plan(arm, robot=robot, noise=noise, minutes=options.minutes)
    if target is not None:
        made.to_csv(target, derivatives=options.derivatives)
    figure = _write_figure(made, target) if options.plot else None
    if options.json:
        print(
            json.dumps(_result(made, checked, planned, target, figure), indent=2, allow_nan=False)
        )
        return OK
    print("\n\n".join(part.summary() for part in (made, checked, planned)))
    for word, path in (("table", target), ("figure", figure)):
        if path is not None:
            print(f"\n{word}: {path}")
    return OK


def _make(options: argparse.Namespace) -> Any:
    from . import design

    shared = {
        "unit": options.unit,
        "axes": tuple(options.axes.split(",")),
        "rate_hz": options.rate,
        "seed": options.seed,
    }
    if options.kind == "multisine":
        return design.multisine(
            peak=options.peak,
            rms=options.rms,
            lines=options.lines,
            band_hz=options.band,
            duration_s=options.duration,
            phases=options.phases,
            shared_lines=options.shared,
            period_s=options.period,
            slope=options.slope,
            fade_s=options.fade,
            **shared,
        )
    shared |= {"damping_ratio": options.damping_ratio, "natural_rad_s": options.natural}
    if options.kind == "steps":
        return design.steps(
            size=options.size,
            directions=options.directions,
            repeats=options.repeats,
            hold_s=options.hold,
            wait_s=options.wait,
            **shared,
        )
    return design.random_binary(
        amplitude=options.amplitude, clock_s=options.clock, duration_s=options.duration, **shared
    )


def _arm(path: str | None, n: int) -> Any:
    from .design import Arm

    if path is None:
        arm = Arm()
        if n == arm.n:
            return arm
        if n == 1:
            return Arm(M=arm.M[1, 1], B=arm.B[1, 1], K=arm.K[1, 1])
        raise Usage(f"--arm is needed for {n} axes: a JSON file with M, B and K")
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        return Arm(M=found["M"], B=found["B"], K=found["K"])
    except (KeyError, TypeError, json.JSONDecodeError, UnicodeDecodeError) as failure:
        raise Usage(f"--arm {path} is no JSON object with M, B and K ({failure})") from failure


def _fitted(
    made: Any, checked: Any, arm: Any, robot: Any, limits: Any, noise: Any
) -> tuple[Any, Any]:
    """The design as large as the limits allow, a thousandth below."""
    if checked.scale == float("inf"):
        raise Usage(
            "--fit needs a limit: give --limit-force, --limit-displacement or --limit-velocity"
        )
    if checked.scale <= 0:
        raise Usage(f"--fit cannot help. {checked.message}")
    made = made.scaled(0.999 * checked.scale)
    return made, made.check(arm, robot=robot, limits=limits, noise=noise)


def _write_figure(made: Any, target: Path | None) -> Path:
    import matplotlib.pyplot as plt

    path = Path("design.png") if target is None else target.with_suffix(".png")
    figure = made.plot()
    figure.savefig(path, dpi=200)
    plt.close(figure)
    return path


def _finite(value: float) -> float | None:
    return float(value) if abs(value) < float("inf") else None


def _numbers(values: Any) -> list[float | None]:
    return [_finite(value) for value in values]


def _result(made: Any, checked: Any, planned: Any, target: Path | None, figure: Path | None) -> Any:
    return {
        "kind": made.kind,
        "unit": made.unit,
        "axes": list(made.axes),
        "rate_hz": made.rate_hz,
        "duration_s": made.duration_s,
        "seed": made.seed,
        "peak": made.peak.tolist(),
        "rms": made.rms.tolist(),
        "crest": made.crest.tolist(),
        "segments": [[s.begin, s.end] for s in made.segments],
        "notes": list(made.notes),
        "provenance": made.provenance,
        "safety": {
            "within": checked.within,
            "scale": _finite(checked.scale),
            "message": checked.message,
            "peaks": {name: _numbers(values) for name, values in checked.peaks.items()},
            "limits": {name: _finite(value) for name, value in checked.limits.items()},
        },
        "plan": {
            "minutes": planned.minutes,
            "estimator": planned.estimator,
            "parameters": list(planned.names),
            "value": _numbers(planned._truth),
            "standard_error": _numbers(planned._errors),
            "relative": {name: _finite(value) for name, value in planned.relative.items()},
            "least_squares_bias": _numbers(planned.least_squares_bias),
            "rho": planned.rho.tolist(),
            "warnings": list(planned.warnings),
        },
        "table": None if target is None else str(target),
        "figure": None if figure is None else str(figure),
    }
