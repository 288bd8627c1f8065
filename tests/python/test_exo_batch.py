"""Rows of assessments on the library's threads: the same bits, failures in their rows, studies."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from ctrl_c import ctrl_c

import ulna
from ulna import exo

DATA = Path(__file__).resolve().parents[2] / "examples" / "data"
BRIEF = exo.Protocol(
    shape="minimum_jerk", duration_s=1.0, balanced=True, carry_weight=True,
    start_rad=np.radians([-5, -85, 0, 80]), moved={"J4": np.radians(50)},
)  # fmt: skip
OUTPUTS = ("K_est", "D_est", "K_true", "D_true", "K_error", "K_est_error", "slip_rad", "start_s")


@pytest.fixture(scope="module")
def arms():
    design = ulna.StudyDesign(
        {"fore_factor": ulna.Uniform(0.9, 1.1), "fore_mass_kg": ulna.Uniform(0.6, 1.3)},
        scheme="sample", n=8, seed=1,
    )  # fmt: skip
    return dict(zip(("fore_factor", "fore_mass_kg"), design.values().T, strict=True))


def test_a_row_is_an_assessment_of_its_arm(arms):
    done = exo.assess_batch(arms, protocol=BRIEF, outputs=OUTPUTS)
    assert done.status == ("ok",) * 8
    assert (done.wall_s > 0).all()
    nominal = exo.exoskeleton()
    for row in (0, 5):
        arm = {name: values[row] for name, values in arms.items()}
        alone = exo.mobilise(exo.exoskeleton(**arm), BRIEF, nominal=nominal)
        (joint,) = alone.joints
        assert done["K_est"][row] == joint.k
        assert done["D_est"][row] == joint.d
        assert done["K_est_error"][row] == joint.k_error
        assert done["K_true"][row] == joint.true_k
        assert done["D_true"][row] == joint.true_d
        assert done["start_s"][row] == alone.start_s
        assert done["K_error"][row] == joint.k - joint.true_k
    # An estimator that knows the arm errs by rounding.
    own = exo.assess_batch(arms, protocol=BRIEF, outputs=["K_error"], nominal="own")
    assert np.abs(own["K_error"]).max() < 1e-8 < np.abs(done["K_error"]).max()


def test_the_same_bits_on_any_number_of_threads_and_in_any_groups(arms):
    model = exo.AssessmentModel(tuple(arms), protocol=BRIEF, outputs=OUTPUTS, threads=1)
    one = model.run(arms)
    two = exo.AssessmentModel(tuple(arms), protocol=BRIEF, outputs=OUTPUTS, threads=2).run(arms)
    part = model.run({name: values[3:5] for name, values in arms.items()})
    for name in OUTPUTS:
        np.testing.assert_array_equal(one[name], two[name])
        np.testing.assert_array_equal(one[name][3:5], part[name])


def test_every_factor_does_something():
    """Each factor of soft interfaces, one at a time, changes what is found; so does the tissue."""
    base = {name: (1.0, 1.02) for name in ("upper_factor", "fore_factor")}
    base |= {"upper_mass_kg": (1.761, 1.9), "fore_mass_kg": (0.962, 1.05)}
    base |= {f"{limb}_stiffness_n_m": (537.5, 700.0) for limb in ("upper", "fore")}
    base |= {f"{limb}_viscosity_n_s_m": (10.0, 20.0) for limb in ("upper", "fore")}
    base |= {f"{limb}_friction": (0.7, 0.5) for limb in ("upper", "fore")}
    base |= {f"{limb}_pretension_n": (20.0, 30.0) for limb in ("upper", "fore")}
    base |= {f"shoulder_offset_{axis}_m": (0.0, 0.004) for axis in "xyz"}
    base |= {f"elbow_offset_{axis}_m": (0.0, 0.004) for axis in "xyz"}
    base |= {"donning_rotation_rad": (0.0, 0.05), "flexors": (0.4, 0.3), "extensors": (0.4, 0.5)}
    names = list(base)
    rows = np.array([[base[name][0] for name in names]] * (len(names) + 1))
    for k, name in enumerate(names):
        rows[k + 1, k] = base[name][1]
    protocol = exo.Protocol(
        shape="minimum_jerk", duration_s=0.4, settle_s=0.02, start_angle_rad=0.3,
        start_rate_rad_s=10.0, start_rad=np.radians([-5, -85, 0, 80]),
        moved={"J4": np.radians(60)},
    )  # fmt: skip
    done = exo.assess_batch(
        dict(zip(names, rows.T, strict=True)), soft=exo.Soft(fixed_device=True), protocol=protocol,
        outputs=["K_est", "D_est", "slip_rad"],
    )  # fmt: skip
    assert set(done.status) == {"ok"}, done.messages
    same = [
        name
        for k, name in enumerate(names)
        if all(done[out][k + 1] == done[out][0] for out in done.values)
    ]
    assert same == []
    # Zero is none, not the library's default.
    none = exo.assess_batch(
        {"upper_friction": [0.7, 0.0]}, soft=True, protocol=protocol, outputs=["slip_rad"]
    )
    assert none["slip_rad"][0] != none["slip_rad"][1]


def test_a_person_by_height_and_mass():
    rows = {"height_m": [1.7, 1.8], "mass_kg": [65.0, 85.0]}
    done = exo.assess_batch(
        rows, scene={"height_m": 1.75, "mass_kg": 70.0}, protocol=BRIEF, outputs=["K_error"]
    )
    assert done.status == ("ok", "ok")
    assert done["K_error"][0] != done["K_error"][1]
    with pytest.raises(ulna.ArgumentError, match="needs a scene with a height and a mass"):
        exo.assess_batch({"height_m": [1.7]})
    with pytest.raises(ulna.ArgumentError, match="not a number of an arm by height and mass"):
        exo.assess_batch({"fore_mass_kg": [1.0]}, scene={"height_m": 1.75, "mass_kg": 70.0})


def test_rows_that_cannot_be_fail_alone():
    rows = {"fore_mass_kg": [0.9, -1.0, 0.0, 1.0], "flexors": [0.4, 0.4, 0.4, 7.0]}
    done = exo.assess_batch(rows, protocol=BRIEF, outputs=["K_est"])
    assert done.status[:3] == ("ok", "failed_init", "failed_init")
    assert "fore_mass_kg is -1.0" in done.messages[1]
    assert done.status[3] != "ok" and done.messages[3]
    assert np.isfinite(done["K_est"]).tolist() == [True, False, False, False]
    assert 0 not in done.messages
    short = exo.assess_batch(
        {"fore_mass_kg": [0.9]}, protocol=BRIEF.with_(rate_limit_rad_s=0.01), outputs=["K_est"]
    )
    assert short.status == ("diverged",)


def test_reduced_interfaces():
    """A row is the assessment of its arm's reduced plant."""
    protocol = exo.Protocol(
        shape="minimum_jerk", duration_s=0.5, settle_s=0.1, start_angle_rad=0.3,
        start_rate_rad_s=10.0, start_rad=np.radians([-5, -85, 0, 80]),
        moved={"J4": np.radians(60)},
    )  # fmt: skip
    rows = {"fore_stiffness_n_m": [400.0, 800.0], "fore_mass_kg": [0.962, 1.1]}
    done = exo.assess_batch(
        rows, soft=True, reduced=True, protocol=protocol, outputs=["K_est", "K_true", "slip_rad"]
    )
    assert done.status == ("ok", "ok")
    plant = exo.exoskeleton(soft=exo.Soft(stiffness_n_m=(537.5, 800.0)), fore_mass_kg=1.1).reduced()
    alone = exo.mobilise(plant, protocol, nominal=exo.exoskeleton())
    assert done["K_est"][1] == alone.joints[0].k
    assert done["K_true"][1] == alone.joints[0].true_k
    assert done["slip_rad"][1] == alone.largest_slip_rad
    full = exo.assess_batch(rows, soft=True, protocol=protocol, outputs=["slip_rad"])
    assert full["slip_rad"][1] != done["slip_rad"][1]
    other = exo.assess_batch(
        rows, soft=True, reduced={"activation": 0.1}, protocol=protocol, outputs=["slip_rad"]
    )
    assert other["slip_rad"][1] != done["slip_rad"][1]


