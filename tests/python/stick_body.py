"""A body of boxes, cylinders and a ball from height alone, that works overhead: for tests of pictures."""

from __future__ import annotations

import numpy as np

from ulna._body_scene import BodyForce, BodyJoint, BodyLink, BodyScene


def _turn(axis, angle):
    """Quaternions (n, 4) about one axis."""
    out = np.zeros((len(angle), 4))
    out[:, 0] = np.cos(angle / 2)
    out[:, 1:] = np.sin(angle / 2)[:, None] * np.asarray(axis, dtype=float)
    return out


def _times(a, b):
    """Products of quaternions (n, 4)."""
    w = a[:, 0] * b[:, 0] - (a[:, 1:] * b[:, 1:]).sum(axis=1)
    v = a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])
    return np.column_stack([w, v])


def _apply(q, v):
    """Vectors (n, 3) turned by quaternions (n, 4)."""
    v = np.broadcast_to(np.asarray(v, dtype=float), (len(q), 3))
    t = 2 * np.cross(q[:, 1:], v)
    return v + q[:, :1] * t + np.cross(q[:, 1:], t)


def stick_body(
    *, height_m=1.79, seconds=4.0, rate_hz=30.0, relief=0.0, device=False, name="without"
):
    """A scene of 19 links that raises the right arm to drill overhead.

    `relief` is the share of the shoulder's effort that a device takes; a torque of each link is what
    is needed to hold the mass beyond its joint, so it follows from the pose and is not invented.
    """
    h = height_m
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    n = time.size
    rise = 0.5 - 0.5 * np.cos(2 * np.pi * np.clip(time / seconds, 0, 1))
    still = _turn([0, 1, 0], np.zeros(n))
    bend = _turn([0, 1, 0], 0.10 * rise)
    links, position, rotation = [], [], []

    def add(link, origin, turn):
        links.append(link)
        position.append(np.broadcast_to(origin, (n, 3)))
        rotation.append(turn)

    hip = np.array([0.0, 0.0, 0.530 * h])
    add(BodyLink("pelvis", "box", (0.10 * h, 0.160 * h, 0.085 * h), (0, 0, 0.02 * h)),
        hip + np.zeros((n, 3)), still)  # fmt: skip
    place = hip + np.array([0, 0, 0.062 * h]) + np.zeros((n, 3))
    for label, size, wide, deep in (
        ("L5/L3", 0.075, 0.150, 0.105), ("T12", 0.060, 0.165, 0.110), ("T8", 0.105, 0.190, 0.120),
    ):  # fmt: skip
        add(
            BodyLink(label, "box", (deep * h, wide * h, size * h), (0, 0, size * h / 2)),
            place,
            bend,
        )
        place = place + _apply(bend, [0, 0, size * h])
    neck = place
    add(BodyLink("neck", "cylinder", (0.030 * h, 0.052 * h), (0, 0, 0.026 * h)), neck, bend)
    add(BodyLink("head", "sphere", (0.062 * h,), (0.01 * h, 0, 0.062 * h)),
        neck + _apply(bend, [0, 0, 0.046 * h]), bend)  # fmt: skip

    quarter = np.sqrt(0.5)
    held = {}
    for side, sign in (("right", -1), ("left", 1)):
        shoulder = neck + _apply(bend, [0, sign * 0.112 * h, -0.022 * h])
        add(BodyLink(f"{side} shoulder", "cylinder", (0.032 * h, 0.085 * h), (0, 0, 0),
                     (quarter, quarter, 0, 0)),
            neck + _apply(bend, [0, sign * 0.070 * h, -0.022 * h]), bend)  # fmt: skip
        # The shape of a limb hangs down from its origin.
        up = np.radians(15 + 80 * rise) if side == "right" else np.radians(10 + 8 * rise)
        arm = _times(_turn([0, 1, 0], -up), _turn([1, 0, 0], np.full(n, sign * 0.14)))
        fold = np.radians(25 + 65 * rise) if side == "right" else np.radians(20 + 5 * rise)
        forearm = _times(arm, _turn([0, 1, 0], -fold))
        elbow = shoulder + _apply(arm, [0, 0, -0.186 * h])
        wrist = elbow + _apply(forearm, [0, 0, -0.146 * h])
        add(BodyLink(f"{side} upper arm", "cylinder", (0.027 * h, 0.186 * h), (0, 0, -0.093 * h)),
            shoulder, arm)  # fmt: skip
        add(BodyLink(f"{side} forearm", "cylinder", (0.022 * h, 0.146 * h), (0, 0, -0.073 * h)),
            elbow, forearm)  # fmt: skip
        add(BodyLink(f"{side} hand", "box", (0.024 * h, 0.045 * h, 0.100 * h), (0, 0, -0.045 * h)),
            wrist, forearm)  # fmt: skip
        held[side] = shoulder, arm, elbow, wrist, forearm
    for side, sign in (("right", -1), ("left", 1)):
        top = hip + np.array([0, sign * 0.050 * h, 0])
        leg = _turn([1, 0, 0], np.full(n, sign * 0.05))
        knee = top + _apply(leg, [0, 0, -0.245 * h])
        ankle = knee + _apply(leg, [0, 0, -0.246 * h])
        add(BodyLink(f"{side} thigh", "cylinder", (0.042 * h, 0.245 * h), (0, 0, -0.1225 * h)),
            top + np.zeros((n, 3)), leg)  # fmt: skip
        add(BodyLink(f"{side} shank", "cylinder", (0.031 * h, 0.246 * h), (0, 0, -0.123 * h)),
            knee, leg)  # fmt: skip
        add(BodyLink(f"{side} foot", "box", (0.152 * h, 0.055 * h, 0.036 * h), (0.04 * h, 0, -0.02 * h)),
            ankle, still)  # fmt: skip

    shoulder, arm, elbow, wrist, forearm = held["right"]
    add(BodyLink("drill", "box", (0.05, 0.05, 0.22), (0.05, 0, -0.10), role="tool"), wrist, forearm)
    if device:
        back = neck + _apply(bend, [-0.075 * h, -0.07 * h, -0.14 * h])
        add(BodyLink("frame", "capsule", (0.016, 0.30 * h), (0, 0, 0), role="device"), back, bend)
        bar = shoulder + _apply(arm, [-0.036 * h, -0.02 * h, -0.06 * h])
        add(BodyLink("arm bar", "capsule", (0.014, 0.17 * h), (0, 0, 0), role="device"), bar, arm)
        cuff = shoulder + _apply(arm, [0, 0, -0.128 * h])
        add(BodyLink("cuff", "cylinder", (0.033 * h, 0.045), (0, 0, 0), role="device"), cuff, arm)
        belt = hip + np.array([0, 0, 0.045 * h]) + np.zeros((n, 3))
        add(BodyLink("belt", "box", (0.115 * h, 0.175 * h, 0.035 * h), role="device"), belt, still)

    lever = {
        "shoulder": 9.81 * (2.0 * (0.5 * (shoulder + elbow) - shoulder)[:, 0]
                            + 2.2 * (0.5 * (elbow + wrist) - shoulder)[:, 0]
                            + 1.1 * (wrist - shoulder)[:, 0]),
        "elbow": 9.81 * (1.1 * (0.5 * (elbow + wrist) - elbow)[:, 0] + 1.1 * (wrist - elbow)[:, 0]),
    }  # fmt: skip
    moment = np.abs(lever["shoulder"])
    effort = np.full((n, len(links)), np.nan)
    index = {link.name: k for k, link in enumerate(links)}
    for part, value in {
        "right shoulder": 0.75 * moment * (1 - 0.7 * relief), "right upper arm": moment * (1 - relief),
        "right forearm": np.abs(lever["elbow"]), "right hand": 0.5 + 0.6 * rise,
        "left shoulder": 1.5 + 0 * rise, "left upper arm": 1.2 + 0.4 * rise,
        "left forearm": 0.8 + 0 * rise, "left hand": 0.3 + 0 * rise,
        "neck": 2.2 + 0.8 * rise, "head": 1.0 + 0.3 * rise,
        "T8": 4 + 5 * rise * (1 - 0.2 * relief), "T12": 5 + 6 * rise * (1 - 0.1 * relief),
        "L5/L3": 6 + 7 * rise, "pelvis": 5 + 5 * rise,
        "right thigh": 5.5 + 2 * rise, "left thigh": 4 + rise,
        "right shank": 6 + 2 * rise, "left shank": 5 + rise, "right foot": 2.5 + 0.5 * rise,
        "left foot": 2 + 0.5 * rise,
    }.items():  # fmt: skip
        effort[:, index[part]] = value
    weight = 9.81 * 74.0
    force = np.zeros((n, 2, 3))
    force[:, 0, 2] = weight * (0.5 + 0.06 * rise)
    force[:, 1, 2] = weight * (0.5 - 0.06 * rise)
    feet = [BodyForce(f"ground, {side}", f"{side} foot", (0.03 * h, 0, -0.038 * h))
            for side in ("right", "left")]  # fmt: skip
    return BodyScene(
        name, links, time, np.stack(position, axis=1), np.stack(rotation, axis=1), effort,
        effort_sd=0.08 * effort + 0.2, forces=feet, force_N=force, quantity="joint torque",
    )  # fmt: skip


def with_balls(scene):
    """The same body grey, with balls at the right shoulder and elbow that carry the effort."""
    index = {link.name: k for k, link in enumerate(scene.links)}
    parts = ("right upper arm", "right forearm", "left upper arm", "right thigh")
    joints = [BodyJoint(f"{part} joint", part, radius_m=0.07) for part in parts]
    return BodyScene(
        scene.name, scene.links, scene.time_s, scene.position_m, scene.rotation, joints=joints,
        joint_effort=scene.effort[:, [index[part] for part in parts]], quantity=scene.quantity,
    )  # fmt: skip
