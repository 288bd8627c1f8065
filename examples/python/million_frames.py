"""A study's worth of whole-body recordings, from files to torques with standard deviations, on the clock.

12 persons, 2 sessions, 12 minutes at 60 frames a second are a million frames of a body with 48 joints. One
session is made up and written as files: the motion and the accelerometers of a suit as CSV or as MVNX, two
shoes as CSV. Then it is read and estimated as often as there are recordings, by as many processes as asked,
each frame with the standard deviation of every torque. What is printed are microseconds of one core a frame
for each step, the time of all, and the largest memory of a process:

    python examples/python/million_frames.py --format mvnx --processes 2

The files of one session have 330 MB (MVNX) or 45 MB (CSV); they lie in a temporary folder meanwhile, and
in the operating system's memory after the first reading.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import ulna
from ulna.body import Body, Motion, human_body, human_names
from ulna.capture import BodySetup, Imu, estimate, gather

RATE_HZ = 60.0
CYCLE = 2000  # frames after which the movement repeats
FEET = ("RightFoot", "LeftFoot")
# Of the frames of a full export; the estimate needs those of SIGNALS.
SIGNALS = ("orientation", "sensorAcceleration")


def person() -> Body:
    return human_body(height_m=1.793, mass_kg=72.7)


def setup() -> BodySetup:
    """Sensors at the origins of their links, along the links' axes."""
    imus = [
        Imu(link, position_m=np.zeros(3), orientation=np.eye(3)) for link in human_names("suit")
    ]
    return BodySetup(person(), imus=imus)


def movement(body: Body) -> Motion:
    """Everything above the hips moves a little, at whole turns in a cycle; the pelvis stands."""
    rng = np.random.default_rng(1)
    stands = [
        any(word in joint for word in ("Hip", "Knee", "Ankle", "Ball")) for joint in body.joints
    ]
    size = np.where(stands, 0.0, rng.uniform(0.05, 0.3, len(body.joints)))
    omega = 2 * np.pi * RATE_HZ / CYCLE * rng.integers(2, 20, len(body.joints))
    phase = omega * np.arange(CYCLE)[:, None] / RATE_HZ + rng.uniform(0, 6, len(body.joints))
    return Motion(
        size * np.sin(phase), size * omega * np.cos(phase), -size * omega**2 * np.sin(phase)
    )


def shoes(body: Body, motion: Motion) -> np.ndarray:
    """Each foot bears half: wrenches about the feet, whose axes are the world's, (frames, 12)."""
    _, lack = body.inverse_dynamics(motion)
    half = 0.5 * lack
    poses = body.poses(motion)
    wrenches = []
    for foot in FEET:
        at = poses[:, body.links.index(foot), :3]
        wrenches += [half[:, :3], half[:, 3:] - np.cross(at, half[:, :3])]
    return np.hstack(wrenches)


@dataclass(frozen=True)
class Session:
    """One cycle of what the sensors say, noise included."""

    body: Body
    motion: Motion
    accelerations: np.ndarray  # (frames, 3 suit links)
    wrenches: np.ndarray  # (frames, 12)

    @classmethod
    def made_up(cls) -> Session:
        body = person()
        motion = movement(body)
        felt = [body.sensor(motion, link=link)[2] for link in human_names("suit")]
        rng = np.random.default_rng(2)
        accelerations = np.hstack(felt)
        wrenches = shoes(body, motion)
        return cls(
            body,
            motion,
            accelerations + 0.1 * rng.normal(size=accelerations.shape),
            wrenches + np.tile([2.0] * 3 + [0.5] * 3, 2) * rng.normal(size=wrenches.shape),
        )


def write_rows(path: Path, names: list[str], table: np.ndarray, frames: int) -> None:
    """A text table of repeated rows with a running time."""
    rows = [",".join(map("{:.6f}".format, row)) for row in table]
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(["time_s", *names]) + "\n")
        file.writelines(f"{k / RATE_HZ:.9g},{rows[k % CYCLE]}\n" for k in range(frames))


def write_shoes(session: Session, path: Path, frames: int) -> None:
    names = [f"{foot}_{word}_{axis}" for foot in FEET for word in "FM" for axis in "xyz"]
    write_rows(path, names, session.wrenches, frames)


def write_csv(session: Session, path: Path, frames: int) -> None:
    names = [f"{joint} [rad]" for joint in session.body.joints]
    names += [
        f"{link}_sensor_acceleration_{axis} [m/s^2]"
        for link in human_names("suit")
        for axis in "xyz"
    ]
    write_rows(
        path, names, np.hstack([np.asarray(session.motion.angle), session.accelerations]), frames
    )


def frame_elements(session: Session) -> Iterator[tuple[str, np.ndarray]]:
    """All that a full export holds a frame; what the estimate does not use is noise of its size."""
    body = session.body
    poses = session.body.poses(session.motion)
    segments = [body.links.index(name) for name in segment_names(body)]
    rng = np.random.default_rng(3)
    yield "orientation", poses[:, segments, 3:].reshape(CYCLE, -1)
    yield "position", poses[:, segments, :3].reshape(CYCLE, -1)
    for name in ("velocity", "acceleration", "angularVelocity", "angularAcceleration"):
        yield name, rng.normal(size=(CYCLE, 3 * len(segments)))
    yield "sensorAcceleration", session.accelerations
    yield "sensorMagneticField", rng.normal(size=(CYCLE, 51))
    yield "sensorOrientation", rng.normal(size=(CYCLE, 68))
    for name in ("jointAngle", "jointAngleXZY"):
        yield name, 40 * rng.normal(size=(CYCLE, 66))
    yield "centerOfMass", rng.normal(size=(CYCLE, 9))


