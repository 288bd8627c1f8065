"""Reading a text table, beside pandas: 60 s of one joint at 1 kHz."""

import numpy as np
import pytest
import ulna


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    rng = np.random.default_rng(0)
    name = tmp_path_factory.mktemp("bench") / "log.csv"
    with name.open("w") as file:
        file.write("time_s,position_rad,torque_Nm\n")
        values = rng.standard_normal((60000, 2))
        file.writelines(f"{i / 1000:.3f},{a:.7f},{b:.6f}\n" for i, (a, b) in enumerate(values))
    return name


@pytest.mark.benchmark(group="read a text table")
def test_ulna(benchmark, path):
    log = benchmark(ulna.read, path)
    benchmark.extra_info["MB"] = path.stat().st_size / 1e6
    assert len(log) == 60000


@pytest.mark.benchmark(group="read a text table")
def test_pandas(benchmark, path):
    pandas = pytest.importorskip("pandas")
    frame = benchmark(pandas.read_csv, path)
    assert len(frame) == 60000
