"""Bodies with their sensors from files: TOML, URDF, MJCF and JSON."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._call import ArgumentError, Error, FileError, FormatError
from .body import Body, human_body, human_names, read_body
from .io import read_suit
from .record import refuse
from .torques import roll_pitch_yaw

Array = NDArray[np.float64]

if TYPE_CHECKING:
    from .assist import PassiveDevice
    from .capture import BodySetup

# Table -> keys that it may have.
_KEYS: Mapping[str, set[str]] = {
    "": {"body", "attach", "contact", "imu", "touch", "device", "deviations"},
    "body": {
        "height_m", "mass_kg", "lengths_m", "suit", "spherical", "published_masses", "file",
    },
    "attach": {"name", "link", "mass_kg", "centre_m", "inertia_kg_m2"},
    "contact": {
        "name", "link", "channels", "position_m", "rpy_rad", "frame", "sign", "force_n", "moment_nm",
    },
    "imu": {"name", "link", "channels", "position_m", "rpy_rad"},
    "touch": {"link", "position_m", "force_only"},
    "device": {"table", "subject", "scale", "mass_kg", "attachment"},
    "deviations": {
        "imu_m_s2", "joint_rad_s2", "base_m_s2", "base_rad_s2", "force_n", "moment_nm", "device_n",
        "device_nm",
    },
}  # fmt: skip


def setup_of(body: Any) -> BodySetup:
    """The setup that a setup, a body or a file stands for."""
    from .capture import BodySetup

    if isinstance(body, BodySetup):
        return body
    if isinstance(body, Body):
        return BodySetup(body)
    if not isinstance(body, str | os.PathLike):
        raise refuse(
            f"body is a {type(body).__name__}: give a BodySetup, a Body or the path of a file",
            "body",
        )
    path = Path(body)
    ending = path.suffix.lower()
    if ending == ".toml":
        return _from_toml(path)
    if ending == ".json":
        return _from_json(path)
    return BodySetup(read_body(path), source=path.name)


def _from_json(path: Path) -> BodySetup:
    """Links, and the sensors that stand beside them."""
    from .capture import BodySetup, Contact, Imu

    body = read_body(path)
    content = json.loads(path.read_text(encoding="utf-8"))
    contacts, imus = [], []
    try:
        if "plate" in content:
            contacts.append(Contact("plate", content["plate"]["link"]))
        if "imu" in content:
            imu = content["imu"]
            imus.append(
                Imu(imu["link"], "imu", np.asarray(imu["position"], dtype=float),
                    roll_pitch_yaw(*map(float, imu["rpy_rad"])))
            )  # fmt: skip
    except (KeyError, TypeError, ValueError) as failure:
        raise FormatError(
            f"imu or plate of {path.name} cannot be read: {type(failure).__name__} {failure}",
            status="ULNA_ERROR_FORMAT",
            argument="body",
        ) from failure
    return BodySetup(body, contacts or None, imus or None, source=path.name)


def _from_toml(path: Path) -> BodySetup:
    from .capture import BodySetup, Contact, Deviations, Imu, Touch

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as failure:
        raise FileError(
            f"{str(path)!r} cannot be read: {failure.strerror}", status="ULNA_ERROR_FILE"
        ) from failure
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as failure:
        raise FormatError(
            f"{path.name} is no TOML: {failure}", status="ULNA_ERROR_FORMAT"
        ) from failure
    _check_keys(content, path.name)
    try:
        body = _body(content.get("body", {}), path)
        for tool in content.get("attach", []):
            body = body.attach(tool["name"], link=tool["link"], mass_kg=tool["mass_kg"],
                               centre_m=tool["centre_m"], inertia_kg_m2=tool.get("inertia_kg_m2"))  # fmt: skip
        contacts = [
            Contact(
                entry["name"], entry["link"], entry.get("position_m", (0.0, 0.0, 0.0)),
                roll_pitch_yaw(*entry.get("rpy_rad", (0.0, 0.0, 0.0))), entry.get("frame", "link"),
                entry.get("channels"), entry.get("sign", 1), entry.get("force_n"),
                entry.get("moment_nm"),
            )
            for entry in content.get("contact", [])
        ]  # fmt: skip
        imus = [
            Imu(
                entry["link"], entry.get("name", ""), entry.get("position_m"),
                roll_pitch_yaw(*entry["rpy_rad"]) if "rpy_rad" in entry else None,
                entry.get("channels"),
            )
            for entry in content.get("imu", [])
        ]  # fmt: skip
        return BodySetup(
            body, contacts or None, imus or None, _device(content.get("device"), path),
            Deviations(**content.get("deviations", {})), path.name,
            [Touch(**entry) for entry in content.get("touch", [])],
        )  # fmt: skip
    except (FileError, FormatError):
        raise
    except KeyError as failure:
        raise FormatError(
            f"an entry of {path.name} has no {failure.args[0]}", status="ULNA_ERROR_FORMAT"
        ) from failure
    except Error as failure:
        raise FormatError(f"{path.name}: {failure}", status="ULNA_ERROR_FORMAT") from failure
    except (TypeError, ValueError) as failure:
        raise FormatError(
            f"{path.name} holds a value of the wrong kind: {failure}", status="ULNA_ERROR_FORMAT"
        ) from failure


def _check_keys(content: Mapping[str, Any], name: str) -> None:
    def check(table: Any, kind: str) -> None:
        if not isinstance(table, dict):
            raise FormatError(
                f"{kind or 'the file'} of {name} must be a table", status="ULNA_ERROR_FORMAT"
            )
        for key in table:
            if key not in _KEYS[kind]:
                where = f"[{kind}] of {name}" if kind else name
                raise FormatError(
                    f"{where} has the unknown key {key!r}; it may have {', '.join(sorted(_KEYS[kind]))}",
                    status="ULNA_ERROR_FORMAT",
                    detail=key,
                )

    check(content, "")
    for kind, tables in content.items():
        several = kind in ("attach", "contact", "imu", "touch")
        if several and not isinstance(tables, list):
            raise FormatError(
                f"{kind} of {name} must be a list of tables, [[{kind}]]", status="ULNA_ERROR_FORMAT"
            )
        for table in tables if several else [tables]:
            check(table, kind)


def _body(table: Mapping[str, Any], path: Path) -> Body:
    if "file" in table:
        if len(table) > 1:
            raise ArgumentError(
                "[body] has a file and measures: give one of them", status="ULNA_ERROR_ARGUMENT"
            )
        return read_body(path.parent / table["file"])
    return human_body(
        height_m=table["height_m"], mass_kg=table["mass_kg"], lengths_m=table.get("lengths_m"),
        points_m=suit_points(path.parent / table["suit"]) if "suit" in table else None,
        spherical=table.get("spherical", False),
        published_masses=table.get("published_masses", False),
    )  # fmt: skip


# Ends of segments in the human model -> points of a suit.
_ENDS = {
    "HeadTop": "Head/pTopOfHead",
    "RightHandTip": "RightHand/pRightTopOfHand",
    "LeftHandTip": "LeftHand/pLeftTopOfHand",
    "RightHeel": "RightFoot/pRightHeelFoot",
    "LeftHeel": "LeftFoot/pLeftHeelFoot",
    "RightToeTip": "RightToe/pRightToe",
    "LeftToeTip": "LeftToe/pLeftToe",
}


def suit_points(path: Path) -> dict[str, Array]:
    """Joint centres and ends of a person in the neutral pose, by the points of an MVNX file.

    In that pose all segments have the axes of the world, so that points of neighbours add up.
    """
    suit = read_suit(path)
    known = set(human_names("points"))
    origins: dict[str, Array] = {suit.segments[0]: np.zeros(3)}
    centres: dict[str, Array] = {}
    for joint, (parent, child) in suit.connections.items():
        carrier, carried = parent.partition("/")[0], child.partition("/")[0]
        if carrier not in origins or parent not in suit.points_m or child not in suit.points_m:
            raise FormatError(
                f"{path.name} does not say where the joint {joint} lies", status="ULNA_ERROR_FORMAT"
            )
        centre = origins[carrier] + suit.points_m[parent]
        origins[carried] = centre - suit.points_m[child]
        if joint in known:
            centres[joint] = centre
    for end, point in _ENDS.items():
        if point in suit.points_m and point.partition("/")[0] in origins:
            centres[end] = origins[point.partition("/")[0]] + suit.points_m[point]
    return centres


def _device(table: Mapping[str, Any] | None, path: Path) -> PassiveDevice | None:
    if table is None:
        return None
    from .assist import ATTACHMENT, PassiveDevice, read_force_table

    curves = read_force_table(path.parent / table["table"])
    curve = curves.of(table["subject"]) if "subject" in table else curves.mean
    return PassiveDevice(
        curve.scaled(float(table.get("scale", 1.0))),
        attachment=float(table.get("attachment", ATTACHMENT)),
        mass_kg=float(table.get("mass_kg", 1.8)),
    )
