"""A robot's arm meets a person: the force beside the limits of ISO/TS 15066, and speeds allowed.

All joints of the arm are locked while the contact lasts, but the one that turns it: two tubes as
beams with the masses of the joints. The person is the standard's, a mass on a spring; the tip has
a soft cover. In the frame of the arm the person comes with the speed of the tip.

The stiffnesses, masses and limits are those of ISO/TS 15066:2016, Annex A (tables A.2 and A.3), as
papers and guides repeat them; whoever assesses a robot takes them from the standard itself.

    .venv/bin/python demos/robot_contact.py --help
"""

from __future__ import annotations

from pathlib import Path

import command_line
import compared
import numpy as np

import antiosc as ao

ROOT = Path(__file__).resolve().parent.parent
#: Region of the body -> stiffness (N/m), effective mass (kg), limit of a short force (N).
BODY = {
    "hand": (75e3, 0.6, 280.0),
    "lower arm": (40e3, 2.0, 320.0),
    "chest": (25e3, 40.0, 280.0),
    "back": (35e3, 40.0, 420.0),
}
#: The arm (m): axis of the base, elbow, tip; a tube of aluminium.
BASE, ELBOW, TIP = (0.0, 0.0, 0.0), (0.40, 0.0, 0.12), (0.80, 0.0, 0.0)
DIAMETER, WALL = 0.09, 0.004
#: Masses (kg) of the joint at the elbow, and of wrist and tool at the tip.
JOINT, WRIST = 2.5, 2.0
#: Time (s) that is simulated: the arm turns little until then.
LASTS = 0.08


def main(
    velocity: float = 0.25, cover: float = 40e3, out: Path = ROOT / "out"
) -> dict[str, dict[str, float]]:
    """Let the arm meet each region of the body; return its numbers.

    Parameters
    ----------
    velocity : of the tip, m/s
    cover : stiffness of the soft tip, N/m
    out : folder of the results
    """
    out.mkdir(parents=True, exist_ok=True)
    arm = locked_arm()
    model = ao.extract(arm, ao.Site(TIP, (0, -1, 0), part="fore"), n=12)
    of_robot = arm.mass / 2 + WRIST  # m_R = M/2 + m_L
    times = np.linspace(0, LASTS, 1000)
    numbers, lines = {}, {}
    for region, (stiffness, mass, limit) in BODY.items():
        both = ao.Linear(1 / (1 / stiffness + 1 / cover))
        hit = ao.simulate(model, ao.RigidMass(mass, velocity), both, duration=LASTS)
        standard = by_standard(velocity, stiffness, mass, of_robot)  # without the cover
        lines[region] = hit.force_at(times)
        numbers[region] = {
            "force": hit.peak_force,
            "standard": standard,
            "limit": limit,
            "allowed": velocity * limit / hit.peak_force,  # the contact is linear
            "allowed by the standard": velocity * limit / standard,
        }
    columns = {
        "force N": ("force", 1.0, ".1f"),
        "by A.4 N": ("standard", 1.0, ".1f"),
        "limit N": ("limit", 1.0, ".0f"),
        "allowed mm/s": ("allowed", 1e3, ".0f"),
        "by A.4 mm/s": ("allowed by the standard", 1e3, ".0f"),
    }
    compared.table(f"tip at {velocity:g} m/s", numbers, columns)
    compared.plot(times, lines, "contact force (N)", out / "robot_contact.png")
    return numbers


def by_standard(velocity: float, stiffness: float, mass: float, of_robot: float) -> float:
    """The force (N) between two masses on a spring: v (µ k)^(1/2)."""
    reduced = 1 / (1 / mass + 1 / of_robot)
    return float(velocity * np.sqrt(reduced * stiffness))


def locked_arm() -> ao.Structure:
    """The arm, which turns about the vertical axis of its base alone."""
    section = ao.Section.tube(DIAMETER, WALL)
    tube = ao.Beam(section=section, E=69e9, nu=0.33, rho=2700.0, orientation=(0, 1, 0))
    pivot = ao.Support(near=(BASE, 1e-3), fix=("x", "y", "z", "rx", "ry"))
    joint, wrist = ao.PointMass(ELBOW, JOINT), ao.PointMass(TIP, WRIST)
    upper = ao.Structure(command_line.line(BASE, ELBOW, 8), tube, [pivot], attached=[joint])
    fore = ao.Structure(command_line.line(ELBOW, TIP, 8), tube, attached=[wrist])
    locked = ao.Weld(("upper", ELBOW), ("fore", ELBOW))
    return ao.assemble({"upper": upper, "fore": fore}, [locked])


if __name__ == "__main__":
    command_line.command(main)
