"""Impedance at the joints: finite differences of torques, the way back, singular postures."""

import numpy as np
import pytest

import ulna
from ulna.joint import Arm, angles_of_markers, from_endpoint, to_endpoint, to_joints

ARM = Arm(upper_arm_m=0.31, forearm_m=0.34, shoulder_m=(-0.1, -0.2))
POSTURE = np.array([0.7, 1.3])
M = np.array([[1.3, 0.2], [0.2, 1.8]])
B = np.array([[8.0, -1.0], [-1.0, 12.0]])
K = np.array([[120.0, -40.0], [-40.0, 300.0]])
FORCE = np.array([6.0, -9.0])


def covariance(seed=0):
    root = np.random.default_rng(seed).normal(size=(12, 12))
    return root @ root.T * 1e-3


def test_the_jacobian_and_its_slope_are_derivatives():
    step = 1e-6
    jacobian, slope = ARM.jacobian(POSTURE), ARM.jacobian_slope(POSTURE)
    for k in range(2):
        up, down = POSTURE + step * np.eye(2)[k], POSTURE - step * np.eye(2)[k]
        assert np.allclose((ARM.hand(up) - ARM.hand(down)) / (2 * step), jacobian[:, k], atol=1e-9)
        assert np.allclose(
            (ARM.jacobian(up) - ARM.jacobian(down)) / (2 * step), slope[k], atol=1e-9
        )
    assert np.allclose(ARM.angles(ARM.hand(POSTURE)), POSTURE)


@pytest.mark.parametrize("left", [False, True])
def test_the_elbow_bends_to_its_side(left):
    arm = Arm(left=left)
    hand = np.array([[0.0, 0.45], [0.3, 0.2], [-0.4, 0.1]])
    angles = arm.angles(hand)
    assert np.all(np.sign(angles[:, 1]) == (-1 if left else 1))
    assert np.allclose(arm.hand(angles), hand)


def test_stiffness_is_minus_the_derivative_of_the_torque():
    """tau(q) = J(q)' F(x(q)), with F = F0 - K (x - x0): differences of torques, no formula."""
    z = from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE, force_n=FORCE)
    x0 = ARM.hand(POSTURE)

    def torque(q):
        return ARM.jacobian(q).T @ (FORCE - K @ (ARM.hand(q) - x0))

    step = 1e-5
    for k in range(2):
        up, down = POSTURE + step * np.eye(2)[k], POSTURE - step * np.eye(2)[k]
        # Central differences of step 1e-5 err by 1e-10 and by rounding over the step.
        assert np.allclose(-(torque(up) - torque(down)) / (2 * step), z.K[:, k], atol=1e-6)
    assert np.allclose(z.K, z.K.T)
    assert np.allclose(z.gamma, z.gamma.T)


def test_inertia_and_damping_are_those_of_the_torque():
    z = from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE)
    jacobian = ARM.jacobian(POSTURE)
    rate = np.array([0.3, -0.7])
    assert np.allclose(z.B @ rate, jacobian.T @ (B @ (jacobian @ rate)))
    assert np.allclose(z.M @ rate, jacobian.T @ (M @ (jacobian @ rate)))


def test_there_and_back():
    z = from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE, force_n=FORCE, cov=covariance())
    back = to_endpoint(z)
    assert back.at == "hand"
    for name, value in (("M", M), ("B", B), ("K", K)):
        assert np.allclose(getattr(back, name), value, rtol=1e-10)
    assert np.allclose(back.cov, covariance(), rtol=1e-8, atol=1e-12)


def test_any_other_arm_by_its_jacobian():
    """Three joints in the plane: one torque for each, and no way back."""
    jacobian = np.array([[-0.3, -0.2, -0.05], [0.4, 0.25, 0.1]])
    q = np.array([0.3, 0.8, 0.5])
    lengths = np.array([0.3, 0.25, 0.1])
    total = np.cumsum(q)

    def make(angles):
        sums = np.cumsum(angles)
        return np.array(
            [
                [-np.sum((lengths * np.sin(sums))[k:]) for k in range(3)],
                [np.sum((lengths * np.cos(sums))[k:]) for k in range(3)],
            ]
        )

    jacobian = make(q)
    step = 1e-6
    slope = np.array(
        [
            (make(q + step * np.eye(3)[k]) - make(q - step * np.eye(3)[k])) / (2 * step)
            for k in range(3)
        ]
    )
    z = from_endpoint((M, B, K), jacobian=jacobian, jacobian_slope=slope, force_n=FORCE)
    assert z.K.shape == (3, 3)
    assert np.allclose(z.K, z.K.T, atol=1e-7)  # differences of step 1e-6
    hessian = -sum(
        f
        * np.array(
            [[np.sum((lengths * trig(total))[max(i, k) :]) for k in range(3)] for i in range(3)]
        )
        for f, trig in zip(FORCE, (np.cos, np.sin), strict=True)
    )
    assert np.allclose(z.gamma, hessian, atol=1e-7)
    with pytest.raises(ulna.AnalysisError, match="cannot be inverted"):
        to_endpoint(z)


