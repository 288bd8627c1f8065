"""Pictures and films of the exoskeleton, and its figures. Drawing needs OpenGL; what it says without
it is tested everywhere."""

from __future__ import annotations

import threading

import matplotlib.pyplot as plt
import numpy as np
import pytest
from ulna import exo, plot
from ulna._call import ArgumentError, DataError, Error, FileError, ffi, lib

SMALL = (96, 72)
DRAWS, WORDS = exo.render_available()
needs_opengl = pytest.mark.skipif(not DRAWS, reason=WORDS)


@pytest.fixture(scope="module")
def plant():
    return exo.exoskeleton()


@pytest.fixture(scope="module")
def done(plant):
    return exo.mobilise(plant)


def test_availability_says_by_what_or_what_is_missing():
    there, words = exo.render_available()
    assert words.startswith(("EGL, ", "OSMesa, ")) if there else "Debian package" in words
    for backend in ("egl", "osmesa"):
        there, words = exo.render_available(backend=backend)
        # One process draws in one way only: the other one is not available any more.
        assert there or "Debian package" in words or "already" in words
    with pytest.raises(ArgumentError, match="one of any, egl, osmesa"):
        exo.render_available(backend="metal")


@needs_opengl
def test_picture_shows_something_and_is_written_as_it_is(plant, tmp_path):
    path = tmp_path / "reference.png"
    picture = plant.render(path=path, size=SMALL)
    assert picture.shape == (72, 96, 3) and picture.dtype == np.uint8
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 100
    # Matplotlib reads with a library of its own.
    np.testing.assert_array_equal(np.round(255 * plt.imread(path)[..., :3]), picture)


@needs_opengl
def test_muscles_turn_from_blue_to_red(plant):
    renderer = exo.Renderer(plant, size=(240, 180), person=False, skin=False)
    run = plant.run()
    shares = []
    for activation in (0.0, 0.5, 1.0):
        run.set(activation=np.full(8, activation))
        run.forward()
        red, green, blue = np.moveaxis(renderer.draw(run).astype(int), -1, 0)
        shares.append(
            (((red > 90) & (red > 2 * green) & (red > 2 * blue)).sum(),
             ((blue > 90) & (blue > 2 * red)).sum())
        )  # fmt: skip
    (red_at_rest, blue_at_rest), _, (red_at_full, blue_at_full) = shares
    assert blue_at_rest > 100 and red_at_full > 100
    assert red_at_rest < 0.1 * red_at_full and blue_at_full < 0.1 * blue_at_rest


@needs_opengl
def test_depth_arrows_and_spheres(plant):
    renderer = exo.Renderer(plant, size=SMALL, look_at_m=[0, 0, 0], distance_m=2.0,
                            azimuth_rad=np.pi / 2, elevation_rad=0.0)  # fmt: skip
    with pytest.raises(ArgumentError, match="drawn nothing"):
        renderer.depth_m  # noqa: B018 - a property that refuses
    run = plant.run()
    bare = renderer.draw(run)
    assert np.isinf(renderer.depth_m).any() and renderer.depth_m.shape == (72, 96)
    ball = exo.spheres([0, -0.5, 0], radius_m=0.1, colour=(0, 1, 0))
    green = renderer.draw(run, ball)
    # Seen along y from y = -2: the ball's front is 1.4 m away.
    assert renderer.depth_m[36, 48] == pytest.approx(1.4, abs=2e-3)
    assert green[36, 48, 1] > 2 * green[36, 48, 0]
    assert (renderer.draw(run) == bare).all()
    assert exo.arrows(np.zeros((2, 3)), [[0, 0, 0], [0, 10, 0]]).shape == (1, 12)
    both = np.vstack([ball, exo.arrows([0.2, -0.3, 0.1], [0, 0, 100.0])])
    assert (renderer.draw(run, both) != green).any()


