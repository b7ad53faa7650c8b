"""Published tests whose measured or printed values could not be had here: inputs that run.

Data marked "assumed" stand for those that the text at hand does not give; put the real ones in
their place and compare.
"""

from __future__ import annotations

import numpy as np
from case import Waiting
from frequencies import meshed, quadrilateral

import antiosc as ao
from antiosc.models.closed_form import (
    UniformBeam,
    free_free,
    pinned_free,
    pinned_pinned,
)
from plates import SupportedPlate

STEEL = {"E": 210e9, "nu": 0.3, "rho": 7850.0}


def known(value: float | None) -> float:
    """NaN where the run ends during contact."""
    return float("nan") if value is None else value


def sphere_on_beam(speed: float = 0.5, place: float = 0.5) -> dict[str, float]:
    """A steel sphere of 70 mm radius falls on a simply supported beam of 60 x 27.8 x 780 mm."""
    section = ao.Section.rectangle(60e-3, 27.8e-3)
    beam = UniformBeam.timoshenko(**STEEL, area=section.A, inertia=section.I, length=0.78)
    model = pinned_pinned(beam, site=place * beam.length).anti_oscillators(30)
    ball = ao.Sphere(70e-3, **STEEL, velocity=speed)
    hit = ao.simulate(model, ball, ball.hertz(STEEL["E"], STEEL["nu"]), duration=2e-2)
    first = hit.contacts[0]
    return {
        "first sub-impact (µs)": 1e6 * (first[1] - first[0]),
        "sub-impacts": len(hit.contacts),
        "peak force (N)": hit.peak_force,
        "restitution": known(hit.restitution),
    }


def plate_thickness(radius: float = 10e-3, speed: float = 1.0) -> dict[str, float]:
    """Contact time of a steel sphere on steel plates of several thicknesses."""
    found = {}
    for thickness in (5e-3, 10e-3, 20e-3):
        plate = SupportedPlate(**STEEL, thickness=thickness, a=0.5, b=0.5)
        model = plate.anti_oscillators(0.25, 0.25, 60)
        ball = ao.Sphere(radius, **STEEL, velocity=speed)
        hit = ao.simulate(model, ball, ball.hertz(STEEL["E"], STEEL["nu"]), duration=3e-4)
        found[f"contact time, {1e3 * thickness:g} mm (µs)"] = 1e6 * hit.contact_time
    return found


def beam_on_cylinder(d: float = 12.7e-3, length: float = 0.6) -> dict[str, float]:
    """Restitution of a round beam, pinned at one end, that falls on a fixed cylinder."""
    section = ao.Section.circle(d)
    beam = UniformBeam.timoshenko(**STEEL, area=section.A, inertia=section.I, length=length)
    law = ao.Sphere(d / 2, **STEEL).hertz(STEEL["E"], STEEL["nu"])  # crossed, equal cylinders
    found = {}
    for place in (0.3, 0.5, 2 / 3, 0.8, 1.0):
        model = pinned_free(beam, site=place * length).anti_oscillators(40)
        hit = ao.simulate(model, ao.Obstacle(), law, duration=2e-2, initial_velocity=1.0)
        found[f"restitution at {place:.2f} L"] = known(hit.restitution)
    return found


def dropped_bar(angle: float = 30.0, d: float = 12.7e-3, length: float = 0.2) -> dict[str, float]:
    """Restitution of a steel bar that falls inclined on a massive block, without friction."""
    section = ao.Section.circle(d)
    beam = UniformBeam.timoshenko(**STEEL, area=section.A, inertia=section.I, length=length)
    ball = ao.Sphere(d / 2, **STEEL)
    law = ball.hertz(STEEL["E"], STEEL["nu"])
    model = free_free(beam, site=0.0).anti_oscillators(40)
    # the bending motion is across the bar: its share of the approach is cos(angle)
    speed = 1.0 * np.cos(np.radians(angle))
    hit = ao.simulate(model, ao.Obstacle(), law, duration=3e-3, initial_velocity=speed)
    return {
        f"restitution at {angle:g} degrees": known(hit.restitution),
        "contacts": len(hit.contacts),
    }


