"""Input that no laboratory has: it is refused with a sentence, at once, and nothing is read or written beyond."""

import time
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import design, models, sim
from ulna._call import check, ffi, lib, options, result, view


ARM = Path(__file__).resolve().parents[2] / "examples" / "data" / "relaxed-arm.csv"


def refused(status, words):
    with pytest.raises(ulna.Error, match=words):
        check(status)


def quick(call):
    start = time.perf_counter()
    value = call()
    assert time.perf_counter() - start < 5.0
    return value


@pytest.mark.parametrize("seconds", [2.0**60 / 1000, 1e300])
def test_steps_of_endless_waits(seconds):
    for keywords in ({"wait_s": (seconds, seconds)}, {"hold_s": (seconds, seconds)}, {"rest_s": seconds},
                     {"wait_s": (seconds, seconds), "return_s": seconds}):  # fmt: skip
        with pytest.raises(ulna.ArgumentError, match="1e8 samples"):
            design.steps(size=0.005, **keywords)
    with pytest.raises(ulna.ArgumentError, match="a design has from 2 to 1e8"):
        design.steps(size=0.005, wait_s=(9e4, 9e4), repeats=1000)


def test_joint_views_without_entries():
    empty = view(np.zeros((0, 0)))
    refused(
        lib.ulna_joint_get_margins(
            empty, empty, empty, ffi.NULL, 0.95, 0, 0, result("ulna_joint_margins")
        ),
        "1 to 12 rows",
    )
    eye = np.eye(2)
    wide = np.zeros((0, 2_000_000))
    request = options("ulna_joint_request", m=eye, b=eye, k=eye, jacobian=wide, slope=wide)
    count, condition = ffi.new("int64_t *"), ffi.new("double *")
    refused(
        quick(lambda: lib.ulna_joint_transform(request, condition, ffi.NULL, 0, count)),
        "from 1 to 6 rows",
    )


def test_teleoperation_with_numbers_that_overflow():
    for damping, wall in ((1e308, 9e307), (1e308, 1.0), (9e307, 1e308)):
        with pytest.raises(ulna.ArgumentError, match="finite number"):
            ulna.teleoperation.allowed_stiffness(
                (1.0, 2.0, 3.0),
                delay_s=[0.1],
                device_damping_n_s_m=damping,
                wall_damping_n_s_m=wall,
            )
    with pytest.raises(ulna.ArgumentError, match="finite number"):
        ulna.teleoperation.allowed_gain(
            (1.0, 2.0, 3.0), delay_s=[0.1], master_damping_n_s_m=1.0, slave_damping_n_s_m=1e200,
            coupling_damping_n_s_m=1e200, coupling_stiffness_n_m=1.0,
        )  # fmt: skip
    # The largest that is taken is still answered.
    quick(
        lambda: ulna.teleoperation.allowed_gain(
            (1.0, 2.0, 3.0), delay_s=[1e50], master_damping_n_s_m=1.0, slave_damping_n_s_m=1e59,
            coupling_damping_n_s_m=1e-59, coupling_stiffness_n_m=1e59,
        )
    )  # fmt: skip


def test_responses_count_what_the_rows_can_give():
    u = view(np.random.default_rng(0).normal(size=(1000, 1)))
    ask = (ffi.NULL, ffi.NULL, 0, ffi.new("int64_t *"))
    for period in (3, 1001, 2**62):
        chosen = options("ulna_frf_options", period=period)
        refused(lib.ulna_frf_periodic(u, u, 100.0, chosen, *ask), "fit into the record")
    for segment in (-10, 1, 2**62):
        chosen = options("ulna_frf_options", segment=segment)
        refused(lib.ulna_frf_closed_loop(u, u, u, 100.0, chosen, *ask), "fit into the record")


def test_ranges_of_a_local_response_do_not_overlap():
    u = np.random.default_rng(0).normal(size=4000)
    with pytest.raises(ulna.ArgumentError, match="not overlap"):
        models.frf(u, u, rate_hz=100.0, method="local", runs=[(0, 2000), (1000, 3000)])


def test_a_closed_loop_response_does_not_depend_on_units():
    rng = np.random.default_rng(1)
    r = rng.normal(size=(8000, 2))
    u = r + 0.1 * rng.normal(size=r.shape)
    y = u @ np.array([[1.0, 0.3], [0.2, 2.0]]) + 0.01 * rng.normal(size=r.shape)
    plain = models.frf(u, y, reference=r, rate_hz=100.0)
    units = np.array([1.0, 1e-7])
    scaled = models.frf(u * units, y, reference=r * units, rate_hz=100.0)
    np.testing.assert_allclose(scaled.value * units, plain.value, rtol=1e-9)
    assert np.isfinite(plain.value[1:-1]).all()


def test_a_delay_in_slow_time_is_kept():
    u = np.zeros(40)
    u[4:] = 1.0
    fast = models.simulate([1.0], [1.0, 1.0], u, rate_hz=1.0, delay_s=5.0)
    slow = models.simulate([1e-3], [1.0, 1e-3], u, rate_hz=1e-3, delay_s=5000.0)
    np.testing.assert_allclose(slow, fast, rtol=1e-12)
    assert np.flatnonzero(fast)[0] == 10


def test_orders_that_cannot_be():
    u = np.random.default_rng(0).normal(size=400)
    for poles in ([0], [11], [1_000_000]):
        with pytest.raises(ulna.ArgumentError, match="from 1 to 10"):
            models.select_order(u, u, rate_hz=10.0, poles=poles)
    with pytest.raises(ulna.ArgumentError, match="more than 100000 models"):
        models.select_order(u, u, rate_hz=10.0, delay_s=np.linspace(0, 1, 20_000))


