"""Cross-sections of Nastran's beams: PBAR, PBARL, PBEAM, PBEAML."""

from __future__ import annotations

import math

from antiosc.errors import MeshError
from antiosc.fem.readers.decks import profiles
from antiosc.fem.readers.decks.nastran_cards import Entry

#: Supported cross-sections and the number of their dimensions.
DIMENSIONS = {"ROD": 1, "TUBE": 2, "BAR": 2, "BOX": 4}


def profile_of(entry: Entry) -> tuple[profiles.Profile, float, bool, list[str]]:
    """(cross-section, more mass per length, whether it deforms in shear, what is not taken)."""
    if entry.name in ("PBARL", "PBEAML"):
        return *_listed_profile(entry), []
    area, first, second = (entry.real(k, None) for k in (2, 3, 4))
    if entry.name == "PBAR":
        torsion, extra, mixed = entry.real(5), entry.real(6), entry.real(18)
        k1, k2 = entry.real(16), entry.real(17)
    else:
        mixed, torsion, extra = entry.real(5), entry.real(6), entry.real(7)
        start = 16
        while entry.text(start).upper() in ("YES", "YESA", "NO"):
            own = [entry.real(start + k) for k in (2, 3, 4)]
            pairs = zip(own, (area, first, second), strict=True)
            if any(value and not math.isclose(value, end, rel_tol=1e-6) for value, end in pairs):
                raise MeshError(f"{entry.place}: tapered beams (PBEAM) are not supported.")
            start += 16 if entry.text(start).upper() == "YES" else 8
        k1, k2 = entry.real(start, 1.0), entry.real(start + 1, 1.0)
    if mixed:
        raise MeshError(f"{entry.place}: I12 must be 0: rotate the section to its principal axes.")
    if min(area, first, second) <= 0:
        raise MeshError(f"{entry.place}: {entry.name} needs A, I1 and I2 above 0.")
    shear = (k1 + k2) / 2 if k1 and k2 else 0.0
    told = []
    label = f"{entry.name} {entry.text(0)}"
    if bool(k1) != bool(k2) or (shear and not math.isclose(k1, k2, rel_tol=1e-3)):
        what = "their mean is taken" if shear else "both planes are taken as rigid in shear"
        told.append(f"K1 and K2 of {label}, which differ: {what}")
    if not torsion:
        told.append(f"the missing torsion constant J of {label}, (I1 + I2)/2 is taken")
    torsion = torsion or (first + second) / 2
    profile = profiles.Profile(area, first, second, torsion, shear or profiles.RECTANGLE)
    return profile, extra, shear > 0, told


def _listed_profile(entry: Entry) -> tuple[profiles.Profile, float, bool]:
    kind = entry.text(3).upper()
    if kind not in DIMENSIONS:
        raise MeshError(
            f"{entry.place}: {entry.name} of the type {kind!r} is not supported; give its "
            f"constants by PBAR, or take one of {', '.join(DIMENSIONS)}."
        )
    count = DIMENSIONS[kind]
    d = [entry.real(8 + k, None) for k in range(count)]
    if min(d) <= 0 and not (kind == "TUBE" and d[0] > 0 and d[1] == 0):
        raise MeshError(f"{entry.place}: {entry.name} needs dimensions above 0.")
    extra = entry.real(8 + count)
    if entry.name == "PBEAML" and any(entry.text(k) for k in range(9 + count, len(entry.fields))):
        raise MeshError(f"{entry.place}: tapered beams (PBEAML) are not supported.")
    if kind == "ROD":
        return profiles.ellipse(2 * d[0], 2 * d[0]), extra, True
    if kind == "TUBE":
        return profiles.tube(d[0], d[0] - d[1]), extra, True
    if kind == "BAR":  # the width along plane 2, the height along plane 1
        return profiles.rectangle(d[1], d[0]), extra, True
    found = profiles.box(d[1], d[0], (d[2], d[3], d[2], d[3]))
    assert found is not None
    return found, extra, True