def timoshenko(speed: float = 0.01) -> dict[str, float]:
    """Timoshenko's own example: a steel ball of 1 cm radius on a steel bar of 1 x 1 x 15.35 cm."""
    section = ao.Section.rectangle(10e-3, 10e-3)
    beam = UniformBeam.euler_bernoulli(
        E=215.8e9, rho=7960.0, area=section.A, inertia=section.I, length=0.1535
    )
    model = pinned_pinned(beam).anti_oscillators(40)
    ball = ao.Sphere(10e-3, E=215.8e9, nu=0.3, rho=7960.0, velocity=speed)
    hit = ao.simulate(model, ball, ball.hertz(215.8e9, 0.3), duration=2e-3)
    return {
        "peak force (N)": hit.peak_force,
        "contacts": len(hit.contacts),
        "end of the main impact (µs)": 1e6 * hit.contacts[-1][1],
    }


def karas() -> dict[str, float]:
    """A steel ball of 10 mm radius on a simply supported steel plate of 200 x 200 x 8 mm."""
    steel = {"E": 206e9, "nu": 0.3, "rho": 7833.0}
    plate = SupportedPlate(**steel, thickness=8e-3, a=0.2, b=0.2)
    ball = ao.Sphere(10e-3, **steel, velocity=1.0)
    model = plate.anti_oscillators(0.1, 0.1, 100)
    hit = ao.simulate(model, ball, ball.hertz(steel["E"], steel["nu"]), duration=2e-4)
    return {"peak force (N)": hit.peak_force, "contact time (µs)": 1e6 * hit.contact_time}


def laminate() -> dict[str, float]:
    """Sun and Chen's plate: [0/90/0/90/0]s of T300/934, 200 x 200 x 2.69 mm, struck at 3 m/s."""
    ply = ao.Layer(120e9, 7.9e9, 0.3, 5.5e9, 5.5e9, 5.5e9, 1580.0, 0.269e-3)
    half = [ply.rotated(a) for a in (0.0, 90.0, 0.0, 90.0, 0.0)]
    shell = ao.Laminate([*half, *half[::-1]], axis=(1, 0, 0))
    corners = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.2), (0.0, 0.2)]
    edges = [ao.Support(f"edge{i}", fix=("x", "y", "z")) for i in range(1, 5)]
    part = ao.Structure(meshed(quadrilateral(corners, (24, 24)), gdim=3), shell, edges)
    model = ao.extract(part, ao.Site((0.1, 0.1, 0.0), (0, 0, -1)), n=60)
    ball = ao.Sphere(6.35e-3, E=210e9, nu=0.3, rho=7960.0, velocity=3.0)
    hit = ao.simulate(model, ball, ao.Hertz(8.394e8), duration=8e-4)
    return {"peak force (N)": hit.peak_force, "contact time (µs)": 1e6 * hit.contact_time}


WAITING = [
    Waiting(
        "A steel sphere on a simply supported steel beam, with sub-impacts",
        "doi 10.1177/1687814016668089 and 10.1177/1687814016683351",
        "sphere of 70 mm radius, beam 60 × 27.8 × 780 mm (read); 0.5 m/s at mid-span (assumed)",
        "the five speeds and the table of measured durations; only abstract and introduction are "
        "stored here",
        sphere_on_beam,
    ),
    Waiting(
        "Contact time against the thickness of a plate",
        "Appl. Sci. 16 (2026) 89 (doi 10.3390/app16010089)",
        "steel sphere of 10 mm radius, 1 m/s, steel plates of 0.5 m (all assumed)",
        "spheres, plates, heights and measured times; the abstract says: thickness within 3 % for "
        "λ < 1.5",
        plate_thickness,
    ),
    Waiting(
        "Restitution along a pinned beam against a fixed cylinder",
        "J. Appl. Mech. 91 (2024) 011011",
        "round steel beam of 12.7 mm, 0.6 m; cylinder of the same diameter; 1 m/s (all assumed)",
        "the measured values at each place",
        beam_on_cylinder,
    ),
    Waiting(
        "Bars dropped on a massive block",
        "D. Stoianovici, Y. Hurmuzlu, J. Appl. Mech. 63 (1996) 307 (doi 10.1115/1.2788865)",
        "round steel bar, 12.7 mm × 200 mm (recalled), 30° (assumed), no friction; its end a ball",
        "the measured restitution and contact times",
        dropped_bar,
    ),
    Waiting(
        "A ball on a bar, Timoshenko's own example",
        "S. Timoshenko, Z. Math. Phys. 62 (1913) 198; W. Goldsmith, Impact (1960)",
        "ball of 1 cm radius, bar 1 × 1 × 15.35 cm, 1 cm/s, E = 2.2e6 kg/cm² (all recalled)",
        "the printed curve of the force",
        timoshenko,
    ),
    Waiting(
        "A ball on a plate, Karas's example",
        "K. Karas, Ing.-Arch. 10 (1939) 237",
        "200 × 200 × 8 mm, ball of 10 mm radius, 1 m/s, E = 206 GPa, ρ = 7833 kg/m³ (recalled)",
        "the printed curve of the force",
        karas,
    ),
    Waiting(
        "A ball on a laminate, Sun and Chen's example",
        "C. T. Sun, J. K. Chen, J. Compos. Mater. 19 (1985) 490",
        "[0/90/0/90/0]s, 200 × 200 × 2.69 mm, E1 = 120, E2 = 7.9, G12 = 5.5 GPa, ν12 = 0.3, "
        "ρ = 1580 kg/m³; ball of 12.7 mm, 3 m/s, ρ = 7960 kg/m³; 8.394e8 N/m^1.5 in loading and "
        "unloading (all recalled)",
        "the printed curve of the force, about 300 N at its peak as recalled",
        laminate,
    ),
]

