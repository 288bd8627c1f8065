"""Published tables of Dyck (2013), "Measuring the dynamic impedance of the human arm", as numbers.

Facts to compare with and parameters to simulate; SI units, matrices as in the thesis (rows are axes
of force). Stiffness is printed there in Ns/m and means N/m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class PublishedArm:
    """One row of Tables 3.2, 3.4, 4.1, 4.2 or 5.6.

    Attributes
    ----------
    table, row : str
        Where it stands: "3.2", "P1".
    m, b, k : ndarray, shape (2, 2)
        kg, N s/m, N/m.
    x0_m : ndarray, shape (2,)
        Equilibrium, m.
    vaf : ndarray, shape (2,)
        Percent, along x and y.
    passive : bool or None
        The thesis' verdict by its Theorem 3.2; None where it gives none.
    """

    table: str
    row: str
    m: np.ndarray
    b: np.ndarray
    k: np.ndarray
    x0_m: np.ndarray
    vaf: np.ndarray
    passive: bool | None


# row: m_xx m_xy m_yx m_yy, b.., k.., x0 y0 (mm), VAF_x VAF_y
_ARMS = {
    "3.2": {  # relaxed, sinusoidal perturbations
        "P1": (1.33, -0.93, -0.96, 1.89, 5.75, -3.39, -0.94, 10.60, 42.45, -34.38, -23.02, 125.43,
               -3, 529, 98.7, 96.2),
        "P2": (1.30, -0.76, -0.85, 1.36, 5.77, -3.69, -1.49, 9.12, 45.14, -33.40, -35.25, 112.49,
               9, 537, 97.2, 92.7),
        "P3": (1.53, -0.91, -0.99, 1.71, 6.02, -4.27, -2.40, 10.47, 39.52, -30.34, -26.10, 108.60,
               -6, 522, 98.8, 97.4),
        "P4": (1.42, -1.01, -1.05, 1.88, 4.75, -3.81, -2.59, 9.61, 36.61, -43.45, -42.97, 151.45,
               -6, 529, 98.7, 97.5),
        "P5": (1.27, -0.91, -0.98, 2.07, 4.81, -3.19, -1.83, 11.89, 38.98, -25.03, -31.46, 164.95,
               -11, 522, 99.1, 98.3),
        "P6": (1.11, -0.74, -0.81, 1.67, 3.16, -1.96, -0.67, 8.23, 22.64, -17.28, -30.26, 93.75,
               -11, 518, 98.5, 96.8),
    },
    "3.4": {  # relaxed, underdamped perturbations
        "P1": (1.06, -0.78, -1.07, 1.68, 8.80, -3.77, 1.56, 14.08, 36.63, -34.68, -29.08, 140.94,
               -11, 522, 87.9, 92.2),
        "P4": (1.43, -0.88, -0.94, 1.38, 6.02, -4.97, -2.24, 10.88, 45.58, -45.78, -46.03, 123.01,
               -17, 473, 93.9, 88.6),
    },
    "4.1": {  # rigid, underdamped perturbations
        "P1": (2.04, -1.90, -1.16, 1.97, -9.06, 1.09, 2.34, -0.82, 404.30, -250.17, -125.00,
               504.17, -9, 520, 35.2, 20.1),
        "P2": (1.42, -1.57, -0.47, 0.23, -8.79, 2.70, 0.23, -2.07, 255.12, -186.42, -16.34, 194.69,
               -5, 525, 47.4, 12.0),
        "P3": (0.24, -0.83, -0.37, -0.16, -7.81, 1.14, 0.83, -2.99, 92.38, -52.56, -0.99, 87.96,
               -13, 524, 18.0, 8.6),
        "P4": (1.45, -1.52, -0.56, 1.25, -4.71, -0.83, -1.41, -4.64, 337.34, -90.18, -7.50, 677.19,
               -5, 461, 38.5, 27.3),
        "P5": (1.47, -1.60, 0.14, 2.60, -11.18, -8.38, -3.28, -0.10, 419.46, 3.70, 236.26, 1056.63,
               -11, 520, 29.7, 20.9),
        "P6": (1.13, -0.950, -0.38, 0.58, -9.06, 1.09, 1.42, -5.36, 82.95, -27.43, -15.58, 180.03,
               -3, 522, 45.8, 6.9),
    },
    "4.2": {  # rigid, sinusoidal perturbations
        "P1": (-0.10, -0.35, -0.90, -0.26, 13.01, -5.81, -2.93, 34.30, 195.97, 92.14, 20.81, 651.15,
               -9, 520, 73.6, 80.4),
        "P4": (-0.03, -0.53, -0.93, -0.57, 11.64, -8.97, -6.37, 26.12, 155.98, 79.86, 43.86, 482.11,
               -12, 520, 74.1, 62.9),
        "P6": (0.19, -0.59, -0.65, -1.37, 5.06, -1.52, -0.04, 31.28, 50.81, 3.98, 10.74, 214.47,
               -6, 519, 67.1, 73.8),
    },
    "5.6": {  # relaxed arm of P1 below the shoulder, two methods
        "Method 1": (1.42, 0.68, 0.69, 0.99, 14.26, 1.62, 1.08, 6.82, 90.97, 17.05, 25.92, 27.22,
                     383, 15, 90.9, 90.2),
        "Method 2": (1.45, 0.65, 0.68, 1.06, 10.88, 3.09, 2.75, 4.01, 72.34, 6.29, 16.12, 12.61,
                     382, 8, 91.3, 94.5),
    },
}  # fmt: skip
_PASSIVE = {"3.2": True, "3.4": True, "4.1": False, "4.2": False, "5.6": None}


def _arm(table: str, row: str) -> PublishedArm:
    numbers = np.array(_ARMS[table][row], dtype=float)
    return PublishedArm(
        table=table,
        row=row,
        m=numbers[0:4].reshape(2, 2),
        b=numbers[4:8].reshape(2, 2),
        k=numbers[8:12].reshape(2, 2),
        x0_m=numbers[12:14] * 1e-3,
        vaf=numbers[14:16],
        passive=_PASSIVE[table],
    )


def arms(table: str) -> dict[str, PublishedArm]:
    """The rows of a table of arms, by participant or method.

    Examples
    --------
    >>> sorted(arms("3.4"))
    ['P1', 'P4']
    """
    return {row: _arm(table, row) for row in _ARMS[table]}


# Tables 3.3 and 3.5: (A, R, theta in degrees) of inertia, damping and stiffness.
ELLIPSES = {
    "3.3": {
        "P1": ((5.1, 4.1, 126.7), (176.8, 2.3, 110.9), (14139.5, 4.0, 107.3)),
        "P2": ((3.5, 4.1, 134.0), (144.3, 2.4, 118.6), (12251.8, 4.1, 112.8)),
        "P3": ((5.4, 3.9, 132.3), (162.9, 2.9, 118.1), (10981.1, 4.0, 109.6)),
        "P4": ((5.1, 4.5, 128.6), (111.3, 3.5, 116.4), (11554.9, 7.5, 108.5)),
        "P5": ((5.5, 4.2, 123.5), (159.8, 3.2, 107.7), (17693.1, 5.2, 102.1)),
        "P6": ((3.9, 3.9, 125.1), (76.2, 3.0, 103.7), (4892.9, 6.5, 106.9)),
    },
    "3.5": {
        "P1": ((2.9, 5.9, 125.6), (385.7, 1.7, 101.4), (13026.4, 5.4, 105.7)),
        "P4": ((3.6, 4.6, 135.7), (165.0, 3.1, 118.0), (10994.4, 6.0, 114.9)),
    },
}

# Table 3.6: excess of passivity, N s/m. Key: table of the matrices, participant.
EXCESS = {
    ("3.2", "P1"): 5.7, ("3.2", "P2"): 5.3, ("3.2", "P3"): 6.1, ("3.2", "P4"): 5.6,
    ("3.2", "P5"): 6.3, ("3.2", "P6"): 4.3, ("3.4", "P1"): 7.2, ("3.4", "P4"): 6.4,
}  # fmt: skip

# Section 3.6.1.2 and Figure 3.12: antisymmetry of the stiffness of P1, and the bound for all.
ANTISYMMETRY_P1 = 0.115
ANTISYMMETRY_BOUND = 0.15

# Table 4.3: (task, approach) -> verdict with sinusoidal and with underdamped perturbations.
PASSIVITY_CELLS = {
    ("relaxed", "model"): ("passive", "passive"),
    ("relaxed", "energy"): ("passive", "passive"),
    ("rigid", "model"): ("not passive", "not passive"),
    ("rigid", "energy"): ("passive", "not passive"),
}

# Table 4.4: VAF (percent) of one-dimensional models of the rigid arm, five trials.
RIGID_VAF_1D = (43.6, 69.1, -2.9, 27.3, 70.1)
# Table 4.5: shortage of passivity of the rigid arm, N s/m.
SHORTAGE = {"P1": 8.6, "P2": 8.4, "P3": 6.5, "P4": 8.4, "P5": 15.4, "P6": 10.8}

# Tables 3.1 and 5.1: k_xx, k_yy, k_s (N/m), x0, y0 (mm) and masses (kg) of the mass-spring systems.
SPRINGS_31 = {
    "1": (443.86, 232.34, 16.74, 393, -55, 0.293),
    "2": (427.08, 273.83, 37.87, 407, 35, 0.539),
    "3": (310.43, 306.69, -101.75, 448, 61, 0.786),
    "4": (402.95, 262.68, -69.14, 418, -53, 1.031),
    "5": (260.70, 404.66, -73.49, 343, 29, 1.279),
    "6": (233.32, 464.70, -17.40, 420, -8, 1.527),
}
SPRINGS_51 = {
    "K1": (421.57, 213.35, -18.87, 364, -9),
    "K2": (476.38, 248.71, -16.02, 375, -8),
    "K3": (239.54, 421.29, -12.52, 394, 53),
    "K4": (190.26, 406.39, -2.08, 390, 36),
    "K5": (373.81, 377.10, 73.16, 332, -61),
}
MASSES_51 = {"M1": 0.539, "M2": 0.786, "M3": 1.031, "M4": 1.279, "M5": 1.527}
# Table 5.3: identified k_xx, k_yy, k_s by the virtual sensor (method 1) and the sensor (method 2).
STIFFNESS_53 = {
    "K1": ((504.43, 257.03, -14.77), (458.99, 236.74, -23.49)),
    "K2": ((569.98, 298.49, -5.22), (514.03, 281.98, -16.51)),
    "K3": ((311.49, 436.13, -2.12), (275.06, 429.85, -7.44)),
    "K4": ((276.37, 434.26, 10.5), (226.94, 415.37, -3.84)),
    "K5": ((447.33, 382.45, 76.96), (417.24, 372.37, 70.11)),
}
MASSES_53 = {
    "M1": (0.491, 0.544),
    "M2": (0.719, 0.773),
    "M3": (0.95, 1.005),
    "M4": (1.156, 1.235),
    "M5": (1.399, 1.471),
}
# Table 5.4: its "errors", which are theoretical minus identified.
STIFFNESS_54 = {
    "K1": ((-82.86, -43.68, -4.10), (-37.42, -23.39, 4.62)),
    "K2": ((-93.60, -49.78, -10.80), (-37.65, -33.27, 0.49)),
    "K3": ((-71.95, -14.84, -10.40), (-35.52, -8.56, -5.08)),
    "K4": ((-86.11, -27.87, -12.58), (-36.68, -8.98, 1.76)),
    "K5": ((-73.52, -5.35, -3.80), (-43.43, 4.73, 3.05)),
}
MASSES_54 = {
    "M1": (0.048, -0.005),
    "M2": (0.067, 0.013),
    "M3": (0.081, 0.026),
    "M4": (0.123, 0.044),
    "M5": (0.128, 0.056),
}
# Table 5.5: VAF along x and y by the virtual sensor.
VAF_55 = {
    "K1": ((97.5, 93.5), (97.5, 93.1), (97.5, 92.6), (97.4, 92.0), (97.2, 92.1)),
    "K2": ((97.4, 95.5), (97.7, 95.2), (97.7, 94.9), (97.5, 93.6), (97.5, 94.2)),
    "K3": ((88.7, 96.7), (88.2, 96.7), (87.6, 96.6), (86.8, 96.6), (84.9, 96.7)),
    "K4": ((88.9, 97.1), (88.2, 97.1), (87.8, 97.3), (83.5, 96.2), (84.8, 96.9)),
    "K5": ((97.4, 96.1), (97.3, 95.7), (97.1, 95.6), (97.1, 95.4), (96.9, 95.2)),
}

# Table A.1: parameters of the robot's dynamics, kg m^2 and, for the last two, N m s/rad.
ROBOT_ALPHA = (0.06929, 0.04217, 0.04416, 0.06510, 0.07389)
ROBOT_ALPHA_SD = (0.00003, 0.00007, 0.00004, 0.00176, 0.00072)
