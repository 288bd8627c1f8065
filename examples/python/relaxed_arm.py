"""A relaxed arm carried by a position-controlled robot, simulated with a known answer.

The closed loop is the one of Fig. 4.2a in M. Dyck's thesis (2013): a planar robot follows a
reference motion and carries a relaxed arm; the force sensor sits between robot and hand.

    robot    m_r x'' = Kp (x_ref - x) + Kd (x_ref' - x') + F_h
    arm      F_h     = d - [ M x'' + B x' + K (x - x0) ]

F_h is the force *by the human on the robot*. M, B, K are the matrices of participant P1 in
Table 3.2 of the thesis. d is a force the human produces without meaning to: slow drifts and
corrections below 5 Hz and physiological tremor between 8 and 12 Hz. The robot is soft enough
that d moves the hand, which is what misleads a plain least-squares fit. The reference knows
nothing of d, which is why instrumental variables are not misled.

Nothing is integrated numerically. The answer to the reference is a sum of sinusoids, written
down from the loop's frequency response; d is coloured noise of a linear filter, so loop and
filter together are one linear stochastic equation that is sampled exactly (C. F. Van Loan,
"Computing integrals involving the matrix exponential", 1978). Both parts are stationary from
the first sample, as in a recording that starts when the robot has been moving for a while.

Run it to write the recording that comes with the project, and its truth:

    python examples/python/relaxed_arm.py

Frame: origin at the shoulder, x to the right, y forward, in metres. Needs NumPy and SciPy.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import linalg, signal


@dataclass(frozen=True)
class Arm:
    """Endpoint impedance of an arm: M x'' + B x' + K (x - x0) = force of the robot on the hand."""

    m_kg: np.ndarray  # (2, 2) inertia
    b_ns_m: np.ndarray  # (2, 2) damping
    k_n_m: np.ndarray  # (2, 2) stiffness
    x0_m: np.ndarray  # (2,) rest position in the frame of the shoulder


P1 = Arm(  # participant P1, sinusoidal perturbations, Table 3.2
    m_kg=np.array([[1.33, -0.93], [-0.96, 1.89]]),
    b_ns_m=np.array([[5.75, -3.39], [-0.94, 10.60]]),
    k_n_m=np.array([[42.45, -34.38], [-23.02, 125.43]]),
    x0_m=np.array([-0.003, 0.529]),
)

TEST_LOCATION_M = np.array([0.0, 0.52])  # the reference moves about this point
RATE_HZ = 1000
DURATION_S = 50.0

ENCODER_STEP_M = 2e-6  # 0.002 mm
FORCE_STEP_N = 1.0 / 24.0  # quantisation, and the standard deviation of the noise before it

ROBOT_MASS_KG = 1.1
ROBOT_STIFFNESS_N_M = 300.0
ROBOT_DAMPING_RATIO = 0.5  # of the robot carrying 1.6 kg, about half the arm's inertia

REFERENCE_PEAK_M = 0.02  # of each axis
LINES_PER_AXIS = 10
BAND_HZ = 3.0  # ten bands of 0.3 Hz; each axis gets one sinusoid in each
GRID_HZ = 0.1  # every sinusoid is a multiple of this, so the reference repeats every 10 s

TREMOR_N = 1.0  # rms of d on each axis, all frequencies
SLOW_HZ = 4.5  # corner of the slow part
PHYSIOLOGICAL_HZ = (8.0, 12.0)
PHYSIOLOGICAL_SHARE = 0.4  # rms of the 8-12 Hz part over the rms of d

# A typical draw. How often intervals hold the truth is measured on other seeds.
BUNDLED_SEED = 8
DATA = Path(__file__).resolve().parent.parent / "data"


@dataclass(frozen=True)
class Recordings:
    """What the sensors logged in `repetitions` runs of one experiment."""

    time_s: np.ndarray  # (samples,)
    position_m: np.ndarray  # (repetitions, samples, 2) hand, frame of the shoulder
    force_n: np.ndarray  # (repetitions, samples, 2) by the human on the robot
    reference_m: np.ndarray  # (repetitions, samples, 2) commanded position