@pytest.mark.parametrize(
    ("factors", "settings", "words"),
    [
        (["mass"], {}, "'mass' is no factor"),
        ("fore_factor", {}, "sequence of names"),
        (["fore_factor"], {"outputs": ["K"]}, "'K' is no output"),
        (["fore_factor"], {"outputs": "K_est"}, "sequence of names"),
        (["fore_factor", "fore_factor"], {}, "varied twice"),
        (["fore_stiffness_n_m"], {}, "needs soft interfaces"),
        (["fore_factor"], {"reduced": True}, "only soft interfaces"),
        (["fore_factor"], {"soft": {"hard": 1.0}}, "soft has 'hard'"),
        (["fore_factor"], {"nominal": "mine"}, "a plant or 'own'"),
        (["fore_factor"], {"protocol": exo.Protocol(moved={"J9": 0.0})}, "J9"),
        (["fore_factor"], {"scene": {"muscles": "strong"}}, "muscles is 'strong'"),
        (["fore_factor"], {"identify": {"errors": "none"}}, "errors is 'none'"),
    ],
)
def test_bad_models_are_refused(factors, settings, words):
    with pytest.raises(ValueError, match=words):
        exo.AssessmentModel(factors, **settings)


def test_bad_rows_are_refused():
    model = exo.AssessmentModel(["fore_factor", "fore_mass_kg"], protocol=BRIEF)
    for rows in (
        {"fore_factor": [1.0]},
        {"fore_factor": [1.0], "fore_mass_kg": [1.0], "flexors": [0.4]},
        {"fore_factor": [1.0, 1.1], "fore_mass_kg": [1.0]},
        {"fore_factor": 1.0, "fore_mass_kg": 1.0},
    ):
        with pytest.raises(ulna.ArgumentError):
            model.run(rows)
    with pytest.raises(ulna.Error, match="finite|NaN|nan|number"):
        model.run({"fore_factor": [float("nan")], "fore_mass_kg": [1.0]})
    assert model.run({"fore_factor": [], "fore_mass_kg": []}).status == ()


