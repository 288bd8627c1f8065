"""The exoskeleton and the arm from Python: the same numbers as the facts, and words for mistakes."""

import threading
from pathlib import Path

import numpy as np
import pytest

import ulna
from ulna import exo

ROOT = Path(__file__).resolve().parents[2]
NESM = ROOT / "examples" / "data" / "nesm.toml"
DEGREE = np.pi / 180


def test_published_device_has_its_published_inertia():
    plant = exo.exoskeleton(coupling="exo_only", published_straps=True)
    diagonal = plant.inertia(plant.reference).diagonal()
    # Published to three digits.
    np.testing.assert_allclose(diagonal, [0.401, 0.403, 0.084, 0.0231], atol=5.1e-4)


def test_device_file_is_the_published_device():
    # A device file has no straps: compare what is left without theirs.
    ours, read = exo.exoskeleton(coupling="exo_only"), exo.exoskeleton(NESM, coupling="exo_only")
    assert ours.names("joint") == read.names("joint")
    np.testing.assert_allclose(ours.reference, read.reference, atol=1e-15)
    np.testing.assert_allclose(ours.range, read.range, atol=1e-15)
    for name in ("Link1", "Link2", "Link3", "Link4"):
        for quantity in ("mass", "inertia", "body_position"):
            np.testing.assert_allclose(
                ours.values(quantity, name), read.values(quantity, name), atol=1e-15
            )
    for name in ours.names("joint"):
        for quantity in ("damping", "friction"):
            np.testing.assert_array_equal(ours.values(quantity, name), read.values(quantity, name))


@pytest.mark.parametrize("coupling", ["rigid", "apart", "exo_only", "arm_only"])
def test_nominal_model_equals_the_engine(coupling):
    # The engine adds what unexcited muscles pull, the nominal model has no muscles.
    plant = exo.exoskeleton(coupling=coupling, muscles="none")
    generator = np.random.default_rng(1)
    low, high = plant.range.T
    angle = low + (high - low) * generator.uniform(0.02, 0.98, (10, low.size))
    rate, acceleration = generator.normal(size=(2, 10, low.size))
    # Fast enough for the engine's soft Coulomb friction to slip; slower than about 0.5 rad/s it creeps.
    rate += np.copysign(0.8, rate)
    nominal = plant.inverse_dynamics(angle, rate, acceleration, dynamics="friction")
    engine = plant.inverse_dynamics(angle, rate, acceleration, dynamics="engine")
    # Of a constraint that slips the engine leaves 1e-9 of its limit.
    friction = "J4" in plant.names("joint")
    np.testing.assert_allclose(nominal, engine, rtol=0, atol=1e-6 if friction else 1e-10)


def test_friction_of_the_engine_creeps_where_that_of_the_model_is_full():
    plant = exo.exoskeleton(coupling="exo_only", muscles="none")
    angle, rest = plant.reference, np.zeros(4)
    angle[3] = 1.0  # away from the limits of the elbow
    slow, fast = rest.copy(), rest.copy()
    slow[3], fast[3] = 0.05, 1.0
    for rate, full in ((slow, False), (fast, True)):
        smooth, friction, engine = (
            plant.inverse_dynamics(angle, rate, rest, dynamics=kind)[3]
            for kind in ("nominal", "friction", "engine")
        )
        # 1 N m s/rad of damping and 2.787 N m.
        assert friction - smooth == pytest.approx(rate[3] + 2.787, abs=1e-12)
        coulomb = engine - smooth - rate[3]
        if full:
            assert coulomb == pytest.approx(2.787, abs=1e-6)
        else:
            assert 0.0 < coulomb < 0.5


def test_nominal_torque_of_a_hanging_arm_by_hand():
    plant = exo.exoskeleton(coupling="arm_only", muscles="none")
    rest = np.zeros(4)
    torque = plant.inverse_dynamics(plant.reference, rest, rest)
    # Masses times levers of the published arm, forward and horizontal, about the shoulder.
    s = 0.86267
    masses = [1.761, 0.489, 0.481, 0.481, 0.635, 0.351]
    hand = (0.5 * 0.045 + 0.12 * 0.13 + 0.015 * 0.06) / 0.635
    elbow = s * 0.2907
    levers = [
        s * 0.2907 / 2,
        s * 0.14,
        elbow + (0.265 + 0.0133) / 2,
        elbow + 0.0133 + 0.1325,
        elbow + 0.0133 + 0.265 + hand,
        elbow + 0.12,
    ]
    assert torque[0] == pytest.approx(-9.81 * np.dot(masses, levers), abs=1e-12)


def test_person_scales_with_height_and_mass():
    small, large = (
        exo.exoskeleton(coupling="arm_only", muscles="none", height_m=h, mass_kg=m)
        for h, m in ((1.6, 50), (1.9, 90))
    )
    assert large.values("mass", "humerus")[0] == pytest.approx(2.7)
    assert np.all(
        large.inertia(large.reference).diagonal() > small.inertia(small.reference).diagonal()
    )