def simulate(
    *,
    seed: int = BUNDLED_SEED,
    repetitions: int = 1,
    tremor_n: float = TREMOR_N,
    stiffness_n_m: float = ROBOT_STIFFNESS_N_M,
    peak_m: float = REFERENCE_PEAK_M,
    duration_s: float = DURATION_S,
    sensors: bool = True,
    arm: Arm = P1,
) -> Recordings:
    """Record the relaxed arm, once or many times, each time with its own reference and tremor.

    Parameters
    ----------
    seed
        Any integer from 0. Repetition `i` depends on (seed, i) only, not on how many are asked for.
    repetitions
        How many recordings; 50 s of one take 2.4 MB.
    tremor_n
        Root mean square of the force the human adds on each axis; 0 for an arm that is dead weight.
    stiffness_n_m
        Position gain of the robot. A stiff robot hides the tremor from the motion.
    peak_m
        Largest excursion of the reference on each axis.
    duration_s
        Length of a recording.
    sensors
        False leaves encoder steps, force noise and force steps away.
    arm
        The truth.
    """
    samples = int(round(duration_s * RATE_HZ))
    rngs = [np.random.default_rng([seed, i]) for i in range(repetitions)]
    damping = 2 * ROBOT_DAMPING_RATIO * np.sqrt(stiffness_n_m * (ROBOT_MASS_KG + 1.6))

    reference, position, force = _answer_to_reference(
        rngs, samples, peak_m, stiffness_n_m, damping, arm
    )
    if tremor_n > 0:
        _add_answer_to_tremor(rngs, position, force, tremor_n, stiffness_n_m, damping, arm)

    # Where the loop settles under the arm's own pull: (Kp I + K) offset = K (x0 - test location).
    pull = arm.k_n_m @ (arm.x0_m - TEST_LOCATION_M)
    offset = np.linalg.solve(stiffness_n_m * np.eye(2) + arm.k_n_m, pull)
    position += TEST_LOCATION_M + offset
    force += stiffness_n_m * offset
    reference += TEST_LOCATION_M

    if sensors:
        for i, rng in enumerate(rngs):
            force[i] += FORCE_STEP_N * rng.standard_normal(force[i].shape)
        for values, step in ((position, ENCODER_STEP_M), (force, FORCE_STEP_N)):
            values /= step
            np.rint(values, out=values)
            values *= step
    return Recordings(np.arange(samples) / RATE_HZ, position, force, reference)