def test_covariance_is_that_of_draws():
    cov = covariance(3)
    force_cov = np.array([[0.04, 0.01], [0.01, 0.09]])
    z = from_endpoint(
        (M, B, K), arm=ARM, angles_rad=POSTURE, force_n=FORCE, force_cov=force_cov, cov=cov
    )
    rng = np.random.default_rng(1)
    mean = np.concatenate([M.ravel(), B.ravel(), K.ravel()])
    draws = rng.multivariate_normal(mean, cov, size=4000)
    forces = rng.multivariate_normal(FORCE, force_cov, size=4000)
    values = []
    for draw, force in zip(draws, forces, strict=True):
        one = from_endpoint(draw.reshape(3, 2, 2), arm=ARM, angles_rad=POSTURE, force_n=force)
        values.append(np.concatenate([one.M.ravel(), one.B.ravel(), one.K.ravel()]))
    sampled = np.cov(np.array(values).T)
    # 4000 draws leave 2 % of a standard deviation squared: five of those.
    scale = np.sqrt(np.outer(np.diag(z.cov), np.diag(z.cov)))
    assert np.abs((sampled - z.cov) / scale).max() < 0.12
    margins = z.passivity(draws=2000)
    assert margins.probability == 1.0
    assert margins.k_interval[0] < margins.k_min < margins.k_interval[1]


def test_a_pulling_force_makes_a_compliant_posture_unstable():
    """A pushing load on a slack arm: the posture buckles although the hand is passive."""
    soft = K / 100
    angles = np.array([0.3, 0.6])
    calm = from_endpoint((M, B, soft), arm=ARM, angles_rad=angles)
    assert calm.passivity().k_min > 0 and calm.passivity().probability == 1.0
    reach = ARM.hand(angles) - np.array(ARM.shoulder_m)
    # The human presses inwards (towards the shoulder) or outwards: one of both buckles.
    loads = [
        from_endpoint((M, B, soft), arm=ARM, angles_rad=angles, force_n=s * 30 * reach)
        for s in (1, -1)
    ]
    signs = [z.passivity().k_min > 0 for z in loads]
    assert signs.count(False) >= 1
    assert np.allclose([z.K - z.K.T for z in loads], 0, atol=1e-12)
    assert [z.passivity().probability for z in loads] == [float(s) for s in signs]


def test_a_record_at_the_joints_gives_the_joint_impedance():
    """Small motions about a posture: identified there and carried there agree."""
    rng = np.random.default_rng(2)
    t = np.arange(40000) / 1000
    omega = 2 * np.pi * rng.uniform(0.2, 3.0, (2, 12))
    phase = rng.uniform(0, 2 * np.pi, (2, 12))
    amplitude = 4e-4
    angle = omega[:, :, None] * t + phase[:, :, None]
    centre = ARM.hand(POSTURE)
    x = centre + amplitude * np.sin(angle).sum(axis=1).T
    v = amplitude * (omega[:, :, None] * np.cos(angle)).sum(axis=1).T
    a = -amplitude * (omega[:, :, None] ** 2 * np.sin(angle)).sum(axis=1).T
    force = FORCE - (a @ M.T + v @ B.T + (x - centre) @ K.T)
    log = ulna.Record.from_arrays(
        t, {"x": x[:, 0], "y": x[:, 1], "F_x": force[:, 0], "F_y": force[:, 1]}
    )
    joints = to_joints(log, arm=ARM)
    assert [c.unit for c in joints.channels] == ["rad", "rad", "Nm", "Nm"]
    est = ulna.identify_impedance(joints, estimator="ls")
    z = from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE, force_n=FORCE)
    for name in "MBK":
        wanted = getattr(z, name)
        # The posture changes by a hundredth of a radian, and the Jacobian with it.
        assert np.allclose(getattr(est, name), wanted, atol=0.02 * np.abs(wanted).max()), name
    assert est.passivity().verdict == "passive"
    # Measured angles give the same.
    again = to_joints(log, arm=ARM, angles_rad=ARM.angles(x))
    assert np.array_equal(again.values, joints.values)


def test_angles_of_markers():
    q = np.column_stack([np.linspace(0, 7, 200), np.linspace(0.3, 2.0, 200)])
    shoulder = np.tile(ARM.shoulder_m, (200, 1))
    elbow = shoulder + ARM.upper_arm_m * np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0])])
    assert np.allclose(angles_of_markers(shoulder, elbow, ARM.hand(q)), q)
    with pytest.raises(ulna.DataError, match="row 3"):
        broken = elbow.copy()
        broken[3] = np.nan
        angles_of_markers(shoulder, broken, ARM.hand(q))
    with pytest.raises(ulna.DataError, match="in one place at row 0"):
        angles_of_markers(shoulder, shoulder, ARM.hand(q))
    with pytest.raises(ulna.ArgumentError, match="as many rows"):
        angles_of_markers(shoulder[:5], elbow, ARM.hand(q))


