"""A simulated person on two feet with a suit and two shoes, for tests of captures: the truth is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import ulna
from ulna.body import Body, Motion, human_body
from ulna.motion import rotation_matrices
from ulna.torques import roll_pitch_yaw

FEET = ("RightFoot", "LeftFoot")
IMUS = ("Pelvis", "T8", "Head", "RightForeArm", "RightHand", "LeftHand")
WRENCH = tuple(f"{kind}_{axis}" for kind in "FM" for axis in "xyz")
HEIGHT_OF_PELVIS = 0.95


@dataclass(frozen=True)
class Capture:
    """Records of the suit and of the shoes, the torques that are true at the suit's times, and mounts."""

    body: Body
    suit: ulna.Record
    shoes: ulna.Record
    time_s: np.ndarray
    torque: np.ndarray
    mounts: dict


def person() -> Body:
    return human_body(height_m=1.793, mass_kg=72.7)


def simulated_capture(
    *, seconds=15.0, rate_hz=60.0, shoe_rate_hz=240.0, seed=0, equal=False, toe_out=0.15,
    offset_s=0.0, drift=0.0, angles=True, medial_n=15.0,
):  # fmt: skip
    """The person sways from foot to foot and moves arms and trunk; `equal`: both feet carry the same.

    Sensors have white noise. `angles`: hinge angles, else orientations of all segments, as a suit.
    """
    body = person()
    rng = np.random.default_rng(seed)
    joints = body.joints
    turn = 2 * np.pi * rng.uniform(0.2, 0.9, len(joints))
    phase = rng.uniform(0, 2 * np.pi, len(joints))
    size = 0.12 * rng.uniform(size=len(joints))
    stiff = ("Hip", "Knee", "Ankle", "Ball")
    size[[k for k, j in enumerate(joints) if any(word in j for word in stiff)]] = 0.0
    stance = np.zeros(len(joints))
    stance[joints.index("jRightHip_rotz")], stance[joints.index("jLeftHip_rotz")] = -toe_out, toe_out
    # Side to side: two sines that never repeat within a recording.
    sway = 0.0 if equal else 0.04
    slow = 2 * np.pi * np.array([0.13, 0.37])

    def motion(t):
        t = t[:, None]
        y = sway * np.sin(slow * t).sum(axis=1)
        v = sway * (slow * np.cos(slow * t)).sum(axis=1)
        a = -sway * (slow**2 * np.sin(slow * t)).sum(axis=1)
        zero = np.zeros(len(t))
        still = np.zeros((len(t), 3))
        return Motion(
            stance + size * np.sin(turn * t + phase),
            size * turn * np.cos(turn * t + phase),
            -size * turn**2 * np.sin(turn * t + phase),
            position_m=np.stack([zero, y, zero + HEIGHT_OF_PELVIS], axis=1),
            velocity_m_s=np.stack([zero, v, zero], axis=1),
            orientation=np.tile([1.0, 0, 0, 0], (len(t), 1)),
            base_acceleration=np.hstack([np.stack([zero, a, zero + 9.81], axis=1), still]),
        )

    def noisy(values, deviation):
        return values + deviation * rng.normal(size=np.shape(values))

    time = np.arange(0, seconds, 1 / rate_hz)
    truth = motion(time)
    poses = body.poses(truth)
    channels, units = {}, {}
    if angles:
        for k, joint in enumerate(joints):
            channels[joint] = noisy(truth.angle[:, k], 0.001)
            units[joint] = "rad"
    segments = ["Pelvis"] if angles else [n for n in body.links if "_f" not in n]
    for name in segments:
        q = noisy(poses[:, body.links.index(name), 3:], 0.0003)
        q = q / np.linalg.norm(q, axis=1, keepdims=True)
        channels |= {f"{name}_q{part}": q[:, k] for k, part in enumerate("wxyz")}
    for k, axis in enumerate("xyz"):
        channels[f"Pelvis_position_{axis}"] = noisy(poses[:, 0, k], 0.0003)
    centres = {link.name: link.centre_m for link in body.describe()}
    mounts = {}
    worn = np.random.default_rng(1000 + seed)  # the same mounts however long the capture is
    for name in IMUS:
        axes = roll_pitch_yaw(*worn.uniform(-0.6, 0.6, 3))
        place = centres[name] + worn.uniform(-0.04, 0.04, 3)
        mounts[name] = (place, axes)
        _, rate, proper, _ = body.sensor(truth, link=name, point_m=place)
        for k, axis in enumerate("xyz"):
            channels[f"{name}_sensor_acceleration_{axis}"] = noisy(proper @ axes[:, k], 0.05)
            channels[f"{name}_sensor_angular_velocity_{axis}"] = noisy(rate @ axes[:, k], 0.01)
    suit = ulna.Record.from_arrays(time, channels, units=units)

    stamps = np.arange(0, seconds, 1 / shoe_rate_hz)
    wrenches = shared_load(body, motion(stamps), equal, medial_n)
    shoes = ulna.Record.from_arrays(
        (stamps - offset_s) / (1 + drift),
        {
            f"{foot}_{word}": noisy(wrenches[foot][:, k], 2.0 if k < 3 else 0.3)
            for foot in FEET
            for k, word in enumerate(WRENCH)
        },
    )
    external = np.zeros((len(time), len(body.links), 6))
    for foot, wrench in shared_load(body, truth, equal, medial_n).items():
        external[:, body.links.index(foot)] = wrench
    torque, lacking = body.inverse_dynamics(truth, external)
    assert np.abs(lacking).max() < 1e-6
    return Capture(body, suit, shoes, time, torque, mounts)


def shared_load(body, motion, equal, medial_n):
    """Wrenches on both feet, link axes, that hold the body: by the lever to the centre of mass.

    Legs that carry a weight are pushed towards each other.
    """
    _, missing = body.inverse_dynamics(motion)
    poses = body.poses(motion)
    centre = body.centroid(motion).position_m[:, 1]
    right, left = (poses[:, body.links.index(foot)] for foot in FEET)
    share = (left[:, 1] - centre) / (left[:, 1] - right[:, 1])
    share = np.full(len(poses), 0.5) if equal else np.clip(share, 0.05, 0.95)
    rest = missing[:, 3:].copy()
    forces = []
    for pose, own, inward in ((right, share, 1.0), (left, 1 - share, -1.0)):
        force = own[:, None] * missing[:, :3] + inward * np.array([0.0, medial_n, 0.0])
        rest -= np.cross(pose[:, :3] - poses[:, 0, :3], force)
        forces.append(force)
    out = {}
    for foot, pose, force in zip(FEET, (right, left), forces, strict=True):
        turn = rotation_matrices(pose[:, 3:])
        own = [np.einsum("nji,nj->ni", turn, v) for v in (force, 0.5 * rest)]
        out[foot] = np.hstack(own)
    return out


def changed(record, change):
    """The record with other values: `change` gets the channels by name and the time, and may return a
    choice of rows."""
    channels = {c.name: np.array(record[c.name]) for c in record.channels}
    time = np.array(record.time)
    rows = change(channels, time)
    rows = slice(None) if rows is None else rows
    return ulna.Record.from_arrays(
        time[rows],
        {name: values[rows] for name, values in channels.items()},
        units={c.name: c.unit for c in record.channels if c.unit},
    )
