"""Rebounds and dents of metals that yield: what Leeb's hardness testers measure."""

from __future__ import annotations

from math import log, sqrt
from pathlib import Path

import numpy as np
from case import Case, Row, drawing

import antiosc as ao

#: Steels of a table of a tester, type D: HL = 1000 times the restitution, and tensile strength in
#: MPa, at both ends of each range.
STEELS = {
    "C, soft": ((350, 374), (522, 780)),
    "C": ((500, 737), (710, 1670)),
    "Cr": ((500, 707), (730, 1829)),
    "CrV": ((500, 704), (750, 1980)),
    "CrNi": ((500, 763), (750, 2007)),
    "CrMo": ((500, 721), (738, 1875)),
    "CrNiMo": ((540, 844), (738, 1933)),
    "CrMnSi": ((500, 755), (750, 1993)),
    "SSST": ((630, 1180), (800, 2652)),
    "SST": ((500, 703), (710, 1676)),
}
#: Impact bodies: energy in mJ, mass in g, radius of the ball in mm.
BODIES = {"D": (11.0, 5.5, 1.5), "C": (2.7, 3.0, 1.5), "G": (90.0, 20.0, 2.5)}
#: Body, Vickers hardness of the sample, diameter of the dent in mm.
DENTS = (
    ("D", 300, 0.54), ("D", 600, 0.54), ("D", 800, 0.35), ("C", 300, 0.38), ("C", 600, 0.32),
    ("C", 800, 0.35), ("G", 300, 1.03), ("G", 600, 0.90),
)  # fmt: skip
CARBIDE = {"E": 600e9, "nu": 0.22}
STEEL, RATE = {"E": 210e9, "nu": 0.3, "rho": 7850.0}, 0.014
#: Strain under a ball over a/R (D. Tabor, The Hardness of Metals, 1951).
TABOR = 0.2
PRINTED = (
    "The page prints the same diameter for 300 and 600 HV, but a depth of 17 µm, which is that of "
    "0.45 mm. For 800 HV and the body C a larger one than for 600 HV."
)
SHALLOW = (
    "At 800 HV three fifths of the indentation spring back, and the edge of so flat a dent is a "
    "matter of definition; the depth agrees (10 µm printed)."
)


def struck(body: str, strength: float) -> ao.History:
    """A blow of an impact body on steel of this static flow strength [Pa], which grows with the
    strain rate by Johnson and Cook's factor."""
    energy, mass, radius = 1e-3 * np.array(BODIES[body])
    factor = 1.0
    for _ in range(3):
        flow = ao.Solid(**STEEL, yield_strength=factor * strength)
        block = ao.Sphere(1.0, material=flow)  # flat and heavy beside the ball
        ball = ao.RigidMass(mass, sqrt(2 * energy / mass), tip_radius=radius, **CARBIDE)
        hit = ao.Scene({"block": block, "ball": ball}, [ao.Contact("block", "ball")]).run(2e-4)
        strain = TABOR * sqrt(hit.deepest / radius)
        factor = 1 + RATE * log(strain / (0.5 * hit.contact_time))
    return hit


def leeb(picture: Path) -> list[Row]:
    """Restitution of carbide balls on steels of known strength, and the dents."""
    points = [(name, *point) for name, ends in STEELS.items() for point in ends]
    rows = [
        Row(
            f"restitution on steel {name} of {strength} MPa",
            hardness / 1000, restitution_at(strength), 0.05, absolute=True,
        )
        for name, hardness, strength in points
    ]  # fmt: skip
    for body, hardness, across in DENTS:
        dent = struck(body, hardness * 9.807e6 / 3).dent
        assert dent is not None
        assert dent.radius is not None
        why = PRINTED if hardness == 600 or body == "C" else SHALLOW
        name = f"dent, mm across, body {body}, {hardness} HV"
        rows.append(Row(name, across, 2e3 * dent.radius, 0.1, why=why))
    strengths = np.geomspace(350, 2700, 20)
    with drawing(picture, "tensile strength (MPa)", "restitution") as axis:
        axis.plot(strengths, [restitution_at(strength) for strength in strengths], label="antiosc")
        axis.plot([p[2] for p in points], [p[1] / 1000 for p in points], "ko", label="measured")
    return rows


def restitution_at(strength: float) -> float:
    """Of the body D on steel of this tensile strength [MPa]."""
    found = struck("D", strength * 1e6).contact_histories[0].restitution
    assert found is not None
    return float(found)


CASES = [
    Case(
        "leeb",
        "Carbide balls on steels: rebound hardness",
        "impact bodies of 11, 2.7 and 90 mJ, 5.5, 3 and 20 g with balls of 3, 3 and 5 mm of "
        "tungsten carbide (read), E = 600 GPa, ν = 0.22 (recalled). Steel: E = 210 GPa. Its flow "
        "strength is the tensile strength, or a third of the Vickers hardness (Tabor), times "
        "1 + 0.014 ln(strain rate in 1/s), Johnson and Cook's factor of steel 4340",
        "HL is 1000 times the ratio of the speeds. Ranges of HL and of tensile strength of ten "
        "steels, read in the manual of the tester Smart Sensor AR936, appendix two. Impact bodies "
        "and dents, read in the manuals of PCE-2800 and Mitech MH310, table 3 (manualshive.com). "
        "Factor 0.014 read in ijd2104/ShearBands, get_parameters.m; bounds 0.05 and 10 %",
        leeb,
        measured=True,
    ),
]
