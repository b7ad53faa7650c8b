"""Hyperelastic materials of Abaqus and CalculiX by their initial moduli, those of small strains.

The strain energies and the order of their constants are those of Abaqus, *Analysis User's Guide*,
"Hyperelastic behavior of rubberlike materials" and "Hyperelastic behavior in elastomeric foams".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from antiosc_decks.abaqus_cards import Card

#: Bulk over shear modulus where a card says that the material is incompressible (D = 0), as in
#: Abaqus/Explicit: ν = 0.475.
INCOMPRESSIBLE = 20.0
#: Coefficients of λ⁻² to λ⁻⁸ in the initial shear modulus of Arruda and Boyce.
ARRUDA_BOYCE = (3 / 5, 99 / 175, 513 / 875, 42039 / 67375)

#: Option -> number of constants without D for order N, and the initial shear modulus by them.
ENERGIES: dict[str, tuple[Callable[[int], int], Callable[[Sequence[float]], float]]] = {
    "NEOHOOKE": (lambda _: 1, lambda c: 2 * c[0]),
    "MOONEY-RIVLIN": (lambda _: 2, lambda c: 2 * (c[0] + c[1])),
    "YEOH": (lambda _: 3, lambda c: 2 * c[0]),
    "REDUCEDPOLYNOMIAL": (lambda n: n, lambda c: 2 * c[0]),
    "OGDEN": (lambda n: 2 * n, lambda c: sum(c[::2])),
    "ARRUDA-BOYCE": (
        lambda _: 2,
        lambda c: c[0] * (1 + sum(a / c[1] ** (2 * k) for k, a in enumerate(ARRUDA_BOYCE, 1))),
    ),
    "POLYNOMIAL": (lambda n: n * (n + 3) // 2, lambda c: 2 * (c[0] + c[1])),
}


def initial_moduli(card: Card) -> tuple[float, float] | None:
    """(E, ν) at small strains of *HYPERELASTIC or *HYPERFOAM; None of test data."""
    order = int(card.option("N", "1"))
    values = card.numbers()
    if card.keyword == "HYPERFOAM":
        if len(values) < 3 * order:
            return None
        moduli = values[0 : 2 * order : 2]
        ratios = values[2 * order : 3 * order]
        shear = sum(moduli)
        pairs = zip(moduli, ratios, strict=True)
        bulk = sum(2 * mu * (1 / 3 + nu / (1 - 2 * nu)) for mu, nu in pairs)
    else:
        kind = next((name for name in ENERGIES if name in card.options), "POLYNOMIAL")
        count, shear_of = ENERGIES[kind]
        number = count(order)
        if len(values) < number or any("TEST" in name for name in card.options):
            return None
        shear = shear_of(values)
        compressibility = (*values[number:], 0.0)[0]
        bulk = 2 / compressibility if compressibility else INCOMPRESSIBLE * shear
    E = 9 * bulk * shear / (3 * bulk + shear)
    return E, E / (2 * shear) - 1
