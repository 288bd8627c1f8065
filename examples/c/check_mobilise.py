"""Runs the C example of an assessment by an exoskeleton and reads what it prints.

    check_mobilise.py <program>
"""

from __future__ import annotations

import re
import subprocess
import sys

NUMBER = r"(-?[0-9.]+)"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False)


def main() -> None:
    program = sys.argv[1]
    done = run(program)
    assert done.returncode == 0, done
    for name in ("K", "D"):
        line = re.search(rf"^{name} +{NUMBER} .* {NUMBER} to {NUMBER}, true {NUMBER}$",
                         done.stdout, re.M)  # fmt: skip
        assert line, done.stdout
        value, low, high, _ = (float(v) for v in line.groups())
        assert low < value < high, done.stdout
    assert re.search(r"^joint +J4$", done.stdout, re.M), done.stdout
    slip = re.search(rf"slip at most {NUMBER} degrees", done.stdout)
    assert slip and 0 < float(slip[1]) < 20, done.stdout
    assert len(re.findall(r"strap \d+ N, largest pressure", done.stdout)) == 2, done.stdout
    assert run(program).stdout == done.stdout  # the same bits again

    for word in ("soft", "-1", "nan"):
        wrong = run(program, word)
        assert wrong.returncode == 2 and wrong.stdout == "", wrong
        assert wrong.stderr.startswith("mobilise: ") and wrong.stderr.count("\n") == 1, wrong


if __name__ == "__main__":
    main()
