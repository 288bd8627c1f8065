"""The command ``ulna reflex``: intrinsic and reflex torque of a joint."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ._command import (
    OK,
    add_command,
    check_folder,
    count,
    not_negative,
    odd,
    positive,
    require_matplotlib,
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
    parser.add_argument(
        "file", metavar="FILE", nargs="+",
        help="recording of one joint: CSV, TSV, MAT, NPZ or HDF5; several files are trials",
    )  # fmt: skip
    parser.add_argument("--map", metavar="MAP", help="TOML file that names columns and units")
    parser.add_argument("--split", action="store_true", help="start a new trial after gaps")
    parser.add_argument(
        "--regularise", action="store_true", help="put jittering time stamps on an even clock"
    )
    parser.add_argument("--out", metavar="DIR", help="write result.json and the figure")
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")
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

    if options.out is not None:
        require_matplotlib()
        check_folder(Path(options.out))
    record = options.record = ulna.read(options.file, map=options.map)
    if options.split:
        record = options.record = record.split()
    if options.regularise:
        record = options.record = record.regularise()
    estimate = ulna.identify_reflex(
        record,
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
    found = json.dumps(result(estimate, source=options.file), indent=2, allow_nan=False)
    if options.out is not None:
        _write(estimate, Path(options.out), found)
    if options.json:
        print(found)
        return OK
    print(estimate.summary())
    if options.out is not None:
        print(f"\nfigure: {Path(options.out) / 'reflex.png'}")
    return OK


def _write(estimate: Any, folder: Path, text: str) -> None:
    import matplotlib

    from . import plot

    matplotlib.use("Agg")  # a command opens no window
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").write_text(text + "\n", encoding="utf-8")
    with plot.style():
        axes = estimate.plot()
        for ending in ("png", "svg"):
            axes[0].figure.savefig(folder / f"reflex.{ending}")


def result(estimate: Any, *, source: Any = None) -> dict[str, Any]:
    """Everything of a reflex estimate that fits in a JSON object."""
    from . import __version__
    from ._result import plain, record_information

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
    out["ulna"] = __version__
    if not isinstance(source, (str, type(None))) and len(source) == 1:
        out["record"]["source"] = source[0]
    return plain(out)
