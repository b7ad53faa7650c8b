"""Keyword cards of Abaqus and CalculiX with their data lines, and the treatment of each."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from antiosc.base.errors import MeshError
from antiosc.io.conversion import Array, IntArray
from antiosc_decks.entries import DeckItem, DeckPlace, real_number, whole_number
from antiosc_decks.sources import BULK_DATA_START, Account, Fate, Sources, fate_table

#: Element rows from this number on stand for elements that are not cells (masses, springs).
FIRST_NON_CELL_ROW = 2**40
#: Cards whose data may be in a separate file (INPUT=).
CARDS_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET", "BOUNDARY", "EQUATION")
#: Cards of loads, whose data may be in a file that is not there.
LOAD_CARDS: tuple[str, ...] = ("CLOAD", "DLOAD", "DSLOAD", "CFLUX", "DFLUX")
LOAD_CARDS += ("TEMPERATURE", "FILM", "SFILM", "RADIATE")
#: The comment over a surface that cgx of Debian writes without its keyword line.
CGX_SURFACE_COMMENT = re.compile(r"\*\* Surfaces based on (\S+)$")


class Row(DeckItem):
    """The fields of one data line; a trailing comma adds no field."""

    def __init__(self, line: str, card: Card, place: DeckPlace) -> None:
        self.card = card
        self.place = place
        self.fields = [part.strip() for part in line.split(",")]
        while self.fields and not self.fields[-1]:
            self.fields.pop()

    def word(self, k: int) -> str:
        """Field `k` as text; "" if the line is shorter."""
        if k < len(self.fields):
            return self.fields[k]
        return ""

    def real(self, k: int, default: float = 0.0) -> float:
        """Field `k` as a number; `default` if it is empty."""
        if self.word(k):
            return real_number(self.fields[k], self.place)
        return default

    def integer(self, k: int, default: int = 0) -> int:
        """Field `k` as an integer; `default` if it is empty."""
        if self.word(k):
            return whole_number(self.fields[k], self.place)
        return default

    def reals(self, count: int = 0) -> list[float]:
        """The first `count` fields as numbers (0: all fields); an empty field is 0."""
        return [self.real(k) for k in range(count or len(self.fields))]

    def nodes(self) -> IntArray:
        """Rows of the node or node set that the first field names."""
        return self.card.scope.nodes(self.word(0), self.place)


@dataclass
class Scope(ABC):
    """The names and numbers to which a card refers: those of one instance, or of the assembly."""

    name: str
    #: x in the whole deck: turn @ x in the part + shift
    rotation: Array
    translation: Array

    @property
    def prefix(self) -> str:
        """Prefix of this scope's names in the whole deck: "" or "instance."."""
        return f"{self.name}." if self.name else ""

    @abstractmethod
    def original_name(self, name: str) -> str:
        """A set's name as it was first written; names are not case-sensitive."""

    @abstractmethod
    def rows(self, keyword: str, number_or_set: str, place: DeckPlace) -> IntArray:
        """Rows of the node (NSET) or element (ELSET) with this number, or of the set's members."""

    def nodes(self, number_or_set: str, place: DeckPlace) -> IntArray:
        """Rows of the node or node set that `number_or_set` names."""
        return self.rows("NSET", number_or_set, place)

    def node(self, number_or_set: str, place: DeckPlace) -> int:
        """Row of a single node, named by its number or by a set of one node."""
        nodes = self.nodes(number_or_set, place)
        place.require(len(nodes) == 1, f"{number_or_set!r} must be one node; it is {len(nodes)}.")
        return int(nodes[0])

    def elements(self, number_or_set: str, place: DeckPlace) -> IntArray:
        """Rows of the cell with this number, or of the cells of the element set of this name."""
        rows = self.rows("ELSET", number_or_set, place)
        return rows[rows < FIRST_NON_CELL_ROW]