def _answer_to_reference(rngs, samples, peak_m, stiffness, damping, arm):
    """Steady-state motion and force under the multisine, without its constant part."""
    period = int(round(RATE_HZ / GRID_HZ))
    bins = int(round(BAND_HZ / GRID_HZ))
    frequency = GRID_HZ * np.arange(1, bins + 1)
    waves = np.exp(2j * np.pi * np.outer(np.arange(period) / RATE_HZ, frequency))
    lines = np.stack([_draw_lines(rng, waves, peak_m) for rng in rngs])  # (runs, bins, axis)

    s = (2j * np.pi * frequency)[:, None, None]
    eye = np.eye(2)
    z_arm = arm.m_kg * s**2 + arm.b_ns_m * s + arm.k_n_m  # force over position
    z_robot = (stiffness + damping * s) * eye
    motion = np.linalg.solve(z_arm + ROBOT_MASS_KG * s**2 * eye + z_robot, z_robot)
    moved = np.einsum("fij,rfj->rfi", motion, lines)
    pushed = -np.einsum("fij,rfj->rfi", z_arm, moved)

    def in_time(amplitudes):
        one = np.matmul(waves, amplitudes).real  # (runs, period, axis)
        repeats = -(-samples // period)
        return np.tile(one, (1, repeats, 1))[:, :samples].copy()

    return in_time(lines), in_time(moved), in_time(pushed)


def _draw_lines(rng, waves, peak_m, tries=100):
    """Complex amplitudes (bins, axis) of one reference.

    The axes never share a frequency, so each is excited independently. Amplitudes rise gently
    with frequency, so that the arm's own force stands out of the tremor. Of `tries` sets of random
    phases the one with the lowest peak is taken: more motion inside the same circle.
    """
    bins = waves.shape[1]
    per_band = bins // LINES_PER_AXIS
    picks = np.array([rng.permutation(per_band)[:2] for _ in range(LINES_PER_AXIS)])
    picks += per_band * np.arange(LINES_PER_AXIS)[:, None]
    lines = np.zeros((bins, 2), complex)
    for axis in range(2):
        own = picks[:, axis]
        trial = np.exp(2j * np.pi * rng.random((LINES_PER_AXIS, tries)))
        trial *= ((own + 1.0) ** 0.5)[:, None]
        peaks = np.abs((waves[::20, own] @ trial).real).max(axis=0)
        best = trial[:, np.argmin(peaks)]
        lines[own, axis] = best * peak_m / np.abs((waves[:, own] @ best).real).max()
    return lines


def _add_answer_to_tremor(rngs, position, force, tremor_n, stiffness, damping, arm):
    """Add what d does to motion and force: one exact step of the stochastic equation per sample."""
    a_noise, g_noise, c_noise = _tremor_filter(tremor_n)
    order = a_noise.shape[0]
    inverse = np.linalg.inv(arm.m_kg + ROBOT_MASS_KG * np.eye(2))
    a = np.zeros((4 + order, 4 + order))  # state: position, velocity, filter
    a[:2, 2:4] = np.eye(2)
    a[2:4, :2] = -inverse @ (arm.k_n_m + stiffness * np.eye(2))
    a[2:4, 2:4] = -inverse @ (arm.b_ns_m + damping * np.eye(2))
    a[2:4, 4:] = inverse @ c_noise
    a[4:, 4:] = a_noise
    g = np.vstack([np.zeros((4, g_noise.shape[1])), g_noise])

    step, noise_root = _sampled(a, g, 1.0 / RATE_HZ)
    start_root = _root(linalg.solve_continuous_lyapunov(a, -g @ g.T))
    # F_h = d - (M x'' + B x' + K x), with x'' read off the equation of motion.
    to_force = -arm.m_kg @ a[2:4]
    to_force[:, :2] -= arm.k_n_m
    to_force[:, 2:4] -= arm.b_ns_m
    to_force[:, 4:] += c_noise

    runs, samples = position.shape[:2]
    state = np.stack([start_root @ rng.standard_normal(start_root.shape[1]) for rng in rngs])
    block = 1000
    for begin in range(0, samples, block):
        count = min(block, samples - begin)
        white = np.stack([rng.standard_normal((block, noise_root.shape[1])) for rng in rngs], 1)
        kicks = white[:count] @ noise_root.T
        states = np.empty((count, runs, state.shape[1]))
        for i in range(count):
            states[i] = state
            state = state @ step.T + kicks[i]
        position[:, begin : begin + count] += states[:, :, :2].transpose(1, 0, 2)
        force[:, begin : begin + count] += (states @ to_force.T).transpose(1, 0, 2)


def _tremor_filter(tremor_n):
    """State-space filter from white noise to d on both axes: a, g, c with d = c z.

    Corner frequencies are normalised before the filter becomes a matrix, which keeps its
    entries near one.
    """
    low, high = (2 * np.pi * f for f in PHYSIOLOGICAL_HZ)
    centre = np.sqrt(low * high)
    parts = (
        (signal.butter(4, 1.0, analog=True), 2 * np.pi * SLOW_HZ,
         tremor_n * np.sqrt(1 - PHYSIOLOGICAL_SHARE**2)),
        (signal.butter(2, [low / centre, high / centre], "bandpass", analog=True), centre,
         tremor_n * PHYSIOLOGICAL_SHARE),
    )  # fmt: skip
    a_list, g_list, c_list = [], [], []
    for (numerator, denominator), omega, rms in parts:
        a, b, c, _ = signal.tf2ss(numerator, denominator)
        a, b = a * omega, b * np.sqrt(omega)
        power = c @ linalg.solve_continuous_lyapunov(a, -b @ b.T) @ c.T
        for _ in range(2):  # two independent axes
            a_list.append(a)
            g_list.append(b)
            c_list.append(c * rms / np.sqrt(power))
    c_all = linalg.block_diag(*c_list)
    return linalg.block_diag(*a_list), linalg.block_diag(*g_list), c_all[:2] + c_all[2:]


def _sampled(a, g, dt):
    """Transition matrix and a root of the noise covariance of one step (Van Loan)."""
    n = a.shape[0]
    big = linalg.expm(np.block([[-a, g @ g.T], [np.zeros((n, n)), a.T]]) * dt)
    step = big[n:, n:].T
    return step, _root(step @ big[:n, n:])


def _root(covariance):
    """R with R R' = covariance; directions below rounding error are dropped."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    keep = values > 1e-15 * values[-1]
    return vectors[:, keep] * np.sqrt(values[keep])


def write_bundled(folder: Path = DATA, *, seed: int = BUNDLED_SEED) -> tuple[Path, Path]:
    """Write relaxed-arm.csv and relaxed-arm-truth.json and return their paths."""
    run = simulate(seed=seed)
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "relaxed-arm.csv"
    columns = np.column_stack(
        [run.time_s, run.position_m[0], run.force_n[0], run.reference_m[0]]
    )
    np.savetxt(
        table,
        columns,
        # 1 um and 1 mN: finer than the steps of the sensors.
        fmt=["%.3f", "%.6f", "%.6f", "%.3f", "%.3f", "%.6f", "%.6f"],
        delimiter=",",
        header="time_s,x_m,y_m,F_x_N,F_y_N,x_ref_m,y_ref_m",
        comments="",
    )
    truth = folder / "relaxed-arm-truth.json"
    truth.write_text(json.dumps(_truth(seed), indent=2) + "\n")
    return table, truth


def _truth(seed):
    return {
        "about": "Simulated relaxed arm, 50 s at 1 kHz; the arm is participant P1 of Table 3.2, "
        "M. Dyck, 2013 (sinusoidal perturbations).",
        "command": "python examples/python/relaxed_arm.py",
        "seed": seed,
        "M": P1.m_kg.tolist(),
        "B": P1.b_ns_m.tolist(),
        "K": P1.k_n_m.tolist(),
        "x0": P1.x0_m.tolist(),
        "units": {"M": "kg", "B": "N s/m", "K": "N/m", "x0": "m"},
        "model": "M x'' + B x' + K (x - x0) = d - F",
        "conventions": {
            "frame": "origin at the shoulder, x to the right, y forward",
            "force": "F is the force by the human on the robot",
            "matrices": "rows are force axes, columns are motion axes, order x, y",
        },
        "reference": {
            "centre_m": TEST_LOCATION_M.tolist(),
            "peak_m": REFERENCE_PEAK_M,
            "lines_per_axis": LINES_PER_AXIS,
            "band_hz": BAND_HZ,
            "grid_hz": GRID_HZ,
        },
        "robot": {
            "mass_kg": ROBOT_MASS_KG,
            "stiffness_n_m": ROBOT_STIFFNESS_N_M,
            "damping_ratio": ROBOT_DAMPING_RATIO,
        },
        "tremor": {
            "rms_n": TREMOR_N,
            "slow_corner_hz": SLOW_HZ,
            "physiological_hz": list(PHYSIOLOGICAL_HZ),
            "physiological_share": PHYSIOLOGICAL_SHARE,
        },
        "sensors": {"encoder_step_m": ENCODER_STEP_M, "force_step_and_noise_n": FORCE_STEP_N},
    }


def main(arguments: list[str] | None = None) -> int:
    """Write the bundled recording."""
    parser = argparse.ArgumentParser(
        description="Write the bundled recording of a relaxed arm and its truth.",
        epilog="example: python examples/python/relaxed_arm.py --out /tmp --seed 5",
    )
    parser.add_argument("--out", type=Path, default=DATA, help="folder (default: examples/data)")
    parser.add_argument("--seed", type=int, default=BUNDLED_SEED, help="default: %(default)s")
    options = parser.parse_args(arguments)
    for path in write_bundled(options.out, seed=options.seed):
        print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
