"""Soft interfaces between an arm and an exoskeleton: the tissue, the whole plant, the reduced one."""

from __future__ import annotations

import json

import numpy as np
import pytest
from ulna import exo
from ulna.cli import main


@pytest.fixture(scope="module")
def plant():
    return exo.exoskeleton(soft=True)


@pytest.fixture(scope="module")
def assessed(plant):
    return exo.mobilise(plant)


def test_the_compressed_tissue_is_that_of_the_published_range():
    # 10 to 70 kPa at 30 to 40 % strain between the published soft and stiff settings.
    for limb in ("upper", "fore"):
        soft = exo.compression_test({"stiffness_n_m": 100.5}, limb=limb)
        stiff = exo.compression_test({"stiffness_n_m": 974.43}, limb=limb)
        for test in (soft, stiff):
            assert (np.diff(test.force_n) > 0).all()
            assert (np.diff(test.strain) > 0).all()
            assert test.energy_rise_j < 1e-9
        assert soft.modulus_at(0.3) < 10e3 < 70e3 < stiff.modulus_at(0.3)
        assert np.isnan(soft.modulus_at(0.9))


def test_elements_of_ten_times_the_mass_are_as_stiff():
    light = exo.compression_test(True)
    heavy = exo.compression_test({"element_mass_kg": 0.03})
    # Quasi-static: what differs is how far each step of the force settles, 1e-7 m/s.
    assert heavy.modulus_at(0.35) == pytest.approx(light.modulus_at(0.35), rel=1e-3)


def test_an_assessment_logs_what_the_interfaces_do(assessed):
    assert assessed.status == "ok"
    record = assessed.record
    for limb in ("upper", "fore"):
        assert record[f"pressure_{limb}"].max() > 1e3
        assert record[f"tension_{limb}"].min() >= 0
        assert np.isfinite(record[f"displacement_{limb}_y"]).all()
    # Of cuffs that are fitted, on the published arm; 3 to 4 degrees over the range of tissue.
    assert 0 < assessed.largest_slip_rad < np.radians(5)
    joint = assessed.joints[0]
    assert joint.model_residual_rms > 0.01  # the interface is in no nominal model


def test_the_slip_counts_from_the_donned_arm(assessed):
    record = assessed.record
    apart = record["q_elbow_flexion"] - record["theta_J4"]
    # The published start is not aligned better than this before anything moves.
    assert assessed.largest_slip_rad == pytest.approx(
        np.abs(apart).max(), abs=np.radians(3)
    )


def test_bushings_are_symmetric_and_never_push_energy_in(plant):
    reduced = plant.reduced()
    assert len(reduced.bushings) == 4
    for bushing in reduced.bushings:
        for matrix in (bushing.stiffness, bushing.damping):
            np.testing.assert_allclose(
                matrix, matrix.T, atol=1e-9 * np.abs(matrix).max()
            )
            assert np.linalg.eigvalsh(matrix).min() > -1e-9 * np.abs(matrix).max()
    found = exo.mobilise(reduced)
    assert found.status == "ok"
    record = found.record
    assert np.isfinite(record["F_fore_cuff_x"]).all()
    with pytest.raises(KeyError, match="pressure_fore"):
        record["pressure_fore"]
    assert plant.bushings == () == exo.exoskeleton().bushings


def test_a_run_is_donned_anywhere_and_its_interfaces_are_read(plant):
    run = plant.run()
    run.don([0, -np.pi / 2, 0, np.radians(80)])
    assert run.position[3] == pytest.approx(np.radians(80))
    before = run.interfaces
    assert before["fore"].turn_rad == pytest.approx(0, abs=1e-12)
    run.step(40)
    state = run.interfaces["fore"]
    assert state.pressure_pa > 0
    assert state.tension_n > 0
    np.testing.assert_allclose(np.linalg.norm(state.displacement_m), 0.003, atol=0.01)
    run.reset()
    assert run.time_s == 0


