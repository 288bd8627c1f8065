"""The program that reads and estimates a study's worth of recordings, on a small one."""

import re
import subprocess
import sys
from pathlib import Path

PROGRAM = Path(__file__).parents[2] / "examples" / "python" / "million_frames.py"


def test_the_program_runs_from_both_kinds_of_files():
    words = ["--frames", "400", "--recordings", "2", "--processes", "1"]
    done = subprocess.run(
        [sys.executable, str(PROGRAM), *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    kinds = re.findall(r"^(csv|mvnx): 2 recordings of 400 frames", done.stdout, re.M)
    assert kinds == ["csv", "mvnx"]
    # Frames of half a filter's window at either end are left out.
    counts = [
        int(n) for n in re.findall(r"^ +(\d+) frames with standard deviations", done.stdout, re.M)
    ]
    assert len(counts) == 2 and all(760 <= n <= 800 for n in counts)
    deviations = [float(v) for v in re.findall(r"deviation of a torque ([0-9.]+) N m", done.stdout)]
    assert len(deviations) == 2 and all(0.1 < v < 1.0 for v in deviations)