def segment_names(body: Body) -> list[str]:
    """Links that are no half-way stations of a joint with several hinges."""
    return [link for link in body.links if not link[:-1].endswith("_f")]


def write_mvnx(session: Session, path: Path, frames: int) -> None:
    body = session.body
    texts = [""] * CYCLE
    for name, table in frame_elements(session):
        for k, row in enumerate(table):
            texts[k] += f"<{name}>{' '.join(map('{:.6f}'.format, row))}</{name}>\n"
    links = {link.name: link for link in body.describe()}
    joints = {}
    for name in segment_names(body)[1:]:
        parent, joint = links[name].parent, str(links[name].joint).rpartition("_rot")[0]
        while parent not in segment_names(body):
            parent = links[str(parent)].parent
        joints[joint] = (f"{parent}/{joint}", f"{name}/{joint}")
    head = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<mvnx>",
        f'<subject frameRate="{RATE_HZ:g}">',
    ]
    head += [
        "<segments>",
        *(f'<segment label="{name}"/>' for name in segment_names(body)),
        "</segments>",
    ]
    head += [
        "<sensors>",
        *(f'<sensor label="{name}"/>' for name in human_names("suit")),
        "</sensors>",
    ]
    head += ["<joints>"]
    head += [
        f'<joint label="{joint}"><connector1>{first}</connector1><connector2>{second}</connector2></joint>'
        for joint, (first, second) in joints.items()
    ]
    with path.open("w", encoding="utf-8") as file:
        file.write("\n".join([*head, "</joints>", "<frames>\n"]))
        for k in range(frames):
            stamp = round(1000 * k / RATE_HZ)
            file.write(
                f'<frame time="{stamp}" index="{k}" type="normal">\n{texts[k % CYCLE]}</frame>\n'
            )
        file.write("</frames></subject></mvnx>\n")


@dataclass(frozen=True)
class Times:
    """Seconds of one core, and what came out."""

    frames: int
    read: float
    gather: float
    estimate: float
    memory_mb: float
    deviation_nm: float


def work(motion_file: Path, shoe_file: Path) -> Times:
    """One recording from its files to torques."""
    clock = [time.process_time()]
    signals = SIGNALS if motion_file.suffix == ".mvnx" else None
    records = [ulna.read(motion_file, signals=signals), ulna.read(shoe_file)]
    clock.append(time.process_time())
    frames = gather(records, setup(), clocks="shared")
    clock.append(time.process_time())
    found = estimate(frames, variances="given", checks=False, threads=1)
    clock.append(time.process_time())
    steps = np.diff(clock)
    deviation = float(np.nanmedian(found.torques.torque_deviation))
    return Times(len(frames), *map(float, steps), memory_mb=memory_mb(), deviation_nm=deviation)


def memory_mb() -> float:
    """Largest of this process so far; NaN where the system does not tell."""
    try:
        import resource
    except ImportError:
        return float("nan")
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (2**20 if sys.platform == "darwin" else 2**10)


def measure(kind: str, folder: Path, frames: int, recordings: int, processes: int) -> None:
    session = Session.made_up()
    motion_file, shoe_file = folder / f"motion.{kind}", folder / "shoes.csv"
    {"csv": write_csv, "mvnx": write_mvnx}[kind](session, motion_file, frames)
    write_shoes(session, shoe_file, frames)
    size = (motion_file.stat().st_size + shoe_file.stat().st_size) / 1e6
    begin = time.perf_counter()
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(work, motion_file, shoe_file) for _ in range(recordings)]
        all_times = [job.result() for job in jobs]
    wall = time.perf_counter() - begin
    motion_file.unlink()
    count = sum(times.frames for times in all_times)
    split = {
        name: 1e6 * sum(getattr(times, name) for times in all_times) / count
        for name in ("read", "gather", "estimate")
    }
    print(f"{kind}: {recordings} recordings of {frames} frames, {size:.0f} MB each")
    print("  us of one core a frame: " + ", ".join(f"{name} {t:.1f}" for name, t in split.items()))
    print(
        f"  {count} frames with standard deviations in {wall:.1f} s on {processes} processes, ",
        end="",
    )
    print(
        f"{1e6 * wall / count:.0f} us a frame; cores busy {sum(split.values()) * count / 1e6:.1f} s"
    )
    print(f"  memory of a process at most {max(times.memory_mb for times in all_times):.0f} MB")
    print(f"  median standard deviation of a torque {all_times[0].deviation_nm:.2f} N m")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--format", choices=("csv", "mvnx"), nargs="+", default=["csv", "mvnx"])
    parser.add_argument("--frames", type=int, default=43_200, help="of a recording")
    parser.add_argument("--recordings", type=int, default=24)
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args()
    if hasattr(os, "getloadavg"):
        print(
            f"load of the machine before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
        )
    for kind in chosen.format:
        with tempfile.TemporaryDirectory() as folder:
            measure(kind, Path(folder), chosen.frames, chosen.recordings, chosen.processes)


if __name__ == "__main__":
    main()
