"""Reads a C3D file in a process of its own, because ezc3d ends the process on some damaged files.

    python -P _c3d_child.py FILE.c3d OUT.npz BYTES

writes what the reader needs and nothing of Python's own kinds; BYTES limits the memory.
"""

from __future__ import annotations

import json
import sys

import numpy as np

_GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM")


def main(path: str, out: str, limit: int) -> int:
    """Exit code: 0, or 1 with the library's sentence on the error stream."""
    import ezc3d

    try:
        import resource

        # A damaged count would ask for all memory of the machine.
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (ImportError, ValueError, OSError):
        pass
    try:
        file = ezc3d.c3d(path)
    except Exception as failure:  # whatever the library makes of a damaged file
        print(failure, file=sys.stderr)
        return 1
    words: dict[str, dict[str, list[str]]] = {}
    arrays = {}
    for group in _GROUPS:
        for key, item in file["parameters"].get(group, {}).items():
            value = item.get("value") if isinstance(item, dict) else None
            if value is None:
                continue
            if np.asarray(value).dtype.kind in "fiub":
                arrays[f"{group}:{key}"] = np.asarray(value, dtype=float)
            else:
                words.setdefault(group, {})[key] = [str(text) for text in value]
    data = file["data"]
    residuals = data.get("meta_points", {}).get("residuals")
    if residuals is not None:
        arrays["residuals"] = residuals
    np.savez(
        out,
        points=data["points"],
        analogs=data["analogs"],
        words=np.frombuffer(json.dumps(words).encode(), dtype=np.uint8),
        **arrays,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
