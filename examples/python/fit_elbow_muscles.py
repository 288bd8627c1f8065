"""Fits the elbow's muscles to measured maximum torque, as the built-in ones were.

    python fit_elbow_muscles.py [figure.png]

Prints peak force and range of each muscle, and how the torque compares with the measurements.
"""

import sys

from ulna import exo


def main() -> None:
    start = exo.exoskeleton(coupling="arm_only", muscles="unfitted")
    values = exo.fit_elbow_muscles(start)
    for name, (force, low, high) in zip(start.names("tendon"), values, strict=True):
        print(f"{name:<16} {force:8.2f} N   {low:.4f} {high:.4f}")
    torque = exo.isometric_torque(exo.exoskeleton(coupling="arm_only", muscle_values=values))
    print(torque.summary())
    if len(sys.argv) > 1:
        torque.plot()[0, 0].figure.savefig(sys.argv[1])


if __name__ == "__main__":
    main()