def test_an_estimate_is_carried_with_its_uncertainty():
    est = ulna.identify_impedance(ulna.read("examples/data/relaxed-arm.csv"))
    arm = Arm()
    z = from_endpoint(est, arm=arm)
    position = est.signals().position.mean(axis=0)
    assert np.allclose(z.angles_rad, arm.angles(position))
    assert np.allclose(z.force_n, est.signals().force.mean(axis=0))
    assert np.all(z.se("K") > 0) and z.cov.shape == (12, 12)
    text = z.summary()
    assert max(map(len, text.split("\n"))) <= 80 and "posture" in text
    assert "±" in repr(z)
    pytest.importorskip("matplotlib").use("Agg")
    assert z.plot().shape == (1, 2)
    with pytest.raises(ulna.ArgumentError, match="at the joints of a planar arm"):
        to_endpoint(z).plot()


def test_singular_postures_are_refused_by_name():
    straight = np.array([0.5, 1e-9])
    z = from_endpoint((M, B, K), arm=ARM, angles_rad=straight)
    with pytest.raises(ulna.AnalysisError, match="singular") as caught:
        to_endpoint(z)
    assert "along (0.878, 0.479)" in str(caught.value) or "along (-0.878, -0.479)" in str(
        caught.value
    )
    t = np.arange(100) / 100
    names = {"x": 0.3 + 0 * t, "y": 0.1 * t, "F_x": t, "F_y": t}
    far = names | {"x": np.where(np.arange(100) == 40, 2.0, 0.3)}
    with pytest.raises(ulna.AnalysisError, match="row 40.*out of reach") as caught:
        to_joints(ulna.Record.from_arrays(t, far), arm=Arm())
    assert caught.value.detail == "row 40"
    edge = names | {"x": np.where(np.arange(100) == 7, 0.65 - 1e-9, 0.3), "y": 0 * t}
    with pytest.raises(ulna.AnalysisError, match="singular at row 7.*elbow"):
        to_joints(ulna.Record.from_arrays(t, edge), arm=Arm())
    with pytest.raises(ulna.DataError, match="row 5"):
        hole = names | {"F_y": np.where(np.arange(100) == 5, np.nan, 1.0)}
        to_joints(ulna.Record.from_arrays(t, hole), arm=Arm())


def test_refused_input():
    for call in (
        lambda: Arm(upper_arm_m=0.0),
        lambda: Arm(forearm_m=float("nan")),
        lambda: Arm(shoulder_m=(1, 2, 3)),
        lambda: Arm(shoulder_m=(float("nan"), 0.0)).hand(POSTURE),
        lambda: ARM.hand([1, 2, 3]),
        lambda: ARM.jacobian([1, 2, 3]),
        lambda: ARM.jacobian([np.nan, 0]),
        lambda: from_endpoint((M, B, K)),
        lambda: from_endpoint((M, B), arm=ARM, angles_rad=POSTURE),
        lambda: from_endpoint((M, B, K), arm=ARM),
        lambda: from_endpoint((M, B, K), arm=ARM, jacobian=np.eye(2), angles_rad=POSTURE),
        lambda: from_endpoint((M, B, K), jacobian=np.eye(2)),
        lambda: from_endpoint((M, B, K), jacobian=np.eye(2), jacobian_slope=np.zeros((1, 2, 2))),
        lambda: from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE, force_n=[1, 2, 3]),
        lambda: from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE, cov=np.eye(5)),
        lambda: from_endpoint(
            (M, B, K), arm=ARM, angles_rad=POSTURE, force_cov=np.eye(3), cov=np.eye(12)
        ),
        lambda: from_endpoint((M, B, K * np.nan), arm=ARM, angles_rad=POSTURE),
        lambda: from_endpoint((np.eye(3), B, K), arm=ARM, angles_rad=POSTURE),
        lambda: to_endpoint(to_endpoint(from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE))),
        lambda: from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE).se("x0"),
        lambda: from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE).passivity(level=1.0),
        lambda: from_endpoint((M, B, K), arm=ARM, angles_rad=POSTURE).passivity(draws=3),
        lambda: to_joints(np.eye(2), arm=ARM),
        lambda: to_joints(ulna.Record.from_arrays([0, 1], {"x": [0, 1]}), arm="left"),
    ):
        with pytest.raises(ulna.ArgumentError):
            call()
    # A slope that is no derivative of any Jacobian.
    with pytest.raises(ulna.ArgumentError, match="derivatives are of no Jacobian"):
        from_endpoint((M, B, K), jacobian=np.eye(2), jacobian_slope=np.arange(8.0).reshape(2, 2, 2))