def test_the_same_run_gives_the_same_bits(plant):
    ends = []
    for _ in range(2):
        run = plant.run()
        run.step(60)
        ends.append(run.position)
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize(
    ("soft", "words"),
    [
        ({"strap_length_m": 0.05}, "strap around the upper arm is too short"),
        ({"strap_length_m": (0.5, 0.05)}, "strap around the forearm is too short"),
        ({"shear": 0}, "shear .* positive"),
        ({"shear": np.nan}, "stiffness against shear"),
        ({"shoulder_offset_m": (0.5, 0, 0)}, "offsets of shoulder and elbow"),
        ({"shoulder_offset_m": (np.nan, 0, 0)}, "offsets of shoulder and elbow"),
        ({"shoulder_offset_m": (1, 2)}, "shoulder_offset_m .* 3 numbers"),
        ({"stiffness_n_m": np.nan}, "stiffness"),
        ({"stiffness_n_m": 0}, "stiffness_n_m .* positive"),
        ({"stiffness_n_m": -1}, "stiffness_n_m .* negative"),
        ({"friction": np.inf}, "friction"),
        ({"donning_rotation_rad": 2}, "quarter of a turn"),
        ({"squeeze_m": 0.5}, "squeeze|lining"),
        ({"tightness_pa": np.nan}, "tight"),
        ({"cuffs": "loose"}, "'fitted' or 'published'"),
        ({"hardness": 3}, "hardness"),
        ("hard", "must be True"),
        ({"stiffness_n_m": (1, 2, 3)}, "stiffness_n_m .* one number, or two: upper arm, forearm"),
        ({"stiffness_n_m": "x"}, "stiffness_n_m is 'x'; it must be one number, or two"),
        ({"friction": True}, "friction is True; it must be one number, or two"),
        ({"elbow_offset_m": (0, 0, "x")}, "elbow_offset_m .* 3 numbers"),
        ({"donning_rotation_rad": "x"}, "donning_rotation_rad is 'x'; it must be a number"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(soft, words):
    with pytest.raises(ValueError, match=words) as caught:
        exo.exoskeleton(soft=soft)
    assert "\n" not in str(caught.value)


def test_a_compression_ends_below_its_largest_strain():
    with pytest.raises(ValueError, match="above 0 and below 0.9"):
        exo.compression_test(largest_strain=0.9)
    with pytest.raises(ValueError, match="largest_strain is 'x'; it must be a number"):
        exo.compression_test(largest_strain="x")


@pytest.mark.parametrize("end", ["start_rad", "end_rad"])
def test_a_reduction_takes_the_angle_zero(plant, end):
    other = {"start_rad": "end_rad", "end_rad": "start_rad"}[end]
    settings = {other: np.radians(60), "poses": 8}
    zero, near = (plant.reduced(**settings, **{end: angle}) for angle in (0, 1e-9))
    for at_zero, beside in zip(zero.bushings, near.bushings, strict=True):
        np.testing.assert_allclose(at_zero.stiffness, beside.stiffness, rtol=1e-5, atol=1e-3)
        np.testing.assert_allclose(at_zero.preload, beside.preload, rtol=1e-5, atol=1e-3)
    with pytest.raises(ValueError, match="a start and an end that differ"):
        plant.reduced(start_rad=0, end_rad=0)


def test_a_reduction_from_zero_to_its_default_start(plant):
    assert len(plant.reduced(start_rad=0, end_rad=np.radians(110)).bushings) == 4


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"activation": -0.5}, "activation is -0.5; it must be between 0 and 1"),
        ({"activation": np.nan}, "activation is nan"),
        ({"activation": 1.5}, "activation must be between 0 and 1"),
        ({"poses": 0}, "poses must not be 0"),
        ({"poses": -3}, "4 to 1000 poses"),
        ({"poses": 3}, "4 to 1000 poses"),
        ({"start_rad": "x"}, "start_rad is 'x'; it must be a number"),
    ],
)
def test_reductions_that_cannot_be(plant, settings, words):
    with pytest.raises(ValueError, match=words):
        plant.reduced(**settings)
    with pytest.raises(ValueError, match=words):
        exo.AssessmentModel(["flexors"], soft=True, reduced=settings).run({"flexors": [0.4]})


def test_soft_and_another_coupling_exclude_each_other():
    with pytest.raises(ValueError, match="coupling"):
        exo.exoskeleton(soft=True, coupling="apart")


def test_what_only_soft_plants_have_is_refused_elsewhere():
    rigid = exo.exoskeleton()
    with pytest.raises(Exception, match="soft interfaces"):
        rigid.reduced()
    with pytest.raises(Exception, match="soft interfaces"):
        rigid.run().don([0, 0, 0, 0])
    assert rigid.run().interfaces == {}
    with pytest.raises(Exception, match="description"):
        exo.exoskeleton(soft=True).change("mass", "Link4", 0.6)


def test_the_command_takes_soft_interfaces(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    scene.write_text("[soft]\nstiffness_n_m = [300, 400]\n")
    assert (
        main(["simulate", "assessment", "--scene", str(scene), "--reduced", "--json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert found["status"] == "ok"
    scene.write_text("[soft]\nstifness_n_m = 300\n")
    assert main(["simulate", "assessment", "--scene", str(scene)]) != 0
    assert "stifness_n_m" in capsys.readouterr().err