def test_change_equals_a_new_scene():
    plant = exo.exoskeleton()
    values = np.array([[500.0, 0.7, 1.1]] * 8)
    made = exo.exoskeleton(muscle_values=values)
    changed = plant
    for name in plant.names("tendon"):
        changed = changed.change("muscle", name, [500.0, 0.7, 1.1])
    a, b = (exo.isometric_torque(p, joint="J4") for p in (made, changed))
    np.testing.assert_array_equal(a.active_nm, b.active_nm)
    with pytest.raises(ulna.UnsupportedError, match="no nominal model"):
        changed.inverse_dynamics(plant.reference, np.zeros(4), np.zeros(4))


def test_isometric_torque_reaches_its_goals():
    torque = exo.isometric_torque()
    (flexion, at), (extension, there) = torque.peaks
    assert flexion == pytest.approx(78, abs=4) and at == pytest.approx(85 * DEGREE, abs=3 * DEGREE)
    assert extension == pytest.approx(-51, abs=3)
    assert 65 * DEGREE - 1e-9 <= there <= 70 * DEGREE
    assert np.all(np.array(torque.error("Amis")) <= [12, 12])
    assert np.all(np.array(torque.error("Buchanan")) <= [6, 8])
    assert np.abs(torque.passive[30:111]).max() <= 2
    assert "flexion peak" in torque.summary()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            {"angle_rad": [0.5, 85.0]},
            "85 rad, which is 4870 degrees: joint 'elbow_flexion' goes from 0 to 125 degrees; "
            "angles are in rad",
        ),
        ({"angle_rad": -0.1}, "-5.73 degrees"),
        ({"angle_rad": "x"}, "angle_rad is 'x'; it must be numbers"),
        (
            {"joint": "shoulder_rotation", "muscles": ["brachialis"]},
            "no moment arm at joint 'shoulder_rotation'",
        ),
        ({"muscles": []}, "muscles names no muscle"),
        ({"muscles": "brachialis"}, "must be a sequence of names"),
        ({"plant": exo.exoskeleton(coupling="arm_only", muscles="none")}, "has no muscles"),
    ],
)
def test_isometric_torque_refuses_what_says_nothing(settings, words):
    with pytest.raises(ulna.ArgumentError, match=words):
        exo.isometric_torque(**settings)


def test_isometric_torque_names_the_joint_that_muscles_turn():
    held_softly = exo.exoskeleton(soft=True)
    with pytest.raises(
        ulna.ArgumentError, match="no moment arm at joint 'J4': joint='elbow_flexion' is one"
    ):
        exo.isometric_torque(held_softly, joint="J4")
    with pytest.raises(ulna.ArgumentError, match="at joint 'J3': joint='J4' is one"):
        exo.isometric_torque(exo.exoskeleton(), joint="J3", muscles=["anconeus"], angle_rad=0.1)
    softly = exo.isometric_torque(held_softly)
    np.testing.assert_allclose(softly.flexion, exo.isometric_torque().flexion, atol=1e-6)


def test_default_angles_stay_within_the_joint():
    device = exo.read_device(NESM)
    device["link"][3]["range_deg"] = [5, 90]
    device["link"][3]["reference_deg"] = 5
    torque = exo.isometric_torque(exo.exoskeleton(device), joint="J4")
    np.testing.assert_allclose(torque.angle_rad[[0, -1]], [5 * DEGREE, 90 * DEGREE])


def test_fit_finds_the_muscles_that_are_built_in():
    fitted = exo.fit_elbow_muscles()
    plant = exo.exoskeleton(coupling="arm_only")
    built_in = np.array([plant.values("muscle", name) for name in plant.names("tendon")])
    # Committed to four digits after the point, forces to 0.01 N.
    assert np.all(np.abs(fitted - built_in) < [0.006, 6e-5, 6e-5])


def test_runs_step_and_answer():
    plant = exo.exoskeleton(muscles="none")
    run = plant.run()
    run.set(position=[-0.3, -0.9, -0.1, 0.7], velocity=[0, 0, 0, 0.5])
    run.forward()
    by_parts = plant.inertia(run.position) @ run.acceleration + run.bias_torque
    sources = run.damping_torque + run.constraint_torque + run.actuator_torque
    np.testing.assert_allclose(by_parts, sources, atol=1e-10)
    run.step(20)
    assert run.time_s == pytest.approx(0.1)
    run.reset()
    assert run.time_s == 0
    np.testing.assert_array_equal(run.position, plant.reference)