@dataclass
class Card(DeckItem):
    """One keyword with its options and data lines."""

    #: without `*` and spaces, upper case
    keyword: str
    #: name in upper case -> value as written; "" for those without one
    options: dict[str, str]
    place: DeckPlace
    #: data lines that are neither empty nor comments
    lines: list[str] = field(default_factory=list)
    #: file and line of each data line
    places: list[DeckPlace] = field(default_factory=list)
    #: what its numbers and names refer to
    scope: Scope = field(init=False, repr=False)
    #: keyword and options -> the same with their spaces
    spaced_names: dict[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Keyword with its spaces: "*CONTACT PAIR"."""
        return f"*{self.spaced_names.get(self.keyword, self.keyword)}"

    def in_scope(self, scope: Scope) -> Card:
        """A copy of the card in another scope."""
        card = copy(self)
        card.scope = scope
        return card

    def rows(self) -> list[Row]:
        """The data lines that have fields."""
        placed_lines = zip(self.lines, self.places, strict=True)
        return [row for line, place in placed_lines if (row := Row(line, self, place)).fields]

    def numbers(self) -> list[float]:
        """Numbers of all data lines; an empty field is 0."""
        return [value for row in self.rows() for value in row.reals()]

    def first(self) -> Row:
        """The first data line; a line without fields if there is none."""
        return Row("".join(self.lines[:1]), self, [*self.places, self.place][0])

    def option(self, name: str, default: str = "") -> str:
        """Value of an option without quotes."""
        return self.options.get(name, default).strip().strip('"').strip()

    def required_option(self, name: str) -> str:
        """Value of a required option."""
        value = self.option("".join(name.split()))
        self.needs(value, f"{self.label} needs {name}=.")
        return value

    def nodes(self, name: str) -> IntArray:
        """Rows of the nodes that the required option `name` names."""
        return self.scope.nodes(self.required_option(name), self.place)

    def elements(self) -> IntArray:
        """Rows of the cells that the required option ELSET= names."""
        return self.scope.elements(self.required_option("ELSET"), self.place)

    def refuse_rotated(self) -> None:
        """Raise MeshError if the instance is rotated: the card's axes would be ambiguous."""
        upright = np.allclose(self.scope.rotation, np.eye(3), rtol=0, atol=1e-9)
        self.needs(upright, f"{self.label} of a rotated instance is ambiguous: give it by vectors.")


def read_cards(sources: Sources) -> list[Card]:
    """All cards of a deck and of the files that it includes, in order."""
    cards_read: list[Card] = []
    _collect(sources, sources.main_lines(), sources.name, cards_read)
    if not cards_read:
        raise MeshError(f"{sources.name} contains no keyword (*NODE, …): it is not an Abaqus deck.")
    return cards_read


def _collect(sources: Sources, lines: list[str], file: str, cards_read: list[Card]) -> None:
    """Append the cards of one file to `cards_read`, and those of files it includes."""
    number = 0
    surface = None
    while number < len(lines):
        line = lines[number].strip()
        number += 1
        if not line or line.startswith("**"):
            surface = CGX_SURFACE_COMMENT.match(line) or surface
            continue
        place = DeckPlace(file, number)
        if surface and not line.startswith("*"):
            cards_read.append(_card(f"*SURFACE, NAME=S{surface[1]}", place))
        surface = None
        if not line.startswith("*"):
            if not cards_read and "**" in line:  # a comment behind what an editor put there
                continue
            bulk = not cards_read and any(map(BULK_DATA_START.match, lines))
            advice = "Nastran bulk data, name it .bdf" if bulk else "not an Abaqus deck"
            place.require(cards_read, f"data before the first keyword: {advice}.")
            cards_read[-1].lines.append(line)
            cards_read[-1].places.append(place)
            continue
        while line.endswith(",") and number < len(lines):
            next_line = lines[number].strip()
            if next_line[:1] in "*+-.0123456789":  # numbers are data
                break
            line += next_line
            number += 1
        card = _card(line, place)
        include = card.keyword == "INCLUDE"
        path = card.required_option("INPUT") if include else card.option("INPUT")
        # a file that is not there may be of loads, which are not read either
        of_loads = include and cards_read and cards_read[-1].keyword in LOAD_CARDS
        skipped = of_loads and not sources.exists(path)
        if not include or skipped:
            cards_read.append(card)
        if not skipped and path and (include or card.keyword in CARDS_WITH_INPUT):
            _collect(sources, sources.enter_file(path, place), path.strip().strip('"'), cards_read)
            sources.leave_file()


def _card(keyword_line: str, place: DeckPlace) -> Card:
    """The card of a keyword line."""
    head, *option_texts = _split_outside_quotes(keyword_line[1:])
    spaced = {}

    def without_spaces(spaced_name: str) -> str:
        name = "".join(spaced_name.split()).upper()
        spaced[name] = " ".join(spaced_name.split()).upper()
        return name

    keyword = without_spaces(head)
    options = {}
    for part in option_texts:
        words, _, value = part.partition("=")
        if name := without_spaces(words):
            options[name] = value.strip()
    return Card(keyword, options, place, spaced_names=spaced)


def _split_outside_quotes(text: str) -> list[str]:
    """Split a line at the commas outside quotes. The text must not contain zero bytes."""
    parts = text.split('"')
    parts[::2] = [part.replace(",", "\0") for part in parts[::2]]
    return '"'.join(parts).split("\0")


#: Cards that are read -> options that are read or harmless, with their values if not all are.
READ_OPTIONS = {
    "NODE": "NSET INPUT SYSTEM",
    "ELEMENT": "TYPE ELSET INPUT",
    "SYSTEM": "",
    "NSET": "NSET ELSET GENERATE UNSORTED INSTANCE INTERNAL INPUT",
    "ELSET": "ELSET GENERATE UNSORTED INSTANCE INTERNAL INPUT",
    "PART": "NAME",
    "INSTANCE": "NAME PART",
    "MATERIAL": "NAME",
    "ELASTIC": "TYPE DEPENDENCIES",
    "DENSITY": "DEPENDENCIES",
    "SOLIDSECTION": "ELSET MATERIAL ORIENTATION CONTROLS",
    "SHELLSECTION": "ELSET MATERIAL ORIENTATION COMPOSITE OFFSET NODALTHICKNESS SECTIONINTEGRATION "
    "POISSON TEMPERATURE CONTROLS LAYUP STACKDIRECTION THICKNESSMODULUS",
    "MEMBRANESECTION": "ELSET MATERIAL ORIENTATION OFFSET NODALTHICKNESS CONTROLS POISSON",
    "SHELLGENERALSECTION": "ELSET MATERIAL ORIENTATION COMPOSITE OFFSET NODALTHICKNESS POISSON "
    "DENSITY TEMPERATURE CONTROLS LAYUP STACKDIRECTION THICKNESSMODULUS",
    "BEAMSECTION": "ELSET MATERIAL SECTION OFFSET1 OFFSET2 POISSON TEMPERATURE CONTROLS LUMPED "
    "ROTARYINERTIA",
    "BEAMGENERALSECTION": "ELSET MATERIAL SECTION OFFSET1 OFFSET2",
    "NODALTHICKNESS": "",
    "ORIENTATION": "NAME SYSTEM DEFINITION",
    "TRANSFORM": "NSET TYPE=R",
    "BOUNDARY": "OP=MOD|NEW AMPLITUDE FIXED TYPE INPUT",
    "EQUATION": "INPUT",
    "MPC": "",
    "RIGIDBODY": "NSET ELSET REFNODE ROTNODE TIENSET PINNSET ISOTHERMAL POSITION=INPUT",
    "TIE": "NAME POSITIONTOLERANCE ADJUST TYPE",
    "SURFACE": "NAME TYPE INTERNAL",
    "COUPLING": "CONSTRAINTNAME REFNODE SURFACE ORIENTATION",
    "KINEMATIC": "",
    "DISTRIBUTING": "WEIGHTINGMETHOD=UNIFORM",
    "KINEMATICCOUPLING": "REFNODE ORIENTATION",
    "DISTRIBUTINGCOUPLING": "ELSET",
    "MASS": "ELSET",
    "ROTARYINERTIA": "ELSET ORIENTATION",
    "SPRING": "ELSET ORIENTATION",
    "DASHPOT": "ELSET ORIENTATION",
}
#: Card and option that would change the result -> what becomes of it.
REFUSED_OPTIONS = fate_table(
    refused={
        "a solid of layers": "SOLIDSECTION,COMPOSITE",
        "a half of the layers": "SHELLSECTION,SYMMETRIC",
        "a distribution of the thickness": "SHELLSECTION,SHELLTHICKNESS",
        "a limit of the surface": "COUPLING,INFLUENCERADIUS",
        "a change of the place of the reference node": "RIGIDBODY,POSITION",
        "a part of another analysis": "INSTANCE,LIBRARY",
        "a change of the equations between steps": "EQUATION,REMOVE EQUATION,REMOVEALL",
        "a sector: give the whole ring": "TIE,CYCLICSYMMETRY TIE,MULTISTAGE TIE,FLUIDPERIODIC",
        "in cylindrical axes: turn each node by its own": "TRANSFORM,TYPE",
        "a submodel": "BOUNDARY,SUBMODEL",
        "a nonlinear law": "SPRING,NONLINEAR DASHPOT,NONLINEAR",
    }
)
#: Cards that are also read in the first step.
STEP_CARDS = (
    *("NSET", "ELSET", "SURFACE", "BOUNDARY", "EQUATION", "MPC", "RIGIDBODY", "TIE", "COUPLING"),
    *("KINEMATIC", "DISTRIBUTING", "KINEMATICCOUPLING"),
)
#: Cards that generate nodes and elements and are not supported, of meshes neither.
GENERATOR_CARDS = ("NGEN", "NFILL", "ELGEN", "NCOPY", "ELCOPY", "NMAP")

_HARMLESS_CARDS = """
CONTACTPAIR CLEARANCE
HEADING PREPRINT RESTART PARAMETER ENDPART ENDINSTANCE ASSEMBLY ENDASSEMBLY ENDSTEP OUTPUT
NODEOUTPUT ELEMENTOUTPUT CONTACTOUTPUT ENERGYOUTPUT INCREMENTATIONOUTPUT MODALOUTPUT SURFACEOUTPUT
INTEGRATEDOUTPUT INTEGRATEDOUTPUTSECTION RADIATIONOUTPUT FILEOUTPUT FILEFORMAT NODEPRINT ELPRINT
FACEPRINT CONTACTPRINT ENERGYPRINT SECTIONPRINT MODALPRINT RADIATIONPRINT NODEFILE ELFILE
CONTACTFILE ENERGYFILE SECTIONFILE MODALFILE ELEMENTMATRIXOUTPUT MATRIXGENERATE MONITOR PRINT
DISPLAYBODY DIAGNOSTICS OUTPUTVARIABLES USEROUTPUTVARIABLES STATIC DYNAMIC FREQUENCY BUCKLE
MODALDYNAMIC STEADYSTATEDYNAMICS COMPLEXFREQUENCY VISCO GEOSTATIC SOILS ANNEAL RANDOMRESPONSE
RESPONSESPECTRUM DIRECTCYCLIC SUBSTRUCTUREGENERATE NOANALYSIS HEATTRANSFER
COUPLEDTEMPERATURE-DISPLACEMENT UNCOUPLEDTEMPERATURE-DISPLACEMENT DYNAMICTEMPERATURE-DISPLACEMENT
COUPLEDTHERMAL-ELECTRICAL MASSDIFFUSION ELECTROMAGNETICS CFD AMPLITUDE TIMEPOINTS CONTROLS
SOLVERCONTROLS SECTIONCONTROLS BULKVISCOSITY SELECTEIGENMODES RETAINEDNODALDOFS
SUBSTRUCTUREMATRIXOUTPUT SELECTCYCLICSYMMETRYMODES DISTRIBUTIONTABLE SURFACEINTERACTION
SURFACEBEHAVIOR FRICTION CONTACTDAMPING CONTACTCONTROLS CHANGEFRICTION CHANGECONTACTTYPE
CHANGESURFACEBEHAVIOR GAPCONDUCTANCE GAPHEATGENERATION GAPRADIATION CONTACTINCLUSIONS
CONTACTEXCLUSIONS CONTACTPROPERTYASSIGNMENT CONTACTINITIALIZATIONASSIGNMENT
CONTACTINITIALIZATIONDATA CONTACTCONTROLSASSIGNMENT CONTACTFORMULATION CONTACTSTABILIZATION
CONNECTORBEHAVIOR CONNECTORELASTICITY CONNECTORDAMPING CONNECTORFRICTION CONNECTORLOCK CONNECTORSTOP
CONNECTORCONSTITUTIVEREFERENCE PHYSICALCONSTANTS CONDUCTIVITY SPECIFICHEAT LATENTHEAT
SPECIFICGASCONSTANT INELASTICHEATFRACTION JOULEHEATFRACTION VIEWFACTOR CAVITYDEFINITION
VALUESATINFINITY ELECTRICALCONDUCTIVITY MAGNETICPERMEABILITY DIELECTRIC PIEZOELECTRIC FLUIDCONSTANTS
DEPVAR BOUNDARYF EQUATIONF TRANSFORMF SENSITIVITY OBJECTIVE DESIGNVARIABLES DESIGNRESPONSE
CONSTRAINT FEASIBLEDIRECTION FILTER
"""
_REFUSED_CARDS = {
    "general contact": "CONTACT",
    "a sector: give the whole ring": "CYCLICSYMMETRYMODEL",
    "a gap: join what touches": "GAP",
    "a nonstructural mass: raise the density": "NONSTRUCTURALMASS",
    "a submodel": "SUBMODEL",
    "a change of the model between steps": "MODELCHANGE",
    "a connector": "CONNECTORSECTION",
    "a fastener": "FASTENER FASTENERPROPERTY",
    "a joint between elements": "JOINT JOINTELASTICITY",
    "embedded elements": "EMBEDDEDELEMENT",
    "a coupling of shells and solids": "SHELLTOSOLIDCOUPLING",
    "a fluid": "FLUIDSECTION FLUIDSECTIONS FLUIDCAVITY BEAMFLUIDINERTIA AQUA",
    "a surface without stiffness": "SURFACESECTION",
    "a layer of glue or a gasket": "COHESIVESECTION GASKETSECTION",
    "a frame element": "FRAMESECTION",
    "a rigid surface": "RIGIDSURFACE",
    "a user element": "USERELEMENT UELPROPERTY",
    "a matrix": "MATRIXINPUT MATRIXASSEMBLE",
    "a substructure": "SUBSTRUCTUREPROPERTY",
    "a model of another analysis": "IMPORT SYMMETRICMODELGENERATION",
    "a change of the sections between steps": "CHANGESOLIDSECTION",
    "a change of a material between steps": "CHANGEMATERIAL",
    "an elastic foundation: use springs": "FOUNDATION",
    "a release of beams' ends": "RELEASE",
    "a distribution over elements": "DISTRIBUTION",
    "a change of the nodes' places": "IMPERFECTION",
    "added inertia of beams": "BEAMADDEDINERTIA",
    "an adjustment of the mass": "MASSADJUST",
    "reinforcement": "REBAR REBARLAYER",
    "a stiffness against transverse shear": "TRANSVERSESHEARSTIFFNESS",
    "a generator: write the nodes and elements out": " ".join(GENERATOR_CARDS),
}

CARD_FATES = fate_table(read=READ_OPTIONS, harmless=_HARMLESS_CARDS.split(), refused=_REFUSED_CARDS)
CARD_FATES["PRE-TENSIONSECTION"] = Fate("ignored", "whose bolt is whole, as it is once tightened,")


def account_for(cards: list[Card], name: str) -> Account:
    """The fate of each card of a deck; cards of the model and of the first step are read."""
    account = Account(name)
    count = 0
    step = -1
    for card in cards:
        if card.keyword == "STEP":
            count, step = count + 1, count
        fate = _fate_in_step(card.keyword, CARD_FATES.get(card.keyword, Fate()), step)
        account.cards.append((card.label, card.place, fate))
        if fate.kind == "read":
            for option in card.options:
                label = f"{card.label}, {card.spaced_names.get(option, option)}="
                account.options.append((label, card.place, _option_fate(card, option)))
        if card.keyword == "ENDSTEP":
            step = -1
    return account


def _fate_in_step(keyword: str, fate: Fate, step: int) -> Fate:
    """The fate of a card in step `step` (from 0; -1: outside steps)."""
    if step < 0 or keyword in ("NSET", "ELSET") or fate.kind not in ("read", "refused"):
        return fate
    if step > 0:
        return Fate("ignored", "of later steps")
    if fate.kind == "refused" or keyword in STEP_CARDS:
        return fate
    return Fate("refused", "in a step")


def _option_fate(card: Card, option: str) -> Fate:
    """The treatment of one option of a card; the card itself is read."""
    option_fates = dict(word.partition("=")[::2] for word in READ_OPTIONS[card.keyword].split())
    values = option_fates.get(option, "").split("|")
    value = "".join(card.option(option).split()).upper()
    if option in option_fates and (values == [""] or value in values):
        return Fate("read")
    return REFUSED_OPTIONS.get(f"{card.keyword},{option}", Fate())