@needs_opengl
def test_drawing_leaves_the_run_as_it_is(plant):
    drawn, plain = plant.run(), plant.run()
    renderer = exo.Renderer(plant, size=SMALL)
    for run in (drawn, plain):
        run.set(control=[0, 0, 0, 4.0] + 8 * [0.2])
    for _ in range(4):
        for run in (drawn, plain):
            run.step(10)
        renderer.draw(drawn)
    np.testing.assert_array_equal(drawn.position, plain.position)


@needs_opengl
def test_a_plant_with_other_numbers_and_one_from_a_file(plant, tmp_path):
    heavier = plant.change("mass", "Link4", 0.6)
    np.testing.assert_array_equal(heavier.render(size=SMALL), plant.render(size=SMALL))
    path = tmp_path / "ball.xml"
    path.write_text(
        '<mujoco><worldbody><light pos="0 0 3"/><camera name="near" pos="0 -1 0" euler="90 0 0"/>'
        '<body name="b"><freejoint/><geom size="0.2" rgba="1 0 0 1"/></body></worldbody></mujoco>'
    )
    scene = exo.read_scene(path)
    for camera in ("near", "side"):
        red, green, _ = scene.render(size=SMALL, camera=camera)[36, 48]
        assert red > 100 and green < 60


@needs_opengl
def test_soft_interfaces_show_what_holds_the_arm():
    soft = exo.exoskeleton(soft=True)
    run = soft.run()
    run.don([0, -np.pi / 2, 0, 1.2])
    run.step(2)
    look = {"size": (160, 120)}
    shown, plain = soft.render(run, **look), soft.render(run, interfaces=False, **look)
    assert (shown != plain).sum() > 500
    bare = soft.render(run, force_scale_m_n=0, **look)
    assert (shown != bare).any()
    renderer = exo.Renderer(soft, **look)
    given = renderer.draw(run, forces=np.full((2, 6), 40.0))
    assert (given != renderer.draw(run)).any()
    with pytest.raises(ArgumentError, match="row for each soft interface"):
        renderer.draw(run, forces=np.zeros((1, 6)))
    with pytest.raises(DataError, match="holds NaN"):
        renderer.draw(run, forces=np.full((2, 6), np.nan))


