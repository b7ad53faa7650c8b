"""Parts under load whose frequencies and deflections are known.

Wright, Smith, Thresher & Wang, J. Appl. Mech. 49 (1982) 197, table 1: flapping frequencies of a
uniform cantilever without hub; of its lagging ω² is less by Ω². With bending stiffness EI, mass m
per length and length L, frequencies and speeds are in units of √(EI/(m L⁴)).
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

import antiosc as ao
from loaded_beams import RHO, THIN_BEAM, UNIT, E, at_root, beams, marked
from parts import box
from sheets import at, edges, grouped, rectangle, sheet

WRIGHT = {3: (4.7973, 23.3203), 6: (7.3604, 26.8091), 12: (13.1702, 37.6031)}


def blade(family, speed, fine=1):
    """(structure, unit of frequencies) of a blade along x that turns about z.

    fine : cells of a solid across the blade.
    """
    hub = (0, 0, 0)
    if family == "beam":
        mesh, material, unit = beams(), THIN_BEAM, UNIT
    elif family == "solid":
        mesh, material = box((30 * fine, fine, fine), (1.0, 0.02, 0.02)), ao.Solid(E, 0.0, RHO)
        unit, hub = np.sqrt(E * 0.02**2 / 12 / RHO), (0, 0.01, 0.01)
    else:
        mesh = sheet((16, 1), lambda s, t: (s, 0.05 * (t - 0.5), 0 * s), family)
        material, unit = ao.Shell(E, 0.0, RHO, 0.005), np.sqrt(E * 0.005**2 / 12 / RHO)
    spin = ao.Spin((0, 0, 1), speed * unit, about=hub) if speed else None
    loads = ao.Prestress(spin=spin)
    return ao.Structure(mesh, material, [ao.Support(at_root)], prestress=loads), unit


SIZE, THIN = 1.0, 0.004


def plate(force, cell, laminate):
    mesh = marked(rectangle(8, SIZE, SIZE, cell), right=(1, at(0, SIZE)))
    held = [
        ao.Support(edges(0, 1), "z"),
        ao.Support(at(0, 0.0), "x"),
        ao.Support(lambda x: np.hypot(x[0], x[1]) < 1e-9, ("y", "rz")),
    ]
    loads = ao.Prestress(force={"right": (force, 0, 0)}) if force else None
    layer = ao.Layer.isotropic(E, 0.3, RHO, THIN / 2)
    material = ao.Laminate([layer, layer]) if laminate else ao.Shell(E, 0.3, RHO, THIN)
    return ao.Structure(mesh, material, held, prestress=loads)


DISC, DRUM = 0.1, 1e-3


def ritz_drum(pressure, terms=6):
    """(deflection, lowest ω) of a clamped disc after von Kármán, linear about its equilibrium.

    Ritz in w = (1 − ρ²)² ρ^2i and u = ρ (1 − ρ²) ρ^j.
    """
    poly = np.polynomial.Polynomial
    shapes = [poly([1, 0, -1]) ** 2 * poly([0, 0, 1]) ** i for i in range(terms)]
    radial = [poly([0, 1]) * poly([1, 0, -1]) * poly([0, 1]) ** j for j in range(2 * terms)]
    x, weight = np.polynomial.legendre.leggauss(40)
    rho = (x + 1) / 2
    r, area = DISC * rho, 2 * np.pi * DISC**2 * rho * weight / 2
    w = np.array([p(rho) for p in shapes])
    slope, bend = (np.array([p.deriv(k)(rho) for p in shapes]) / DISC**k for k in (1, 2))
    hoop = np.array([p(rho) for p in radial]) / r
    along = np.array([p.deriv()(rho) for p in radial]) / DISC
    A = E * DRUM / (1 - 0.3**2)
    C = np.array([[1, 0.3], [0.3, 1]]) * A

    def gram(a, b):
        return np.einsum("aiq,ab,bjq,q->ij", a, C, b, area)

    curved = np.stack([bend, slope / r])
    bending = gram(curved, curved) * DRUM**2 / 12
    q, n = np.zeros(len(w) + len(hoop)), len(w)
    for _ in range(200):
        turn = q[:n] @ slope
        strain = np.stack([q[n:] @ along + turn**2 / 2, q[n:] @ hoop])
        N = C @ strain
        B = np.stack([np.vstack([turn * slope, along]), np.vstack([0 * slope, hoop])])
        residual = np.einsum("aiq,aq,q->i", B, N, area)
        residual[:n] += bending @ q[:n] - pressure * w @ area
        K = gram(B, B)
        K[:n, :n] += bending + np.einsum("iq,jq,q->ij", slope, slope, N[0] * area)
        step = np.linalg.solve(K, residual)
        q = q - step * min(1.0, DRUM / 2 / np.abs(step[:n]).max())
    still = K[:n, :n] - K[:n, n:] @ np.linalg.solve(K[n:, n:], K[n:, :n])
    M = RHO * DRUM * np.einsum("iq,jq,q->ij", w, w, area)
    return q[0], np.sqrt(scipy.linalg.eigh(still, M, eigvals_only=True)[0])


def drum(pressure):
    """A clamped disc of shell elements under a pressure [Pa]."""

    def disc(s, t):
        x, y = 2 * s - 1, 2 * t - 1
        return DISC * x * np.sqrt(1 - y * y / 2), DISC * y * np.sqrt(1 - x * x / 2), 0 * s

    mesh = grouped(sheet(8, disc, "triangle", 2))
    rim = ao.Support(lambda x: np.hypot(x[0], x[1]) > DISC * (1 - 1e-3))
    loads = ao.Prestress(pressure={"sheet": pressure})
    return ao.Structure(mesh, ao.Shell(E, 0.3, RHO, DRUM), [rim], prestress=loads)