def test_a_study_of_assessments(tmp_path):
    factors = {"fore_factor": ulna.Uniform(0.9, 1.1), "fore_mass_kg": ulna.Uniform(-0.05, 1.3)}
    model = exo.AssessmentModel(factors, outputs=["K_error", "K_est"], protocol=BRIEF)
    study = model.study(factors)
    assert study.units == {
        "fore_factor": "", "fore_mass_kg": "kg", "K_error": "N m/rad", "K_est": "N m/rad"
    }  # fmt: skip
    design = study.design(scheme="sample", n=64, seed=1)
    runs = study.run(design, journal=tmp_path, on_failure="drop_block")
    lost = design.values()[:, 1] <= 0
    assert lost.any()
    np.testing.assert_array_equal(runs.status == 1, lost)  # failed_init
    assert (runs.wall_s > 0).all()
    # A journal of another protocol is refused, and travelling changes nothing.
    again = pickle.loads(pickle.dumps(model)).study(factors).run(
        design, journal=tmp_path, on_failure="drop_block"
    )
    np.testing.assert_array_equal(again.y, runs.y)
    other = exo.AssessmentModel(
        factors, outputs=["K_error", "K_est"], protocol=BRIEF.with_(duration_s=2.0)
    )
    with pytest.raises(ulna.DataError):
        other.study(factors).run(design, journal=tmp_path, on_failure="drop_block")
    # So is one of another nominal model, and of a device whose file says something else now.
    heavy, light = (
        exo.AssessmentModel(factors, nominal=exo.exoskeleton(fore_mass_kg=mass)).plan_source
        for mass in (1.2, 0.9)
    )
    assert heavy != light
    published = (DATA / "nesm.toml").read_text()
    plans = set()
    for text in (published, published.replace("1.663", "1.763")):
        (tmp_path / "device.toml").write_text(text)
        plans.add(exo.AssessmentModel(factors, device=tmp_path / "device.toml").plan_source)
    assert len(plans) == 2
    with pytest.raises(ulna.ArgumentError, match="factors must be"):
        model.study({"fore_factor": ulna.Uniform(0.9, 1.1)})


def test_published_factors():
    factors = exo.published_factors()
    assert list(factors) == [
        "upper_factor", "fore_factor", "upper_mass_kg", "fore_mass_kg", "upper_stiffness_n_m",
        "fore_stiffness_n_m",
    ]  # fmt: skip
    assert factors["upper_factor"].low == pytest.approx(0.750, abs=5e-4)
    assert factors["upper_factor"].high == pytest.approx(1.039, abs=5e-4)
    assert factors["fore_factor"].low == pytest.approx(0.81, abs=5e-4)
    assert factors["fore_factor"].high == pytest.approx(0.99, abs=5e-4)


def test_a_batch_is_interrupted():
    """Ctrl-C during a long batch: the call ends soon, and the model can be used again."""
    model = exo.AssessmentModel(["fore_factor"], protocol=BRIEF, threads=2)
    with ctrl_c(after_s=0.3), pytest.raises(KeyboardInterrupt):
        model.run({"fore_factor": np.full(100_000, 1.0)})
    assert model.run({"fore_factor": [1.0]}).status == ("ok",)