@needs_opengl
def test_pictures_in_threads_are_the_same(plant):
    pictures = []
    threads = [
        threading.Thread(target=lambda: pictures.append(plant.render(size=SMALL))) for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(pictures) == 3
    for picture in pictures:
        np.testing.assert_array_equal(picture, pictures[0])


@needs_opengl
def test_film_of_an_assessment(plant, done, tmp_path):
    path = tmp_path / "elbow.mp4"
    assert exo.film(plant, done, path, rate_hz=3, size=SMALL, samples=1) == 18
    assert path.stat().st_size > 2000
    # A film twice as fast has half the pictures; a record is as good as its assessment.
    assert exo.film(plant, done.record, path, rate_hz=3, speed=2, size=SMALL, samples=1) == 9
    with pytest.raises(ArgumentError, match="theta_shoulder_flexion or q_shoulder_flexion"):
        exo.film(exo.exoskeleton(coupling="arm_only"), done, path, size=SMALL)
    with pytest.raises(ArgumentError, match="rate_hz"):
        exo.film(plant, done, path, rate_hz=0)
    with pytest.raises(ArgumentError, match="no record"):
        exo.film(plant, None, path)


def test_a_film_that_breaks_off_is_taken_away(tmp_path):
    path = tmp_path / "broken.mp4"
    grey = np.full((48, 64, 3), 90, dtype=np.uint8)
    with pytest.raises(ArgumentError, match="64 x 48 pixels, this one has 32 x 48"):
        with exo.Video(path, size=(64, 48)) as film:
            film.add(grey)
            film.add(grey[:, :32])
    assert not path.exists()
    with exo.Video(path, size=(64, 48), rate_hz=10) as film:
        for _ in range(5):
            film.add(grey)
    assert film.frames == 5 and path.stat().st_size > 300
    with pytest.raises(ArgumentError, match="closed"):
        film.add(grey)
    film.close()


def test_files_that_cannot_be_say_why(tmp_path):
    grey = np.full((16, 16, 3), 90, dtype=np.uint8)
    with pytest.raises(ArgumentError, match="must end with .png"):
        exo.write_png(tmp_path / "a.gif", grey)
    with pytest.raises(FileError, match="no folder"):
        exo.write_png(tmp_path / "no" / "a.png", grey)
    for wrong in (grey.astype(float), grey[..., 0], grey[:0]):
        with pytest.raises(ArgumentError, match="array of uint8"):
            exo.write_png(tmp_path / "a.png", wrong)
    with pytest.raises(ArgumentError, match="even"):
        exo.Video(tmp_path / "a.mp4", size=(15, 16))
    with pytest.raises(ArgumentError, match="must end with .mp4"):
        exo.Video(tmp_path / "a.avi", size=(16, 16))
    with pytest.raises(ArgumentError, match="two positive whole numbers"):
        exo.Video(tmp_path / "a.mp4", size=(16, 0))
    with pytest.raises(ArgumentError, match="pictures a second"):
        exo.Video(tmp_path / "a.mp4", size=(16, 16), rate_hz=float("nan"))


@pytest.mark.parametrize(
    ("look", "words"),
    [
        ({"size": (0, 10)}, "two positive whole numbers"),
        ({"size": (8, 8)}, "between 16 and 7680"),
        ({"size": (1e9, 2)}, "two positive whole numbers"),
        ({"samples": 9}, "samples must be between 1 and 4"),
        ({"samples": 0}, "samples is 0"),
        (
            {"camera": "nowhere"},
            "there is no camera 'nowhere'; the names are: device, side",
        ),
        ({"distance_m": -1.0}, "distance_m is -1.0"),
        ({"distance_m": float("nan")}, "distance_m is nan"),
        ({"distance_m": 1e6}, "distance must be between"),
        ({"azimuth_rad": 0.0}, "needs azimuth_rad and elevation_rad"),
        ({"azimuth_rad": float("nan"), "elevation_rad": 0.0}, "two finite numbers"),
        ({"azimuth_rad": 0.0, "elevation_rad": 3.0}, "right angle"),
        ({"look_at_m": [0.0, 1.0]}, "three finite numbers"),
        ({"look_at_m": [0.0, 1.0, float("inf")]}, "three finite numbers"),
        ({"force_scale_m_n": -1.0}, "0 or more"),
        ({"backend": "vulkan"}, "one of any, egl, osmesa"),
    ],
)
def test_looks_that_cannot_be_say_why(plant, look, words):
    # These are refused before OpenGL is looked for.
    with pytest.raises(ArgumentError, match=words):
        plant.render(**{"size": SMALL, **look})


@needs_opengl
def test_shapes_that_cannot_be_say_why(plant):
    renderer, run = exo.Renderer(plant, size=SMALL), plant.run()
    good = exo.spheres([0, 0, 0])[0]
    for place, value, words in (
        (0, 7, "kind of a shape"),
        (0, 0.5, "kind of a shape"),
        (7, 0.0, "radius of a shape"),
        (8, 2.0, "between 0 and 1"),
        (2, np.nan, "holds NaN"),
    ):
        bad = good.copy()
        bad[place] = value
        with pytest.raises(Error, match=words):
            renderer.draw(run, bad[None])
    with pytest.raises(ArgumentError, match="12 are expected"):
        renderer.draw(run, np.zeros((1, 5)))
    with pytest.raises(ArgumentError, match="another scene"):
        renderer.draw(exo.exoskeleton(coupling="exo_only").run())
    with pytest.raises(ArgumentError, match="no soft interfaces"):
        renderer.draw(run, forces=np.zeros((2, 6)))
    with pytest.raises(ArgumentError, match="force for each point"):
        exo.arrows([0, 0, 0], [[0, 0, 1], [0, 0, 2]])
    with pytest.raises(ArgumentError, match="must end with .png"):
        plant.render(path="picture.jpg", size=SMALL)


@needs_opengl
def test_buffers_that_are_too_small_are_refused(plant):
    renderer, run = exo.Renderer(plant, size=(16, 16)), plant.run()
    count = ffi.new("int64_t *")
    call = lib.ulna_renderer_draw
    handles = renderer._handle.pointer, run._handle.pointer, ffi.NULL, ffi.NULL
    assert call(*handles, ffi.NULL, 0, count) == lib.ULNA_OK and count[0] == 768
    buffer = ffi.new("char[]", 768)
    assert call(*handles, buffer, 767, count) == lib.ULNA_ERROR_BUFFER
    assert call(*handles, ffi.NULL, 768, count) == lib.ULNA_ERROR_ARGUMENT
    assert call(*handles, buffer, 768, count) == lib.ULNA_OK
    assert bytes(ffi.buffer(buffer)).count(0) < 768


# Figures -----------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


def test_figure_of_an_assessment_has_its_curves(done):
    left, middle, right = done.plot()[0]
    record = done.record
    np.testing.assert_allclose(left.lines[0].get_ydata(), np.degrees(record["theta_J4"]))
    drawn = {line.get_label(): line.get_ydata() for line in middle.lines}
    np.testing.assert_allclose(drawn["motor"], record["tau_motor_J4"])
    np.testing.assert_allclose(drawn["arm, nominal"], record["tau_hum_J4"])
    # The line of the stiffness goes through what is left of the torque without damping.
    less = next(line for line in right.lines if line.get_label() == "less damping")
    found = done.joints[0]
    line = found.offset - found.k * np.radians(less.get_xdata())
    assert abs(np.mean(less.get_ydata() - line)) < 1e-6
    assert f"{found.k:.2f}" in right.texts[0].get_text()
    with pytest.raises(ArgumentError, match="no joint 'J9'"):
        done.plot(joint="J9")
    with pytest.raises(ArgumentError, match="1 x 3"):
        done.plot(plt.subplots(1, 2)[1])


def test_figure_of_an_assessment_that_failed(plant):
    failed = exo.mobilise(plant, exo.Protocol(torque="held", rate_limit_rad_s=0.05))
    if failed.record is None:
        with pytest.raises(ArgumentError, match="did not begin"):
            failed.plot()
    else:
        assert failed.status in failed.plot()[0, 2].texts[0].get_text()


def test_figure_of_compressions():
    tests = [exo.compression_test({"stiffness_n_m": k}) for k in (100.5, 974.43)]
    left, middle, right = plot.compression(tests, labels=["soft", "stiff"])[0]
    np.testing.assert_allclose(left.lines[0].get_xdata(), 80 * tests[0].strain)
    np.testing.assert_allclose(middle.lines[1].get_ydata(), tests[1].stress_pa / 1e3)
    np.testing.assert_allclose(right.lines[1].get_ydata(), tests[1].modulus_pa / 1e3)
    assert [text.get_text() for text in left.get_legend().get_texts()] == [
        "soft",
        "stiff",
    ]
    # The area that stress knows and the width that strain knows are of one tissue: the published
    # one is 160 mm long.
    upper = exo.compression_test({"cuffs": "published"}, largest_strain=0.1)
    np.testing.assert_allclose(upper.force_n / upper.stress_pa, 0.16 * upper.width_m)
    fore = exo.compression_test({"cuffs": "published"}, limb="fore", largest_strain=0.1)
    np.testing.assert_allclose(fore.force_n / fore.stress_pa, 0.16 * fore.width_m)
    assert fore.plot().shape == (1, 3)
    with pytest.raises(ArgumentError, match="2 tests need as many labels"):
        plot.compression(tests, labels=["soft"])
    with pytest.raises(ArgumentError, match="no compression test"):
        plot.compression([])


def test_scheme_has_its_blocks():
    words = {text.get_text() for text in plot.assessment_scheme()[0, 0].texts}
    assert {
        "Reference",
        "Controller",
        "Device and arm",
        "Nominal model",
        "Regression",
    } <= words