def test_threads_share_a_plant():
    plant = exo.exoskeleton()
    ends = {}

    def simulate(key):
        run = plant.run()
        run.set(control=[1.0, 2.0, 0.5, 3.0] + [0.3] * 8)
        run.step(200)
        ends[key] = run.position

    threads = [threading.Thread(target=simulate, args=(i,)) for i in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    simulate("alone")
    for key in range(3):
        np.testing.assert_array_equal(ends[key], ends["alone"])


def test_a_run_that_fails_can_only_be_thrown_away():
    run = exo.exoskeleton(muscles="none").run()
    run.set(applied=[1e15, 0, 0, 0])
    with pytest.raises(ulna.AnalysisError, match="diverged"):
        run.step(100)
    with pytest.raises(ulna.ArgumentError, match="can only be freed"):
        run.step(1)


def test_scenes_of_the_user(tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(exo.exoskeleton().mjcf)
    plant = exo.read_scene(path)
    assert plant.names("joint") == ("J1", "J2", "J3", "J4")
    for name in plant.names("tendon"):
        for quantity in ("muscle", "length_range"):
            np.testing.assert_allclose(
                plant.values(quantity, name), exo.exoskeleton().values(quantity, name), rtol=1e-15
            )
    plant.run().step(10)
    with pytest.raises(ulna.UnsupportedError, match="no nominal model"):
        plant.inverse_dynamics(plant.reference, np.zeros(4), np.zeros(4))
    path.write_text("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>")
    with pytest.raises(ulna.FormatError, match="cannot be compiled.*mass"):
        exo.read_scene(path)
    with pytest.raises(ulna.FileError, match="there is no file"):
        exo.read_scene(tmp_path / "nothing.xml")


def _spoilt(key, value, link=3):
    device = exo.read_device(NESM)
    if value is None:
        del device["link"][link][key]
    else:
        device["link"][link][key] = value
    return device


@pytest.mark.parametrize(
    ("device", "words"),
    [
        (_spoilt("joint", None), r"link 4 \(Link4\) has no joint"),
        (_spoilt("mass_kg", -1.0), "body 'Link4' must have a positive mass"),
        (_spoilt("mass_kg", float("nan")), "holds a number that is not finite"),
        (_spoilt("mass_kg", None), r"link 4 \(Link4\) has no mass_kg"),
        (_spoilt("centre_m", [0, 1]), "centre_m of link 4 .* must be 3 numbers"),
        (_spoilt("centre_m", "middle"), "must be 3 numbers"),
        (_spoilt("axis", [0, 0, 2]), "axis whose length is not 1"),
        (_spoilt("quaternion", [2, 0, 0, 0]), "quaternion whose length is not 1"),
        (_spoilt("range_deg", [10, -10]), "joint 'J4' must have a range"),
        (_spoilt("colour", "red"), "has 'colour', which no link has"),
        (_spoilt("name", "Link1"), "two bodies have the name 'Link1'"),
        ({"link": []}, "two .*link.* tables or more"),
        ({"link": [1, 2]}, r"link 1 is 1; it must be a table"),
        (_spoilt("joint", ["a"]), r"joint of link 4 \(Link4\) is \['a'\]; it must be a text"),
        (_spoilt("mass_kg", True), "mass_kg of link 4 .* must be 1 number"),
        (_spoilt("mass_kg", "0.5"), "mass_kg of link 4 .* must be 1 number"),
        (_spoilt("axis", [0, 0, "1"]), "axis of link 4 .* must be 3 numbers"),
        (exo.read_device(NESM) | {"kp": 5}, r"the device has 'kp'.* known is \[\[link\]\]"),
        (_spoilt("joint", "elbow_flexion"), "'elbow_flexion' .* name of a joint of the arm"),
        (_spoilt("joint", "wrist_flexion"), "call it 'exo_wrist_flexion'"),
        (_spoilt("position_m", [0, 0.3, 0]), "'J4' of the device is 295 mm from the elbow"),
    ],
)
def test_bad_devices_say_why(device, words):
    with pytest.raises(ulna.Error, match=words):
        exo.exoskeleton(device)


def test_joints_named_like_the_arms_are_refused_in_soft_interfaces_too():
    for name in ("shoulder_rotation", "elbow_flexion"):
        with pytest.raises(ulna.ArgumentError, match=f"'{name}' .* name of a joint of the arm"):
            exo.exoskeleton(_spoilt("joint", name), soft=True)
    # Without an arm the joint keeps its friction and damping.
    alone = exo.exoskeleton(_spoilt("joint", "elbow_flexion"), coupling="exo_only")
    assert alone.values("friction", "elbow_flexion") == 2.787
    assert alone.values("damping", "elbow_flexion") == 1.0


def test_arms_of_any_length_are_stretched_onto_the_device():
    for arm in (
        {"upper_factor": 0.7},
        {"upper_factor": 1.1},
        {"upper_factor": 1.6},
        {"height_m": 1.2, "mass_kg": 30},
        {"height_m": 2.1, "mass_kg": 110},
    ):
        for device in (None, NESM):
            exo.exoskeleton(device, **arm)
    longer = _spoilt("position_m", [0, 0.35, 0], link=2)
    exo.exoskeleton(longer, upper_factor=1.4)
    exo.exoskeleton(longer, coupling="apart")
    with pytest.raises(ulna.ArgumentError, match="or give the arm's length"):
        exo.exoskeleton(longer)


def test_devices_that_cannot_be_read_say_why(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b"name = '\xe9'")
    for device, kind, words in (
        (tmp_path, ulna.FileError, "cannot be read: Is a directory"),
        (tmp_path / "nothing.toml", ulna.FileError, "nothing.toml cannot be read: No such file"),
        (tmp_path / "latin.toml", ulna.FormatError, "is not TOML"),
        (3, ulna.ArgumentError, "device is 3; it must be the path"),
    ):
        with pytest.raises(kind, match=words) as caught:
            exo.exoskeleton(device)
        assert kind is ulna.FormatError or caught.value.argument == "device"
    with pytest.raises(ulna.FileError, match="is a folder: give the name of a file"):
        exo.read_scene(tmp_path)


def test_bad_arguments_say_why(tmp_path):
    plant = exo.exoskeleton()
    start = plant.reference
    start[3] = 140 * DEGREE
    cases = [
        (lambda: plant.check_start(start), "'J4' is 140 degrees, outside its range"),
        (lambda: exo.exoskeleton(coupling="glued"), "coupling is 'glued'"),
        (lambda: exo.exoskeleton(muscles="strong"), "muscles is 'strong'"),
        (lambda: exo.exoskeleton(height_m=175, mass_kg=70), "height must be between"),
        (lambda: exo.exoskeleton(height_m=1.75, mass_kg=70, fore_factor=1.1), "not both"),
        (lambda: exo.exoskeleton(timestep_s=0), "timestep_s must not be 0"),
        (lambda: exo.exoskeleton(solver_tolerance=0.0), "solver_tolerance must not be 0"),
        (lambda: exo.exoskeleton(solver_iterations=0), "solver_iterations must not be 0"),
        (lambda: exo.read_scene(tmp_path / "scene.xml", contacts=0), "contacts must not be 0"),
        (lambda: exo.fit_elbow_muscles(passive_limit_nm=0), "passive_limit_nm must not be 0"),
        (lambda: exo.exoskeleton(upper_factor="long"), "upper_factor is 'long'; it must be a number"),
        (lambda: exo.exoskeleton(mass_kg=True), "mass_kg is True; it must be a number"),
        (lambda: exo.exoskeleton(muscle_values="big"), "muscle_values is 'big'; it must be numbers"),
        (lambda: exo.exoskeleton(NESM, published_straps=True), "has no straps"),
        (lambda: exo.exoskeleton(timestep_s=-1), "time step"),
        (lambda: exo.exoskeleton(muscle_values=np.ones((2, 3))), "2 rows, 8 are expected"),
        (lambda: plant.values("mass", "Link7"), "no body 'Link7'"),
        (lambda: plant.values("weight", "Link1"), "quantity is 'weight'"),
        (lambda: plant.change("mass", "Link1", -2), "must be positive"),
        (lambda: plant.inertia(np.zeros(3)), "3 columns, 4 are expected"),
        (lambda: plant.run().set(colour=[1]), "no colour to set"),
        (lambda: plant.run().set(position=[1]), "1 entries, 4 are expected"),
        (lambda: plant.run().set(position=[np.nan] * 4), "values"),
        (lambda: plant.run().step(-1), "negative"),
        (lambda: exo.isometric_torque(joint="knee"), "no joint 'knee'"),
        (lambda: exo.isometric_torque(muscles=["soleus"]), "soleus"),
        (lambda: exo.isometric_torque().error("Holzbaur"), "source is"),
        (lambda: exo.fit_elbow_muscles(evaluations=0), "1 or more"),
        (lambda: exo.fit_elbow_muscles(passive_limit_nm=-1), "must be positive"),
        (lambda: exo.fit_elbow_muscles(exo.exoskeleton(muscles="none")), "no elbow muscles"),
    ]
    for call, words in cases:
        with pytest.raises(ulna.Error, match=words):
            call()
    bad = tmp_path / "bad.toml"
    bad.write_text("link = [")
    with pytest.raises(ulna.FormatError, match="is not TOML"):
        exo.exoskeleton(bad)


def test_figure_shows_curves_and_moment_arms():
    pytest.importorskip("matplotlib")
    left, right = exo.isometric_torque().plot()[0]
    assert {"flexion", "extension", "Amis", "Buchanan"} <= {
        entry.get_text() for entry in left.get_legend().get_texts()
    }
    assert len(right.texts) == 8
