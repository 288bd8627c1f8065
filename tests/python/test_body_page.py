"""The body coloured by effort: its data, the picture, and the page in a browser."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

import matplotlib.image  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
from browser import Browser, chromium  # noqa: E402
from stick_body import stick_body, with_balls  # noqa: E402

from ulna import _body_page  # noqa: E402
from ulna._body_cast import Solid, View, image  # noqa: E402
from ulna._body_page import three_files, write_page  # noqa: E402
from ulna._body_picture import draw  # noqa: E402
from ulna._body_scene import (  # noqa: E402
    BodyForce,
    BodyJoint,
    BodyLink,
    BodyScene,
    colour_limits,
    colour_table,
    floor_height,
    rotation_matrix,
    z_onto,
)
from ulna.record import ArgumentError  # noqa: E402

try:
    three_files()
    THREE = True
except FileNotFoundError:
    THREE = False
needs_three = pytest.mark.skipif(not THREE, reason="three.js is not there: install libjs-three")
needs_browser = pytest.mark.skipif(
    chromium() is None or not THREE, reason="there is no Chromium, or no three.js, on this machine"
)


def with_changes(scene, **changes):
    return dataclasses.replace(scene, **changes)


def small(**changes):
    """Two frames of one link."""
    given = {
        "name": "arm", "links": [BodyLink("forearm", "capsule", (0.04, 0.3))], "time_s": [0.0, 0.1],
        "position_m": [[[0, 0, 1]], [[0, 0, 1.1]]], "rotation": [[[1, 0, 0, 0]]] * 2,
        "effort": [[3.0], [5.0]],
    } | changes  # fmt: skip
    return BodyScene(**given)


@pytest.fixture(scope="module")
def scenes():
    return (
        stick_body(name="without"),
        stick_body(name="with", relief=0.65, device=True),
    )


@pytest.fixture(scope="module")
def pages(scenes, tmp_path_factory):
    """Files: a pair, one alone with balls, and one with gaps."""
    folder = tmp_path_factory.mktemp("pages")
    without, device = scenes
    effort = without.effort.copy()
    effort[:, 7] = np.nan
    effort[60:, 1] = np.nan
    place = without.position_m.copy()
    place[40:80, 5] = np.nan
    gaps = with_changes(without, effort=effort, position_m=place, effort_sd=None)
    return {
        "pair": write_page(
            without, folder / "pair.html", beside=device, title="Drilling <overhead>"
        ),
        "balls": write_page(with_balls(without), folder / "balls.html"),
        "gaps": write_page(gaps, folder / "gaps.html", title="Gaps"),
    }


# Data --------------------------------------------------------------------------------------------


def test_scene_repr_values_and_series():
    scene = small(joints=[BodyJoint("elbow", "forearm")], joint_effort=[[7.0], [np.nan]])
    np.testing.assert_array_equal(scene.values, [[3, 7], [5, np.nan]])
    np.testing.assert_array_equal(scene.series, [5, 5])  # means of what is known
    assert repr(small()) == "BodyScene('arm': 2 frames of 1 link over 0.1 s, effort 3 to 5 N m)"
    assert small().hardest_frame() == 1
    assert small().frame_at(time_s=0.04) == 0
    lost = small(effort=[[np.nan], [np.nan]])
    assert np.isnan(lost.series).all() and lost.hardest_frame() == 0
    assert "nowhere known" in repr(lost)
    given = small(overall=[9.0, 1.0])
    assert given.hardest_frame() == 0


def test_scene_is_a_copy_that_cannot_be_written_to():
    effort = np.array([[3.0], [5.0]])
    scene = small(effort=effort)
    effort[0, 0] = 100.0
    assert scene.effort[0, 0] == 3.0
    with pytest.raises(ValueError, match="read-only"):
        scene.effort[0, 0] = 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"links": []}, "has no links"),
        ({"time_s": [0.0, np.nan]}, "one finite number for each frame"),
        ({"time_s": [0.1, 0.1]}, "frame 1 is not later"),
        ({"time_s": []}, "one finite number for each frame"),
        ({"position_m": [[[0, 0, 1]]]}, r"position_m must have the shape \(2, 1, 3\)"),
        ({"position_m": [[[0, 0, np.inf]], [[0, 0, 1]]]}, "'forearm' is infinite in frame 0"),
        ({"rotation": [[[0, 0, 0, 0]]] * 2}, "quaternion of link 'forearm' in frame 0 is all zero"),
        ({"effort": None}, "neither effort nor joint_effort"),
        ({"effort": [[1.0], [np.inf]]}, "effort of 'forearm' is infinite in frame 1"),
        ({"effort": "much"}, "effort must be an array"),
        ({"effort_sd": [[1.0], [-1.0]]}, "negative standard deviation"),
        ({"joint_effort": [[1.0], [1.0]]}, "without joints"),
        ({"joints": [BodyJoint("elbow", "nowhere")]}, "'elbow' stands on the link 'nowhere'"),
        ({"joints": [BodyJoint("forearm", "forearm")]}, "stands twice"),
        ({"joints": [BodyJoint("elbow", "forearm", radius_m=0.0)]}, "must be above zero"),
        ({"joints": [BodyJoint("elbow", "forearm", (0, 0))]}, "must be x, y, z"),
        (
            {"effort_sd": [[1.0], [1.0]], "effort": None, "joint_effort": [[1.0], [1.0]],
             "joints": [BodyJoint("elbow", "forearm")]},
            "effort_sd is given without effort",
        ),
        ({"forces": [BodyForce("push", "forearm")]}, "give both or neither"),
        ({"force_N": np.zeros((2, 1, 3))}, "give both or neither"),
        ({"overall": [1.0]}, "overall must have the shape"),
    ],
)  # fmt: skip
def test_bad_scenes_are_refused_with_a_reason(changes, words):
    with pytest.raises(ArgumentError, match=words):
        small(**changes)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("", "sphere", (0.1,)), "has no name"),
        (("a", "cone", (0.1,)), "'cone' of link 'a' is none of box"),
        (("a", "box", (0.1, 0.2)), "must be the three edges"),
        (("a", "sphere", (0.0,)), "all above zero"),
        (("a", "sphere", (np.nan,)), "finite"),
        (("a", "sphere", ("wide",)), "must be numbers"),
        (("a", "capsule", (0.1, 0.1)), "shorter than its diameter"),
        (("a", "sphere", (0.1,), (0, 0)), "centre of link 'a' must be x, y, z"),
        (("a", "sphere", (0.1,), (0, 0, 0), (0, 0, 0, 0)), "not all zero"),
        (("a", "sphere", (0.1,), (0, 0, 0), (1, 0, 0, 0), "hat"), "'hat' of link 'a' is none of"),
    ],
)
def test_bad_links_are_refused_with_a_reason(arguments, words):
    with pytest.raises(ArgumentError, match=words):
        BodyLink(*arguments)


def test_rotation_matrix_against_a_library():
    from scipy.spatial.transform import Rotation

    q = np.random.default_rng(3).normal(size=(20, 4))
    expected = Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(rotation_matrix(q), expected, atol=1e-14)


def test_a_cylinder_is_laid_along_an_axis():
    for axis in ([0, 0, 2.0], [0, 0, -1.0], [0, 3.0, 0], [1.0, -2.0, 0.5]):
        along = rotation_matrix(z_onto(axis)) @ [0, 0, 1]
        np.testing.assert_allclose(along, axis / np.linalg.norm(axis), atol=1e-12)


def test_floor_is_below_the_lowest_foot():
    scene = stick_body()
    foot = [link.name for link in scene.links].index("right foot")
    height = scene.links[foot].size_m[2]
    sole = scene.position_m[0, foot, 2] + scene.links[foot].centre_m[2] - height / 2
    assert floor_height(scene) == pytest.approx(sole, abs=1e-12)


# Colours -----------------------------------------------------------------------------------------


def luminance(colours):
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def test_colours_fall_in_lightness_for_every_eye():
    table = colour_table()
    assert table.shape == (256, 3)
    lightness = 116 * np.cbrt(luminance(table)) - 16
    steps = np.diff(lightness)
    assert (steps < 0).all()
    # Even to a factor of three, so equal differences look about equal.
    assert steps.min() / steps.max() < 3
    # G. M. Machado et al., 2009, Table 1 at full severity, in linear light.
    linear = np.where(table <= 0.04045, table / 12.92, ((table + 0.055) / 1.055) ** 2.4)
    for matrix in (
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ):  # fmt: skip
        seen = np.clip(linear @ np.transpose(matrix), 0, 1) @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(seen) < 0).all()


def test_limits_are_round_and_leave_a_glitch_out():
    calm = small(effort=[[3.0], [5.0]])
    assert colour_limits([calm], None) == (0.0, 5.0)
    assert colour_limits([calm], (1, 2)) == (1.0, 2.0)
    frames = 4000
    many = {
        "time_s": np.arange(frames), "position_m": np.zeros((frames, 1, 3)),
        "rotation": np.tile([1.0, 0, 0, 0], (frames, 1, 1)),
    }  # fmt: skip
    effort = np.linspace(0.1, 7.0, frames)[:, None]
    effort[17] = 500.0
    assert colour_limits([small(**many, effort=effort)], None) == (0.0, 8.0)
    assert colour_limits([small(**many, effort=effort - 3.5)], None)[0] == -4.0
    assert colour_limits([small(effort=[[np.nan], [np.nan]])], None) == (0.0, 1.0)
    assert colour_limits([small(effort=[[0.0], [0.0]])], None) == (0.0, 1.0)
    for bad in [(1.0, 1.0), (np.nan, 1.0), (1.0,)]:
        with pytest.raises(ArgumentError, match="lower first"):
            colour_limits([calm], bad)


# Picture -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("link", "area"),
    [
        # Silhouettes along x, with corners rounded by r: a rectangle less (4 - pi) r^2.
        (BodyLink("a", "sphere", (0.2,)), np.pi * 0.04),
        (BodyLink("a", "capsule", (0.1, 0.6)), 0.2 * 0.4 + np.pi * 0.01),
        (BodyLink("a", "box", (0.3, 0.4, 0.5)), 0.4 * 0.5 - (4 - np.pi) * (0.42 * 0.15) ** 2),
        (BodyLink("a", "cylinder", (0.1, 0.5)), 0.2 * 0.5 - (4 - np.pi) * (0.3 * 0.1) ** 2),
    ],
)
def test_shapes_cover_the_area_of_their_silhouette(link, area):
    solid = Solid(link, np.array([1.0, 0.2, 0.5]), np.eye(3), np.array([1.0, 0.5, 0.2]))
    picture = image([solid], View(0.0, 0.0), (-0.2, 0.6, 0.1, 0.9), (200, 200), None)
    # A ray counts as a hit from a quarter of a ray's width on: up to 1 mm around a shape of 2 m.
    assert picture[..., 3].sum() * (0.8 / 200) ** 2 == pytest.approx(area, rel=0.012)


def test_the_nearer_shape_is_seen_and_colours_are_those_of_the_bar():
    near = Solid(
        BodyLink("a", "sphere", (0.1,)), np.array([1.0, 0, 0]), np.eye(3), np.array([1.0, 0, 0])
    )
    far = Solid(BodyLink("b", "sphere", (0.3,)), np.zeros(3), np.eye(3), np.array([0, 0, 1.0]))
    for order in ([near, far], [far, near]):
        picture = image(order, View(0.0, 0.0), (-0.4, 0.4, -0.4, 0.4), (80, 80), None)
        middle = picture[40, 40]
        assert middle[0] > 0.9 and middle[2] == 0 and middle[3] == 1
        assert picture[40, 60, 2] > 0.7 and picture[40, 60, 0] == 0
        assert picture[0, 0, 3] == 0
    behind = image([near, far], View(180.0, 0.0), (-0.4, 0.4, -0.4, 0.4), (80, 80), None)
    assert behind[40, 40, 0] == 0
    ball = dataclasses.replace(near, through=True)
    shining = image([ball, far], View(180.0, 0.0), (-0.4, 0.4, -0.4, 0.4), (80, 80), None)
    assert shining[40, 40, 0] > 0.4 and shining[40, 40, 2] > 0.2


def test_the_floor_takes_a_shadow():
    solid = Solid(BodyLink("a", "sphere", (0.1,)), np.array([0, 0, 0.3]), np.eye(3), np.ones(3))
    window = (-0.6, 0.6, -0.3, 0.7)
    without = image([solid], View(0, 25), window, (120, 100), None)
    shaded = image([solid], View(0, 25), window, (120, 100), 0.0)
    # The lamp stands 74 degrees high, the eye 25, a pixel is 1 cm wide, the shadow is 0.26 dark; its
    # image has steps of 12 mm and counts a ray that passes within a quarter of one: 6 % more area.
    dark = 0.26 * np.pi * 0.01 / np.sin(np.radians(74)) * np.sin(np.radians(25)) / 1e-4
    assert shaded[..., 3].sum() - without[..., 3].sum() == pytest.approx(1.06 * dark, rel=0.03)
    below = without[..., 3] == 0
    assert (shaded[below][:, :3] == 0).all() and shaded[below][:, 3].max() < 0.3


def test_views_turn_as_said():
    ahead, left = View(0, 0), View(90, 0)
    np.testing.assert_allclose(ahead.project([1.0, 2.0, 3.0]), [2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(left.project([1.0, 2.0, 3.0]), [-1.0, 3.0], atol=1e-12)


def drawn_text(grid):
    figure = grid[0, 0].figure
    return [
        t.get_text() for one in figure.findobj(matplotlib.text.Text) for t in [one] if t.get_text()
    ]


def test_draw_two_conditions(scenes):
    without, device = scenes
    grid = draw(without, 60, beside=device)
    assert grid.shape == (1, 2)
    words = drawn_text(grid)
    for expected in ("without", "with", "joint torque (N m)", "exoskeleton", "tool", "force"):
        assert expected in words
    arm = without.effort[60, [link.name for link in without.links].index("right upper arm")]
    assert f"right upper arm\n{arm:.3g} N m" in words
    assert f"right upper arm\n{0.35 * arm:.3g} N m" in words  # the same parts are named in both
    assert "not known" not in words
    figure = grid[0, 0].figure
    figure.canvas.draw()
    # What is drawn stays inside of the figure.
    box = figure.get_tightbbox(figure.canvas.get_renderer())
    size = figure.get_size_inches()
    assert box.x0 > -0.02 and box.y0 > -0.02 and box.x1 < size[0] + 0.02 and box.y1 < size[1] + 0.02
    left, right = (np.asarray(place.images[0].get_array()) for place in grid[0])
    assert left.shape == right.shape and np.abs(left - right).max() > 0.3
    plt.close("all")


def test_draw_in_given_axes_with_gaps_and_balls(scenes):
    scene = with_balls(scenes[0])
    figure, place = plt.subplots(figsize=(2, 2))
    grid = draw(scene, -1, place, labels=0)
    assert grid[0, 0] is place
    assert "not known" not in drawn_text(grid)  # the grey body carries no effort at all
    lost = small(position_m=np.full((2, 1, 3), np.nan), effort=[[np.nan], [1.0]])
    words = drawn_text(draw(lost, 0))
    assert "no pose in this frame" in words and "not known" in words
    plt.close("all")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: draw(s, 2), "frame must be a whole number below 2"),
        (lambda s: draw(s, 0.5), "frame must be a whole number"),
        (lambda s: draw(s, 0, beside=s, beside_frame=9), "beside_frame must be"),
        (lambda s: draw(s, 0, labels=-1), "labels must be zero or more"),
        (lambda s: draw("arm", 0), "scene must be a BodyScene"),
        (lambda s: draw(s, 0, beside="arm"), "beside must be a BodyScene"),
        (lambda s: draw(s, 0, beside=small(unit="W")), "one colour bar cannot mean both"),
        (lambda s: draw(s, 0, limits=(2, 1)), "lower first"),
        (lambda s: write_page(s, "."), "is a folder"),
        (lambda s: write_page(s, "x.html", rate_hz=0), "rate_hz must be above zero"),
        (lambda s: write_page(s, "x.html", start_s=np.nan), "start_s must be a finite"),
    ],
)
def test_bad_calls_are_refused(call, words):
    with pytest.raises(ArgumentError, match=words):
        call(small())


# File --------------------------------------------------------------------------------------------


def data_of(path):
    text = Path(path).read_text(encoding="utf-8")
    return json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', text)[1]
    )


@needs_three
def test_the_page_is_one_file_with_the_licence_of_what_it_holds(pages):
    text = pages["pair"].read_text(encoding="utf-8")
    assert "Drilling &lt;overhead&gt;" in text and "<overhead>" not in text
    assert "Copyright © 2010-2019 three.js authors" in text
    assert "Permission is hereby granted, free of charge" in text
    assert not re.search(r"<(?:script|link|img)[^>]*(?:src|href)=", text)
    assert "@" not in re.sub(r"<script.*?</script>|<style.*?</style>", "", text, flags=re.S)


@needs_three
def test_the_data_come_back_from_the_page(pages, scenes):
    data = data_of(pages["pair"])
    scene, held = scenes[1], data["scenes"][1]
    assert [link["name"] for link in held["links"]] == [link.name for link in scene.links]
    shape = scene.position_m.shape
    place = np.frombuffer(base64.b64decode(held["position"]), "<i2").reshape(shape) / 32767
    step = held["reach"] / 32767
    np.testing.assert_allclose(
        place * held["reach"] + held["centre"], scene.position_m, atol=0.51 * step
    )
    assert step < 1e-4
    turn = np.frombuffer(base64.b64decode(held["rotation"]), "<i2").reshape(*shape[:2], 4) / 32767
    np.testing.assert_allclose(turn, scene.rotation, atol=0.51 / 32767)
    effort = np.frombuffer(base64.b64decode(held["effort"]), "<f4").reshape(shape[:2])
    np.testing.assert_array_equal(effort, scene.effort.astype("f4"))
    gaps = data_of(pages["gaps"])["scenes"][0]
    place = np.frombuffer(base64.b64decode(gaps["position"]), "<i2").reshape(
        scenes[0].position_m.shape
    )
    assert (place[40:80, 5] == -32768).all() and (place[:40] != -32768).all()


@needs_three
def test_frames_that_come_too_fast_are_left_out(tmp_path):
    scene = stick_body(seconds=2.0, rate_hz=240.0)
    data = data_of(write_page(scene, tmp_path / "page.html", rate_hz=30.0))
    time = np.frombuffer(base64.b64decode(data["scenes"][0]["time"]), "<f4")
    assert time.size == 61 and time[0] == 0 and time[-1] == pytest.approx(scene.time_s[-1])
    assert np.diff(time)[:-1] == pytest.approx(1 / 30, abs=1e-6)
    assert "61 of 480 frames" in (tmp_path / "page.html").read_text(encoding="utf-8")


@needs_three
def test_names_cannot_break_out_of_the_page(tmp_path):
    name = "</script><script>alert(1)</script><!--"
    scene = small(name=name, links=[BodyLink(name, "sphere", (0.1,))])
    text = write_page(scene, tmp_path / "deep" / "page.html", title=name, source=name).read_text(
        "utf-8"
    )
    assert "alert(1)</script>" not in text
    assert data_of(tmp_path / "deep" / "page.html")["scenes"][0]["name"] == name


def test_without_three_it_says_how_to_get_it(monkeypatch, tmp_path):
    monkeypatch.setattr(_body_page, "_THREE", ((tmp_path / "a.js", tmp_path / "b.js"),))
    with pytest.raises(FileNotFoundError, match="apt-get install libjs-three"):
        write_page(small(), tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


# Browser -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    with Browser(chromium(), width=900, height=700) as one:
        yield one


def pixels(browser, tmp_path, name="shot.png"):
    browser.until("ulna.ready()")
    (tmp_path / name).write_bytes(browser.screenshot())
    return matplotlib.image.imread(tmp_path / name)[..., :3]


def stage(browser):
    """Left, top, width and height of the stage in the window."""
    return browser.run(
        "(() => { const b = document.getElementById('stage').getBoundingClientRect();"
        "return [b.left, b.top, b.width, b.height]; })()"
    )


def colours(browser, scene, part):
    return browser.run(f"ulna.state().colours[{scene}][{part}]")


@needs_browser
def test_the_page_shows_both_bodies_without_errors_and_without_a_network(browser, pages, tmp_path):
    browser.open(pages["pair"])
    shot = pixels(browser, tmp_path)
    left, top, width, height = (int(v) for v in stage(browser))
    for half in (0, 1):
        x = left + half * width // 2
        body = shot[top + height // 5 : top + 9 * height // 10, x + width // 8 : x + 3 * width // 8]
        # Paper and floor are grey: saturated pixels are those of the body.
        saturation = body.max(axis=2) - body.min(axis=2)
        assert 0.03 < (saturation > 0.3).mean() < 0.8
        assert len(np.unique((body * 15).astype(int).reshape(-1, 3), axis=0)) > 40
    assert browser.errors == []
    assert all(url.startswith(("file:", "about:", "data:")) for url in browser.requests)
    heads = browser.run("document.getElementById('heads').innerText")
    assert "without" in heads and "with" in heads
    assert browser.run("document.getElementById('bar-title').textContent") == "joint torque (N m)"
    legend = browser.run("document.getElementById('legend').innerText")
    assert "exoskeleton" in legend and "tool" in legend and "not known" not in legend


@needs_browser
def test_colours_are_those_of_the_data_and_change_with_time(browser, pages, scenes, tmp_path):
    browser.open(pages["pair"], fragment="#t=0")
    data = data_of(pages["pair"])
    part = [link.name for link in scenes[0].links].index("right upper arm")
    before = pixels(browser, tmp_path)

    def expected(scene, frame):
        share = (scenes[scene].effort[frame, part] - data["low"]) / (data["high"] - data["low"])
        return data["colours"][round(share * (len(data["colours"]) - 1))]

    assert [colours(browser, k, part) for k in (0, 1)] == [expected(0, 0), expected(1, 0)]
    browser.run("ulna.go(1.0)")
    after = pixels(browser, tmp_path)
    assert browser.run("ulna.state().frames") == [30, 30]
    assert [colours(browser, k, part) for k in (0, 1)] == [expected(0, 30), expected(1, 30)]
    assert expected(0, 0) != expected(0, 30) != expected(1, 30)
    assert (np.abs(after - before).max(axis=2) > 0.1).mean() > 0.005
    # The device has its own colour, which is not on the bar.
    cuff = [link.name for link in scenes[1].links].index("cuff")
    assert colours(browser, 1, cuff) == data["device"].lower() not in data["colours"]


@needs_browser
def test_playing_by_button_and_keyboard(browser, pages):
    browser.open(pages["pair"], fragment="#t=1")
    browser.until("ulna.ready()")
    x, y = browser.run(
        "(() => { const b = document.getElementById('play').getBoundingClientRect();"
        "return [b.left + 10, b.top + 10]; })()"
    )
    browser.click(x, y)
    assert browser.run("ulna.state().playing") is True
    browser.until("ulna.state().time > 1.1")
    browser.click(x, y)
    assert browser.run("ulna.state().playing") is False
    browser.run("document.activeElement.blur()")
    browser.key("Home")
    assert browser.run("ulna.state().time") == 0
    browser.key(".")
    assert browser.run("ulna.state().frames") == [1, 1]
    browser.key(",")
    browser.key("End")
    assert browser.run("ulna.state().frames") == [119, 119]
    browser.key(" ", code=32)
    assert browser.run("ulna.state().playing") is True  # from the start again
    browser.key(" ", code=32)
    assert browser.run("ulna.state().playing") is False
    assert browser.run("document.getElementById('scrub').getAttribute('aria-valuetext')")
    # The slider and the curve over time lead to the same place.
    browser.run(
        "(() => { const s = document.getElementById('scrub'); s.value = 2; "
        "s.dispatchEvent(new Event('input')); })()"
    )
    assert browser.run("ulna.state().frames") == [60, 60]
    assert browser.errors == []


@needs_browser
def test_pointing_names_a_part_and_clicking_shows_it_over_time(browser, pages, scenes):
    browser.open(pages["pair"], fragment="#t=2")
    browser.until("ulna.ready()")
    browser.run("ulna.view('right')")
    browser.until("ulna.ready()")
    part = [link.name for link in scenes[0].links].index("right upper arm")
    left, top, *_ = stage(browser)
    for scene in (0, 1):
        x, y = browser.run(f"ulna.where({scene}, {part})")
        browser.mouse("moved", left + x, top + y)
        told = browser.run("document.getElementById('tip').innerText")
        value = scenes[scene].effort[60, part]
        if scene == 0:
            assert told.startswith("right upper arm") and f"joint torque {value:.1f} ± " in told
            assert told.endswith("\u00a0N\u00a0m")
            browser.click(left + x, top + y)
            assert browser.run("ulna.state().chosen") == "right upper arm"
            now = browser.run("document.getElementById('now').innerText")
            assert f"{value:.1f} ±" in now and f"{scenes[1].effort[60, part]:.2f} ±" in now
            assert browser.run("document.querySelectorAll('#chart .band').length") == 2
    browser.mouse("moved", left + 5, top + 200)
    assert browser.run("document.getElementById('tip').hidden") is True
    # From the keyboard: the list holds every part that has a value, and none that has not.
    options = browser.run("[...document.getElementById('part').options].map(o => o.value)")
    assert "left shank" in options and "cuff" not in options
    browser.run("ulna.choose('left shank')")
    assert browser.run("ulna.state().chosen") == "left shank"
    assert browser.errors == []


@needs_browser
def test_the_view_turns_by_mouse_and_keys(browser, pages, tmp_path):
    browser.open(pages["balls"], fragment="#t=1")
    before = pixels(browser, tmp_path)

    def eye():
        return np.array(browser.run("ulna.state().eye"))

    eyes = [eye()]
    left, top, width, height = stage(browser)
    x, y = left + width / 4, top + height / 2
    browser.mouse("moved", x, y)
    browser.mouse("pressed", x, y, button="left", buttons=1, clickCount=1)
    browser.mouse("moved", x + 150, y + 20, button="left", buttons=1)
    browser.mouse("released", x + 150, y + 20, button="left", clickCount=1)
    browser.mouse("moved", 1, 1)
    eyes.append(eye())
    after = pixels(browser, tmp_path)
    assert (np.abs(after - before).max(axis=2) > 0.1).mean() > 0.01
    browser.run("document.getElementById('canvas').focus()")
    for key in ("ArrowLeft", "ArrowUp", "+", "-", "2"):
        browser.key(key)
        eyes.append(eye())
    distance = [np.linalg.norm(b - a) for a, b in zip(eyes, eyes[1:], strict=False)]
    assert min(distance) > 0.1
    np.testing.assert_allclose(eyes[5], eyes[3], atol=1e-9)  # nearer and back again
    assert abs(eyes[-1][0]) < 1e-6 < 1 < eyes[-1][1]  # from the left
    browser.key("0")
    np.testing.assert_allclose(eye(), eyes[0], atol=1e-9)
    assert browser.errors == []


@needs_browser
def test_gaps_are_grey_or_hidden_and_said_in_words(browser, pages, scenes):
    browser.open(pages["gaps"], fragment="#t=2")
    browser.until("ulna.ready()")
    data = data_of(pages["gaps"])
    missing = data["missing"].lower()
    assert colours(browser, 0, 7) == missing and colours(browser, 0, 1) == missing
    assert colours(browser, 0, 5) is None  # the head has no pose here
    assert colours(browser, 0, 0) in data["colours"]
    assert "not known" in browser.run("document.getElementById('legend').innerText")
    browser.run("ulna.choose('L5/L3')")
    assert browser.run("document.getElementById('now').innerText") == "not known"
    browser.run("ulna.go(1.0)")
    browser.until("ulna.ready()")
    assert colours(browser, 0, 1) in data["colours"] and colours(browser, 0, 5) in data["colours"]
    assert browser.run("document.querySelectorAll('#chart .line').length") == 1
    assert browser.errors == []


@needs_browser
def test_dark_page_in_a_dark_room(browser, pages, tmp_path):
    browser.open(pages["balls"])
    light = pixels(browser, tmp_path)
    browser.media("dark")
    browser.run("new Promise(r => setTimeout(r, 100))")
    dark = pixels(browser, tmp_path)
    corner = np.s_[5:15, 5:15]
    assert light[corner].min() > 0.95 and dark[corner].max() < 0.15
    assert browser.run("getComputedStyle(document.body).color") == "rgb(236, 236, 236)"
    assert browser.errors == []


@needs_browser
def test_one_frame_and_nothing_known(browser, tmp_path):
    scene = small(
        time_s=[3.0], position_m=[[[0, 0, 1]]], rotation=[[[1, 0, 0, 0]]], effort=[[np.nan]]
    )
    browser.open(write_page(scene, tmp_path / "still.html"))
    browser.until("ulna.ready()")
    assert browser.run("document.getElementById('play').disabled") is True
    assert browser.errors == []
    gone = with_changes(scene, position_m=[[[np.nan] * 3]])
    browser.open(write_page(gone, tmp_path / "gone.html"))
    browser.until("ulna.ready()")
    assert browser.run("ulna.state().colours") == [[None]]
    assert browser.errors == []
