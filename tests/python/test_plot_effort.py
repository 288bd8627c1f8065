"""Figures of effort and arm supports: what they draw, and what they refuse."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_hex

import ulna
from ulna import plot
from ulna.assist import read_force_table

TABLE = Path(__file__).resolve().parents[2] / "examples" / "data" / "arm-support.csv"
JOINTS = ["jLeftShoulder_rotx", "jRightElbow_rotz", "jL5S1_roty", "jRightKnee_roty"]


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def test_force_curves_show_every_subject_and_the_mean():
    table = read_force_table(TABLE)
    grid = table.plot()
    left = grid[0, 0]
    lines = [line for line in left.lines if len(line.get_xdata()) > 3]
    assert len(lines) == 3
    np.testing.assert_allclose(lines[-1].get_ydata(), table.mean.support_n)
    np.testing.assert_allclose(lines[0].get_xdata(), np.degrees(table.of(1).angle_rad))
    assert left.get_xlabel() and left.get_ylabel().endswith("(N)")


def test_bars_are_the_change_in_the_colour_of_its_sign():
    rng = np.random.default_rng(0)
    before = 10 + rng.normal(size=(6, 3, 4))
    after = before + np.array([-2.0, -1.0, 0.5, 3.0])
    grid = plot.effort_change(before, after, joints=JOINTS)
    assert [ax.get_title(loc="left") for ax in grid[:, 0]] == ["Arms", "Torso", "Legs"]
    heights = [[round(p.get_height(), 9) for p in ax.patches] for ax in grid[:, 0]]
    assert heights == [[-2.0, -1.0] * 3, [0.5] * 3, [3.0] * 3]
    colours = {to_hex(p.get_facecolor()) for p in grid[0, 0].patches}
    assert colours == {"#009e73"}
    assert {to_hex(p.get_facecolor()) for p in grid[2, 0].patches} == {"#d55e00"}
    assert [t.get_text() for t in grid[0, 0].get_xticklabels()] == ["L Shoulder x", "R Elbow z"]
    # One block, one area.
    one = plot.effort_change(before[:, 0, 2:3], after[:, 0, 2:3], joints=JOINTS[2:3])
    assert one.shape == (1, 1)


def test_lines_of_subjects_and_their_mean():
    before = np.array([10.0, 12, 9, 11])
    after = np.array([8.0, 9, 9.5, 8])
    grid = plot.subject_lines(before, after, names=("NE", "WE"))
    left, right = grid[0]
    slopes = [line.get_ydata() for line in left.lines if len(line.get_ydata()) == 2]
    np.testing.assert_allclose(slopes, [*zip(before, after, strict=True), (10.5, 8.625)])
    assert right.get_title(loc="left") == "Change -18 %"
    assert [t.get_text() for t in left.get_xticklabels()] == ["NE", "WE"]


def test_axes_in_axes_out_and_refusals():
    _, axes = plt.subplots(1, 2)
    assert plot.subject_lines([1.0, 2, 3], [2.0, 2, 2], axes)[0, 0] is axes[0]
    with pytest.raises(ulna.ArgumentError, match="1 x 2 axes"):
        plot.force_curves(read_force_table(TABLE), axes[:1])
    with pytest.raises(ulna.ArgumentError, match="shape"):
        plot.effort_change(np.ones((3, 2)), np.ones((3, 2)), joints=JOINTS)
    with pytest.raises(ulna.ArgumentError, match="same subjects"):
        plot.effort_change(np.ones((3, 4)), np.ones((4, 4)), joints=JOINTS)
    with pytest.raises(ulna.ArgumentError, match="3 subjects"):
        plot.subject_lines([1.0, 2.0], [1.0, 2.0])
