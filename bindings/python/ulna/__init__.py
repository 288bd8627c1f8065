"""Measure, simulate and control the human arm in contact with a robot.

Names are loaded when they are first used, so that ``import ulna`` is quick:

>>> import ulna
>>> ulna.__version__ == ulna.build_information()["release"]
True
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ._call import (
    AnalysisError,
    ArgumentError,
    Cancelled,
    DataError,
    Error,
    FileError,
    FormatError,
    InternalError,
    OutOfMemory,
    UnsupportedError,
)
from ._release import RELEASE as __version__

if TYPE_CHECKING:
    from . import joint, passivity
    from .impedance import (
        ImpedanceEstimate,
        UncertainResult,
        ellipse,
        identify_impedance,
        preprocess,
    )
    from .io import inspect, read
    from .models import identify_transfer_function
    from .record import Record
    from .reflex import (
        ReflexEstimate,
        compare_windows,
        identify_delayed_feedback,
        identify_reflex,
    )
    from .report import report
    from .study import (
        Discrete,
        LogUniform,
        Normal,
        Study,
        StudyDesign,
        Triangular,
        TruncatedNormal,
        Uniform,
    )
    from .systems import StateSpace, TransferFunction

# Public name -> module that holds it.
_HOMES = {
    "Discrete": "study",
    "LogUniform": "study",
    "Normal": "study",
    "Study": "study",
    "StudyDesign": "study",
    "Triangular": "study",
    "TruncatedNormal": "study",
    "Uniform": "study",
    "StateSpace": "systems",
    "TransferFunction": "systems",
    "read": "io",
    "inspect": "io",
    "identify_transfer_function": "models",
    "Record": "record",
    "preprocess": "impedance",
    "identify_impedance": "impedance",
    "ImpedanceEstimate": "impedance",
    "UncertainResult": "impedance",
    "ellipse": "impedance",
    "report": "report",
    "identify_reflex": "reflex",
    "identify_delayed_feedback": "reflex",
    "compare_windows": "reflex",
    "ReflexEstimate": "reflex",
}
_MODULES = (
    "body",
    "capture",
    "torques",
    "assist",
    "clocks",
    "design",
    "effort",
    "exo",
    "joint",
    "models",
    "motion",
    "overhead",
    "posture",
    "reflex",
    "signal",
    "stats",
    "study",
    "systems",
    "teleoperation",
    "record",
    "io",
    "impedance",
    "passivity",
    "plant",
    "rig",
    "sim",
    "virtual_sensor",
    "plot",
    "report",
    "validate",
    "cli",
)

__all__ = [
    "AnalysisError",
    "ArgumentError",
    "Cancelled",
    "DataError",
    "Discrete",
    "Error",
    "FileError",
    "FormatError",
    "ImpedanceEstimate",
    "InternalError",
    "LogUniform",
    "Normal",
    "OutOfMemory",
    "Record",
    "ReflexEstimate",
    "StateSpace",
    "Study",
    "StudyDesign",
    "TransferFunction",
    "Triangular",
    "TruncatedNormal",
    "UncertainResult",
    "Uniform",
    "UnsupportedError",
    "__version__",
    "build_information",
    "compare_windows",
    "ellipse",
    "identify_delayed_feedback",
    "identify_impedance",
    "identify_reflex",
    "identify_transfer_function",
    "inspect",
    "joint",
    "passivity",
    "preprocess",
    "read",
    "report",
]


def build_information() -> dict[str, str]:
    """Release, interface number and compiler of the library that is loaded, for error reports.

    Examples
    --------
    >>> sorted(build_information())
    ['build', 'interface', 'release']
    """
    from ._call import decode, lib

    return {
        "release": decode(lib.ulna_release()),
        "interface": str(lib.ulna_interface_number()),
        "build": decode(lib.ulna_build()),
    }


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    if name in _MODULES:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)


class _Package(ModuleType):
    # `report` is a function and the module that holds it. Importing the module would put it over the
    # function, whoever imports it first.
    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, ModuleType) and _HOMES.get(name) == name:
            value = getattr(value, name)
        super().__setattr__(name, value)

    def __reduce__(self) -> Any:
        # A script's function that names the package travels to other processes by its code.
        return import_module, (self.__name__,)


sys.modules[__name__].__class__ = _Package
