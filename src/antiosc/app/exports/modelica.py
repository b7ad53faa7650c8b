"""A model for Modelica: masses and springs of its standard library behind a flange."""

from __future__ import annotations

from pathlib import Path

from antiosc import __version__
from antiosc.app.exports.fmu import identifier
from antiosc.base import files
from antiosc.base.errors import InputError
from antiosc.contact import ContactLaw
from antiosc.models.anti_oscillators import AntiOscillators

_TEXT = """\
model {name} "Structure struck at one site, as anti-oscillators (antiosc {version})"
  parameter Modelica.Units.SI.Mass m0 = {m0!r} "Residual mass at the site";
  parameter Modelica.Units.SI.TranslationalSpringConstant k0 = {k0!r} "Static stiffness";
  parameter Modelica.Units.SI.Mass m[{n}] = {m} "Masses of the anti-oscillators";
  parameter Modelica.Units.SI.AngularFrequency omega[{n}] = {omega} "Antiresonances";
  Modelica.Mechanics.Translational.Interfaces.Flange_a flange "The site, along the impact"
    annotation (Placement(transformation(extent={{{{-110,-10}},{{-90,10}}}})));
  Modelica.Mechanics.Translational.Components.Mass site(m=m0)
    annotation (Placement(transformation(extent={{{{-60,-10}},{{-40,10}}}})));
  Modelica.Mechanics.Translational.Components.Mass mass[{n}](m=m)
    annotation (Placement(transformation(extent={{{{60,-10}},{{80,10}}}})));
  Modelica.Mechanics.Translational.Components.Spring spring[{n}](
    c={{m[i]*omega[i]^2 for i in 1:{n}}})
    annotation (Placement(transformation(extent={{{{10,-10}},{{30,10}}}})));
{ground}equation
  connect(flange, site.flange_a);
  for i in 1:{n} loop
    connect(site.flange_b, spring[i].flange_a);
    connect(spring[i].flange_b, mass[i].flange_a);
  end for;
{support}end {name};
"""
_GROUND = """\
  Modelica.Mechanics.Translational.Components.Spring support(c=k0)
    annotation (Placement(transformation(extent={{-60,-60},{-40,-40}})));
  Modelica.Mechanics.Translational.Components.Fixed ground
    annotation (Placement(transformation(extent={{-20,-60},{0,-40}})));
"""
_SUPPORT = """\
  connect(site.flange_b, support.flange_a);
  connect(support.flange_b, ground.flange);
"""


def write(
    path: Path,
    body: AntiOscillators,
    impactor: object = None,
    contact: ContactLaw | None = None,
    duration: float | None = None,
) -> None:
    """Write the Modelica model; a contact is the importer's."""
    if impactor is not None:
        raise InputError(
            "a file .mo holds a model with a flange: connect the striker and its contact there, or"
            " export an .fmu with the contact law inside."
        )
    supported = body.k0 > 0
    text = _TEXT.format(
        name=identifier(path.stem), version=__version__, n=body.n, m0=float(body.m0),
        k0=float(body.k0), m=_list(body.m.tolist()), omega=_list(body.omega.tolist()),
        ground=_GROUND if supported else "", support=_SUPPORT if supported else "",
    )  # fmt: skip
    files.write_text(path, text, "the Modelica model")


def _list(values: list[float]) -> str:
    return "{" + ", ".join(map(repr, values)) + "}" if values else "fill(0.0, 0)"
