"""Records in Python: views, parts, pickling, round trips."""

import gc
import pickle

import numpy as np
import pytest
import ulna
from ulna.record import join


def motion(rows=2000, **keywords):
    t = np.arange(rows) / 1000
    rng = np.random.default_rng(1)
    return ulna.Record.from_arrays(
        t,
        {
            "x": 0.01 * np.sin(9 * t) + 1e-5 * rng.standard_normal(rows),
            "F_x": np.cos(9 * t) + 0.01 * rng.standard_normal(rows),
            "note": rng.standard_normal(rows),
        },
        **keywords,
    )


def test_views_share_native_memory_and_outlive_the_record():
    log = motion()
    x = log["x"]
    assert x.base is not None and not x.flags.writeable and not log.time.flags.writeable
    assert np.shares_memory(x, log.values)
    before = x.copy()
    del log
    gc.collect()
    junk = [np.ones(2000) for _ in range(50)]
    assert np.array_equal(x, before) and len(junk) == 50
    with pytest.raises(ValueError):
        x[0] = 1


def test_unknown_channel_is_a_key_error_with_the_known_ones():
    with pytest.raises(KeyError, match="x, F_x, note"):
        motion()["Fx"]
    assert "x" in motion() and "Fx" not in motion()


def test_from_arrays_converts_units_and_signs():
    log = ulna.Record.from_arrays(
        [0, 0.001], {"a": [1, 2], "F": [3, 4]}, units={"a": "deg", "F": "kN"},
        roles={"a": "reference"}, signs={"F": -1}, frame="base",
    )
    assert np.allclose(log["a"], np.deg2rad([1, 2]), rtol=1e-15)
    assert log["F"].tolist() == [-3000, -4000]
    assert [c.role for c in log.channels] == ["reference", "force"]
    assert log.channels[1].sign == -1 and log.channels[1].frame == "base"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(time=None, channels={"x": [1, 2]}), "rate_hz"),
        (dict(time=[0, 1], channels={}), "no channels"),
        (dict(time=[0, 1], channels={"x": [1, 2, 3]}), "shape"),
        (dict(time=[0, 1], channels={"x": [1, 2]}, units={"y": "m"}), "units names the channel 'y'"),
        (dict(time=[0, 1], channels={"x": [1, 2]}, units={"x": "furlong"}), "furlong"),
        (dict(time=[0, 1], channels={"x": [1, 2]}, roles={"x": "leg"}), "leg"),
        (dict(time=[1, 0], channels={"x": [1, 2]}), "earlier"),
        (dict(time=[1, 1], channels={"x": [1, 2]}), "repeats"),
    ],
)
def test_from_arrays_refuses(arguments, message):
    time, channels = arguments.pop("time"), arguments.pop("channels")
    with pytest.raises((ulna.ArgumentError, ulna.DataError), match=message):
        ulna.Record.from_arrays(time, channels, **arguments)


def same(a, b):
    assert np.array_equal(a.time, b.time)
    assert np.array_equal(a.values, b.values, equal_nan=True)
    assert a.channels == b.channels and a.trials == b.trials and a.segments == b.segments
    assert a.rate_hz == b.rate_hz


def test_pickles_by_value():
    log = motion().select(onsets_s=[0.1, 0.5], after_s=0.2)
    back = pickle.loads(pickle.dumps(log))
    same(log, back)
    assert back.provenance == log.provenance


def test_csv_reads_back_to_the_same_bits(tmp_path):
    log = join([motion(), motion().select(rows=slice(0, 500))])
    log.to_csv(tmp_path / "log.csv")
    same(log, ulna.read(tmp_path / "log.csv"))


def test_csv_to_a_folder_that_is_absent(tmp_path):
    with pytest.raises(ulna.FileError, match="cannot be written"):
        motion().to_csv(tmp_path / "no" / "log.csv")


def test_split_select_and_segments():
    t = np.arange(1000) / 1000
    t[400:] += 1
    x = np.sin(t)
    x[700:710] = np.nan
    log = ulna.Record.from_arrays(t, {"x": x})
    assert {"gap", "nan"} <= {f.code for f in log.findings}
    parts = log.split()
    assert [(p.begin, p.end) for p in parts.trials] == [(0, 400), (400, 700), (710, 1000)]
    assert not {"gap", "nan"} & {f.code for f in parts.findings}
    assert "split" in parts.provenance[-1]
    assert len(parts.select(trials=1)) == 300
    assert len(log.select(start_s=0.1, stop_s=0.2)) == 100
    with pytest.raises(ulna.ArgumentError, match="no trial 7"):
        parts.select(trials=7)
    with pytest.raises(ulna.ArgumentError, match="step 1"):
        log.select(rows=slice(0, 10, 2))
    with pytest.raises(ulna.ArgumentError, match="after_s"):
        log.select(onsets_s=[0.1])
    with pytest.raises(ulna.ArgumentError, match="onset 1"):
        log.select(onsets_s=[0.1, 5], after_s=0.1)


@pytest.mark.parametrize(
    ("onsets", "pair"),
    [
        ([0.1, 0.25], r"onset 0 \(0.1 s\) and onset 1 \(0.25 s\)"),
        ([0.5, 0.1, 0.5], r"onset 0 \(0.5 s\) and onset 2 \(0.5 s\)"),
    ],
)
def test_segments_that_overlap_are_refused(onsets, pair):
    with pytest.raises(ulna.ArgumentError, match=pair + " overlap"):
        motion().select(onsets_s=onsets, after_s=0.2)


def test_segments_may_touch():
    segments = motion().select(onsets_s=[0.5, 0.3], before_s=0.05, after_s=0.15).segments
    assert [(s.begin, s.end) for s in segments] == [(250, 450), (450, 650)]


def test_resolve_and_roles():
    log = ulna.Record.from_arrays([0, 1], {"x": [1, 2], "y": [1, 2], "F_y": [1, 2], "F_x": [1, 2]})
    assert log.resolve("F") == (3, 2) == log.with_role("force") == log.resolve("force")
    assert log.resolve("x") == (0, 1) and log.resolve(["x"]) == (0,) and log.resolve("F_y") == (2,)
    with pytest.raises(ulna.ArgumentError, match="x, y, F_y, F_x"):
        log.resolve("G")


def test_regularise_undoes_jitter():
    rng = np.random.default_rng(0)
    t = np.arange(3000) / 1000 + 1e-4 * rng.uniform(-1, 1, 3000)
    log = ulna.Record.from_arrays(t, {"x": np.sin(30 * t), "note": np.round(t)})
    assert "jitter" in {f.code for f in log.findings}
    even = log.regularise(rate_hz=1000)
    assert "jitter" not in {f.code for f in even.findings}
    inside = slice(100, -100)
    # The resampler's tolerance is 1e-7 of the signal; its ends are less exact and left out.
    assert np.abs(even["x"] - np.sin(30 * even.time))[inside].max() < 1e-5
    assert set(even["note"]) <= set(log["note"])


def test_to_pandas():
    pandas = pytest.importorskip("pandas")
    frame = join([motion(100), motion(100)]).to_pandas()
    assert isinstance(frame, pandas.DataFrame) and frame["trial"].tolist() == [0] * 100 + [1] * 100
    assert frame.index.name == "time_s"


def test_text_of_a_record():
    log = motion()
    assert repr(log) == "<Record: 2000 samples at 1000 Hz, 1 trial; x [m], F_x [N], note [?]>"
    assert log.summary().startswith("2000 samples at 1000 Hz, 2 s, 1 trial\n  x [m]  position")
