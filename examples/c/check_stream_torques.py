"""Runs the C example that streams joint torques and reads what it prints.

check_stream_torques.py <program>
"""

from __future__ import annotations

import re
import subprocess
import sys

NUMBER = r"(-?[0-9.]+)"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False)


def without_times(text: str) -> str:
    return re.sub(r"^time .*$", "", text, flags=re.M)


def main() -> None:
    program = sys.argv[1]
    done = run(program)
    assert done.returncode == 0, done
    rows = re.findall(rf"jRightShoulder_rotx +{NUMBER} \+- {NUMBER} N m", done.stdout)
    assert len(rows) >= 10, done.stdout
    assert all(0 < float(deviation) for _, deviation in rows), done.stdout
    frames = re.search(
        r"^frames +(\d+), (\d+) lost: (\d+) bridged, (\d+) in a gap", done.stdout, re.M
    )
    assert frames, done.stdout
    total, lost, bridged, long = map(int, frames.groups())
    # One in twenty, give or take four standard deviations, and 30 in a row: the first 12 are bridged.
    assert total == 6000 and abs(lost - 328) < 68, done.stdout
    assert lost == bridged + long and 15 <= long <= 18 + 3, done.stdout
    wider = re.search(rf"grows up to {NUMBER}-fold", done.stdout)
    assert wider and float(wider[1]) > 2, done.stdout
    inside = re.search(rf"deviations in {NUMBER} %, of bridged frames {NUMBER} %", done.stdout)
    # Nothing of a bridged frame is Gaussian, but its deviations must not be too small.
    assert inside and 94 < float(inside[1]) < 96.5 and float(inside[2]) > 93, done.stdout
    time = re.search(
        rf"^time +{NUMBER} us a frame, 99.9 % of frames below {NUMBER} us",
        done.stdout,
        re.M,
    )
    assert time and 0 < float(time[1]) <= float(time[2]), done.stdout
    assert without_times(run(program).stdout) == without_times(done.stdout)  # the same bits again

    for words in (("tall",), ("nan",), ("9",), ("1.8", "heavy"), ("1.8", "-70")):
        wrong = run(program, *words)
        assert wrong.returncode == 2 and wrong.stdout == "", wrong
        assert wrong.stderr.startswith("stream_torques: ") and wrong.stderr.count("\n") == 1, wrong


if __name__ == "__main__":
    main()