#: experiments that were looked for in stored copies of public pages, documents, threads of issues
#: and repositories, by title, authors, doi and content, and what was found of them
SEARCHED = [
    ("Goldsmith's spheres on beams (Impact, 1960; with Cunningham, 1956)", "titles only"),
    ("doi 10.1177/1687814016668089 and 10.1177/1687814016683351", "abstracts, introductions"),
    ("Appl. Sci. 16 (2026) 89, and its preprint preprints.org 202511.0633", "abstracts"),
    ("J. Appl. Mech. 91 (2024) 011011", "abstract, introduction"),
    ("Stoianovici and Hurmuzlu, J. Appl. Mech. 63 (1996) 307", "abstract"),
    ("Seifried, Schiehlen and Eberhard, spheres on rods", "titles only"),
    ("Monjaraz-Tec, Gehr, Krack and others, sphere on a beam, arXiv 2207.00795", "introduction"),
    ("Karas 1939, Timoshenko 1913, Sun and Chen 1985, Schwieger 1970", "titles only"),
    ("Raman 1920, Koller and Busenhart 1986, Sondergaard 1990: balls on plates", "titles only"),
    ("Tsai's approximation, Olsson's plates", "titles only"),
    ("Gugan, Am. J. Phys. 68 (2000) 920, balls on a plate: contact times", "abstract"),
    ("K. Wong, Structures under Impact Loading, thesis, Cambridge 2005: perspex beams", "abstract"),
    ("Wang and others, AIP Adv. 15 (2025) 025104, rubber sphere on a plate", "not linear elastic"),
    ("Kharaz, Gorham and Salman 2001", "measured points, used above"),
    ("Kharaz and Gorham 2000, alumina on steel and aluminium: normal restitution", "titles only"),
    ("Minamoto and Kawamura 2009 and 2011; Mangwandi 2007; Tatara and Moriwaki", "titles only"),
    ("Lifshitz and Kolsky 1964; Labous 1997; Gondret 2002; Stevens and Hrenya 2005", "titles only"),
    ("Güttler and others, arXiv 1204.0001: restitution of many authors, digitized", "introduction"),
    ("Jackson, Green and Marghitu 2010; Zhang and Vu-Quoc 2002: laws that yield", "beginnings"),
    ("Montaine and others, arXiv 1104.0049: a steel sphere on glass", "beginning"),
    ("Shivakumar, Elber and Illg 1985; Big-Alabo 2017: thin plates that stretch", "beginnings"),
    ("Agüero and others, arXiv 2208.11089: a sphere on a stretched membrane", "introduction"),
    ("Appl. Sci. 11 (2021) 2706: thin aluminium plates in bending, indented", "abstract; static"),
    ("Nurick and Martin 1989; Tabri 2003; Liu 2011: struck steel plates", "beginnings; they yield"),
    ("Leeb's rebound hardness of steels, manuals of testers", "measured points, used above"),
]