def test_a_sensor_check_of_less_than_its_margins():
    t = np.arange(3000) / 1000
    x = np.sin(2 * np.pi * 12 * t)
    log = ulna.Record.from_arrays(
        t, {"x": 1e-3 * x, "a_x": -1e-3 * (2 * np.pi * 12) ** 2 * x}, units={"a_x": "m/s^2"}
    )
    with pytest.raises(ulna.DataError, match="record longer, or look for a smaller lag"):
        ulna.rig.cross_check(log, acceleration="a_x", lowpass_hz=30, highpass_hz=10, max_lag_s=2.0)


def test_a_reaction_delay_is_checked_though_nobody_reacts():
    flat = np.zeros((200, 2))
    for delay in (-1.0, np.nan, 1e7, 1e300):
        human = sim.Human(cns=sim.CNS(delay_s=delay))
        raw = sim._human_struct(human)
        raw.cns = 0
        arm = sim.arms("3.2")["P1"]
        question = sim._question(arm, flat, None, None, None, None, None, None, 0.0, (), 0)
        question[2] = raw
        out = ffi.new("ulna_record **")
        refused(lib.ulna_sim_run(*question, 0, ffi.NULL, out), "reaction delay")


def test_a_plan_of_too_many_axes():
    flat = np.zeros((6000, 0))
    arm = options("ulna_design_arm", m=flat, b=flat, k=flat)
    plan = design.multisine(duration_s=10, seed=1)
    out = ffi.new("ulna_plan **")
    refused(
        quick(
            lambda: lib.ulna_design_plan(
                plan._native().pointer, arm, ffi.NULL, ffi.NULL, ffi.NULL, ffi.NULL, out
            )
        ),
        "from 1 to 6",
    )


def test_reserved_members_must_be_zero():
    raw = sim._human_struct(sim.Human())
    raw.reserved = 5
    arm = sim.arms("3.2")["P1"]
    question = sim._question(
        arm, np.zeros((200, 2)), None, None, None, None, None, None, 0.0, (), 0
    )
    question[2] = raw
    refused(lib.ulna_sim_run(*question, 0, ffi.NULL, ffi.new("ulna_record **")), "reserved member")


# Slips of a hand on the keyboard ------------------------------------------------------------------


@pytest.mark.parametrize("delays", [(50, 250), (0, 45), (0.05, 60)])
def test_delays_longer_than_the_record(delays):
    t = np.arange(0, 20, 0.002)
    x = 0.01 * np.sin(2 * np.pi * np.outer(t, [0.5, 1.3, 2.1])).sum(axis=1)
    log = ulna.Record.from_arrays(t, {"x": x, "F_x": -100 * x, "x_ref": x})
    with pytest.raises(ulna.DataError, match="samples are left"):
        ulna.identify_delayed_feedback(log, delay_range_s=delays)


def test_a_torque_of_the_wrong_sign_is_suspect():
    rng = np.random.default_rng(0)
    t = np.arange(0, 40, 0.001)
    rows = np.cumsum(rng.normal(size=t.size))
    x = 0.02 * np.convolve(rows - rows.mean(), np.ones(200) / 200, "same") / np.abs(rows).max()
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    torque = 0.02 * a + 0.6 * v + 60 * x + 0.02 * rng.normal(size=t.size)  # with the wrong sign
    log = ulna.Record.from_arrays(
        t, {"q": x, "tau": torque}, units={"q": "rad", "tau": "Nm"}, roles={"q": "position", "tau": "force"}
    )
    with pytest.warns(ulna.UncertainResult, match="inertia comes out negative"):
        found = ulna.identify_reflex(log, lowpass_hz=20, reflex_irf_s=0)
    assert found.outcome == "suspect_data"
    with pytest.warns(ulna.UncertainResult, match="inertia comes out negative"):
        assert ulna.identify_delayed_feedback(log, lowpass_hz=20).outcome == "suspect_data"


def test_a_model_that_explains_little_says_so():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.normal(size=300), 20)
    y = models.simulate([1.0], [1.0, 3.0, 60.0], u, rate_hz=200.0)
    y += 3 * y.std() * rng.normal(size=y.size)
    found = models.identify_transfer_function(u, y, rate_hz=200.0, poles=2, zeros=0)
    assert any("explains only" in note for note in found.notes)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: design.steps(size=5), "further than an arm goes"),
        (lambda: design.multisine(peak=10), "give m, or unit='mm'"),
        (lambda: design.multisine(peak=90, unit="rad", axes=("q",)), "give rad, or unit='deg'"),
        (lambda: design.random_binary(amplitude=15, unit="m"), "further than an arm goes"),
        (lambda: design.multisine(seed=1).plan(robot=sim.Robot()), "must be an ulna.design.Robot"),
        (lambda: design.multisine(seed=1).plan(noise=3), "must be an ulna.design.Noise"),
        (lambda: ulna.passivity(ulna.TransferFunction([1], [1, 1])), "use ulna.passivity.indices"),
        (lambda: ulna.virtual_sensor.sense(ulna.read(ARM), robot="thesis"), "must be an ulna.plant"),
    ],
)
def test_the_wrong_thing_is_refused_with_what_is_wanted(call, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        call()


def test_one_number_stands_for_a_list():
    u = np.repeat(np.random.default_rng(0).normal(size=100), 20)
    y = models.simulate([1.0], [1.0, 3.0], u, rate_hz=100.0)
    assert models.select_order(u, y, rate_hz=100.0, poles=1).best.poles == 1
    volts, force = [-1.0, 0.0, 1.0, 2.0], [-3.1, 0.0, 2.9, 6.1]
    line = ulna.rig.calibrate_line(volts, force, 0.1)
    assert line == ulna.rig.calibrate_line(volts, force, [0.1] * 4)
