"""Runs the C example and compares what it prints with the truth of the bundled recording.

    check_assess.py <program> <folder of the recording>
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

NUMBER = r"([-+0-9.e]+) \+- ([-+0-9.e]+)"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False)


def main() -> None:
    program, data = sys.argv[1], Path(sys.argv[2])
    done = run(program, str(data / "relaxed-arm.csv"))
    assert done.returncode == 0, done
    truth = json.loads((data / "relaxed-arm-truth.json").read_text(encoding="utf-8"))
    wanted = [v for key in "MBK" for row in truth[key] for v in row] + truth["x0"]
    printed = [(float(v), float(e)) for v, e in re.findall(NUMBER, done.stdout)]
    assert len(printed) == len(wanted), done.stdout
    for (value, error), true in zip(printed, wanted, strict=True):
        # Four standard errors: 14 values of one recording, all inside with a chance of 99.9 %.
        assert error > 0 and abs(value - true) < 4 * error, (value, error, true)
    assert re.search(r"^estimator +instrumental variables$", done.stdout, re.M), done.stdout
    vaf = re.search(r"^VAF % +(\S+) +(\S+)$", done.stdout, re.M)
    assert vaf and all(50 < float(v) <= 100 for v in vaf.groups()), done.stdout
    assert re.search(r"^outcome +\S", done.stdout, re.M), done.stdout
    for name in "MBK":
        assert re.search(rf"^ellipse {name} +area \S+, shape \S+, angle", done.stdout, re.M), name
    passivity = re.search(r"^passivity +(.*), probability (\S+), excess", done.stdout, re.M)
    assert passivity and passivity[1] == "passive" and float(passivity[2]) >= 0.95, done.stdout

    missing = run(program, str(data / "there-is-no-such-file.csv"))
    assert missing.returncode == 2 and missing.stdout == "", missing
    assert missing.stderr.startswith("assess: ") and missing.stderr.count("\n") == 1, missing

    with tempfile.TemporaryDirectory() as folder:
        # One sinusoid without a reference does not tell inertia from stiffness.
        from math import cos, sin

        path = Path(folder) / "sine.csv"
        rows = [f"{k / 100},{0.01 * sin(7 * k / 100)!r},{cos(7 * k / 100)!r}" for k in range(3000)]
        path.write_text("time_s,x_m,F_x_N\n" + "\n".join(rows) + "\n", encoding="utf-8")
        undetermined = run(program, str(path))
        assert undetermined.returncode == 3, undetermined


if __name__ == "__main__":
    main()
