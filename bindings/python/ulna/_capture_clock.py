"""One clock for the recordings of a capture, from the force that the motion says is under the feet.

What the floor carries is the body's weight and the acceleration of its centre of mass, so that the
motion predicts the vertical force that shoes and plates measure: the signal that two devices share
without a cable or a clap between them. A recording of inertial sensors shares their acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ._call import AnalysisError
from ._capture_channels import Item
from ._capture_motion import felt_at, lift_of
from .body import Motion
from .clocks import ClockFit, fit_clocks
from .record import refuse

if TYPE_CHECKING:
    from .capture import BodySetup

Array = NDArray[np.float64]

_SLOW_HZ = (0.15, 2.0)


@dataclass(frozen=True, eq=False)
class Clock:
    """How the recordings' clocks run against that of the motion."""

    fits: dict[str, ClockFit] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @classmethod
    def shared(cls) -> Clock:
        """All on one clock."""
        return cls()

    def own_time(self, item: Item, time_s: Array) -> Array:
        """Times of the frames on the clock of a recording."""
        fit = self.fits.get(item.label)
        if fit is None:
            return time_s
        # The inverse of t + offset + drift (t - centre).
        shifted = time_s - fit.offset_s + fit.drift * fit.centre_s
        return np.asarray(shifted / (1.0 + fit.drift))


def common_clock(
    items: Sequence[Item],
    reference: Item,
    time_s: Array,
    setup: BodySetup,
    motion: Motion,
    clocks: str,
) -> Clock:
    """Fits of all recordings but that of the motion."""
    others = [item for item in items if item is not reference]
    if clocks == "shared" or not others:
        return Clock.shared()
    labels = [item.label for item in items]
    if len(set(labels)) < len(labels):
        raise refuse("two recordings have the same file name: rename one", "recordings")
    fits, notes = {}, []
    for item in others:
        ours, theirs = _witness(item, reference, setup, motion)
        good = np.isfinite(ours)
        try:
            fit = _fit(time_s[good], ours[good], item.time_s, theirs)
        except AnalysisError as failure:
            raise AnalysisError(
                f"{item.label} cannot be put on the clock of {reference.label}: {failure}; where both "
                "were recorded on one clock, say that it is shared",
                status=failure.status,
                argument="clocks",
            ) from failure
        fits[item.label] = fit
        notes.append(f"clock of {item.label}: " + fit.summary().replace("\n", "; "))
    return Clock(fits, tuple(notes))


def _fit(ours_s: Array, ours: Array, theirs_s: Array, theirs: Array) -> ClockFit:
    """By fast movements, which tell the time best; by slow ones where these hold too little."""
    try:
        return fit_clocks(ours_s, ours, theirs_s, theirs)
    except AnalysisError:
        return fit_clocks(ours_s, ours, theirs_s, theirs, band_hz=_SLOW_HZ)


def _witness(item: Item, reference: Item, setup: BodySetup, motion: Motion) -> tuple[Array, Array]:
    """What the motion predicts, and what the recording has of it."""
    from ._capture_readings import find_contacts, find_imus, imu_columns

    body = setup.body
    contacts = [found for found in find_contacts([reference, item], setup, all_of=False)
                if found[1] is item]  # fmt: skip
    if contacts:
        vertical = [contact.sign * item.values[:, columns[2]] for contact, _, columns in contacts]
        return lift_of(body, motion), np.sum(vertical, axis=0)
    for imu, _ in find_imus([item], setup):
        found = imu_columns(item, imu, setup)
        if found is not None:
            felt = felt_at(body, motion, imu.link)[2]
            # Its length does not depend on how the sensor sits; free acceleration lacks gravity.
            if not found[0]:
                return np.linalg.norm(felt, axis=1), np.linalg.norm(
                    item.values[:, found[1]], axis=1
                )
    raise refuse(
        f"{item.label} shares no signal with {reference.label} from which their clocks can be put "
        "together: it holds neither contacts nor accelerometers of the body",
        "recordings",
    )
