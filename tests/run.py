"""Runs the tests of the C++ core, of the C interface and of the Python package.

The last line is the total over all of them; the exit status is 0 only when nothing failed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path


def totals(report: Path, status: int) -> dict[str, int]:
    """Counts of a JUnit report; a tool that wrote none, or found no test, counts as one failure."""
    count = {"passed": 0, "failed": 0, "skipped": 0}
    if report.exists():
        for case in ElementTree.parse(report).iter("testcase"):
            kinds = {child.tag for child in case}
            # ctest writes `fail` as a status, pytest as an element.
            if kinds & {"failure", "error"} or case.get("status") == "fail":
                count["failed"] += 1
            elif "skipped" in kinds or case.get("status") in ("notrun", "disabled"):
                count["skipped"] += 1
            else:
                count["passed"] += 1
    if count["failed"] == 0 and (status != 0 or count["passed"] == 0):
        count["failed"] = 1
    return count


def main() -> int:
    build = Path(sys.argv[1]).resolve()
    reports = build / "reports"
    reports.mkdir(parents=True, exist_ok=True)
    jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", "2")
    runs = {
        "ctest.xml": ["ctest", "--test-dir", str(build), "--output-on-failure", "--progress",
                      "--no-tests=error", "-j", jobs, "--timeout", "600",
                      "--output-junit", str(reports / "ctest.xml")],
        "pytest.xml": [sys.executable, "-m", "pytest", "-q", "-n", jobs, "--dist", "loadfile",
                       "--junitxml", str(reports / "pytest.xml")],
    }  # fmt: skip
    sums = {"passed": 0, "failed": 0, "skipped": 0}
    for name, command in runs.items():
        report = reports / name
        report.unlink(missing_ok=True)
        status = subprocess.run(command, check=False, stdin=subprocess.DEVNULL).returncode
        for kind, count in totals(report, status).items():
            sums[kind] += count
    sys.stdout.flush()
    skipped = f", {sums['skipped']} skipped" if sums["skipped"] else ""
    print(f"{sums['passed']} passed, {sums['failed']} failed{skipped}", flush=True)
    return 1 if sums["failed"] else 0


if __name__ == "__main__":
    sys.exit(main())
