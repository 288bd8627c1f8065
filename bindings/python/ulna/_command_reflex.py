"""The command ``ulna reflex``: intrinsic and reflex torque of a joint."""

from __future__ import annotations

import argparse
from typing import Any

from ._command import (
    add_command,
    add_recording,
    add_results,
    check_out,
    count,
    not_negative,
    odd,
    positive,
    read_recording,
    say,
)


def delay_range(text: str) -> tuple[float, float]:
    """Two times in ms with a comma between, as ``20,100``."""
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not two times in ms, as 20,100")
    low, high = not_negative(parts[0]), positive(parts[1])
    if high < 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is in ms, as 20,100")
    if low >= high:
        raise argparse.ArgumentTypeError(f"{text!r} must go from a shorter to a longer delay")
    return 1e-3 * low, 1e-3 * high


def add_to(commands: Any) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "reflex",
        summary="separate intrinsic and reflex torque of a joint, with the reflex's delay",
        examples="  ulna reflex ankle.csv --lowpass 50\n"
        "  ulna reflex ankle.csv --lowpass 50 --intrinsic impulse-response --out report\n"
        "  ulna reflex ankle.csv --side rising --delay 20,100 --json",
    )
    add_recording(parser)
    add_results(parser, "result.json and the figure")
    model = parser.add_argument_group("model")
    model.add_argument(
        "--intrinsic", choices=("second-order", "impulse-response"), default="second-order",
        help="the path that acts at once (default: %(default)s)",
    )  # fmt: skip
    model.add_argument(
        "--side", choices=("auto", "rising", "falling"), default="auto",
        help="velocity of which direction excites the reflex (default: the better of both)",
    )  # fmt: skip
    model.add_argument(
        "--order", type=int, choices=(1, 2), default=2, help="of the reflex dynamics (default: 2)"
    )
    model.add_argument(
        "--delay", metavar="MS,MS", type=delay_range, default=(0.0, 0.12),
        help="range of the reflex delay in ms (default: 0,120)",
    )  # fmt: skip
    model.add_argument(
        "--threshold", metavar="RAD/S", type=not_negative, default=0.0,
        help="velocity that excites no reflex",
    )  # fmt: skip
    model.add_argument(
        "--powers", metavar="N", type=count, default=1,
        help="static torque of the position up to this power (default: 1)",
    )  # fmt: skip
    fit = parser.add_argument_group("fit")
    fit.add_argument("--lowpass", metavar="HZ", type=positive, help="cut-off of the low pass")
    fit.add_argument("--window", metavar="N", type=odd, help="samples of the smoothing window")
    fit.add_argument(
        "--train", metavar="S", type=positive, help="seconds that identify; the rest validates"
    )
    fit.add_argument(
        "--seed", metavar="N", type=int, default=0, help="of the test and of intervals"
    )
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    import ulna

    check_out(options)
    estimate = ulna.identify_reflex(
        read_recording(options),
        intrinsic=options.intrinsic,
        side=options.side,
        order=options.order,
        delay_range_s=options.delay,
        threshold_rad_s=options.threshold,
        position_powers=options.powers,
        lowpass_hz=options.lowpass,
        window=options.window,
        train_s=options.train,
        seed=options.seed,
    )
    return say(options, "reflex", estimate, result(estimate, source=options.file))


def result(estimate: Any, *, source: Any = None) -> dict[str, Any]:
    """Everything of a reflex estimate that fits in a JSON object."""
    from ._result import record_information

    names = ("M", "B", "K", "gain", "omega", "zeta", "delay")
    out: dict[str, Any] = {name: estimate.value(name) for name in names}
    out["standard_errors"] = {name: estimate.se(name) for name in names}
    out["intervals_95"] = {name: estimate.interval(name) for name in names}
    out["units"] = dict(estimate.units)
    for name in (
        "axis", "side", "intrinsic", "order", "outcome", "p_value", "vaf", "vaf_interval",
        "vaf_intrinsic", "vaf_reflex", "vaf_without", "vaf_gain_interval", "vaf_train",
        "vaf_train_without", "vaf_train_other", "vaf_impulse", "powers", "powers_se",
        "position_mean", "profile_delay_s", "profile_vaf", "intrinsic_response",
        "reflex_response", "refitted", "train_rows", "held_out_rows", "train_s", "test_blocks",
        "warnings", "notes", "provenance", "preprocessing",
    ):  # fmt: skip
        out[name] = getattr(estimate, name)
    out["record"] = {"source": source, **record_information(estimate.record)}
    if not isinstance(source, (str, type(None))) and len(source) == 1:
        out["record"]["source"] = source[0]
    return out
