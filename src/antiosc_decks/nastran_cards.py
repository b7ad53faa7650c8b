"""Entries of Nastran's bulk data, in small, large and free fields, and the treatment of each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile, zip_longest
from typing import NamedTuple

from antiosc.base.errors import MeshError
from antiosc_decks.entries import DeckItem, DeckPlace, real_number, whole_number
from antiosc_decks.sources import Account, Fate, Sources, fate_table

#: Names of properties in comments of pre-processors: HyperMesh, ANSA, Femap.
PROPERTY_NAME_COMMENTS = (
    re.compile(r'\$HMNAME\s+PROP\s+(\d+)\s*"([^"]+)"'),
    re.compile(r"\$ANSA_NAME(?:_COMMENT)?;(\d+);P\w+;([^;]+);"),
    re.compile(r"\$ Femap(?: with NX Nastran)? Property (\d+) : (.+)"),
)
#: Entries with free text instead of fields.
FREE_TEXT_ENTRIES = ("DEQATN",)
LONG_LINE_REMEDY = """\
a line of free fields ends with the mark of the next line, and one of GRID has up to
8 fields after its name; write the further ones in a line of their own.""".replace("\n", " ")
#: Most copies of one entry.
MAX_COPIES = 1_000_000
#: A number without "+", since "+1" may mark a continuation.
_NUMBER_START = re.compile(r"-?\.?\d")
_CONTINUATION_MARK = re.compile(r"[+*][A-Za-z]")
_INCLUDE_LINE = re.compile(r"\s*INCLUDE\b\s*(.*)", re.IGNORECASE)
_SUBCASE_LINE = re.compile(r"\s*(SUBCASE|SUBCOM|SYM|SYMCOM|REPCASE)\b", re.IGNORECASE)
_SELECTED_SET = re.compile(r"\s*(SPC|MPC)\s*=\s*(\d+)\s*$", re.IGNORECASE)


@dataclass
class Entry(DeckItem):
    """One entry of bulk data: its name, and its fields without the name, eight for each line."""

    name: str
    place: DeckPlace
    fields: list[str] = field(default_factory=list)
    #: error of its lines; raised only if the entry is read
    fault: MeshError | None = None

    def text(self, k: int) -> str:
        """Field `k` (from 0) as text; "" if it is blank."""
        if k < len(self.fields):
            return self.fields[k].strip()
        return ""

    def words(self, first: int, stop: int | None = None) -> list[str]:
        """The fields from `first` to `stop` that are not blank."""
        return [word for field_text in self.fields[first:stop] if (word := field_text.strip())]

    def _required_text(self, k: int) -> str:
        """Field `k` as text; MeshError if it is blank."""
        self.needs(self.text(k), f"field {k + 2} of {self.name} is empty.")
        return self.text(k)

    def integer(self, k: int, default: int | None = None) -> int:
        """Field `k` as an integer; MeshError if it is not one, or blank without a default."""
        if default is not None and not self.text(k):
            return default
        return whole_number(self._required_text(k), self.place)

    def property_number(self) -> int:
        """Number of an element's property; if blank, that of the element itself."""
        if self.name == "CONROD":
            return 0
        return self.integer(1, self.integer(0))

    def find_property(self, name: str, known: dict[int, Entry]) -> Entry:
        """The property entry of an element, among those of the card `name`."""
        number = self.property_number()
        return self.place.look_up(known, number, f"{self.name} has no {name} {number}.")

    def real(self, k: int, default: float | None = 0.0) -> float:
        """Field `k` as a number; MeshError if it is not a number, or blank without a default."""
        if default is not None and not self.text(k):
            return default
        return real_number("".join(self._required_text(k).split()), self.place)

    def reals(self, first: int, stop: int) -> list[float]:
        """The numbers of fields `first` to `stop`; 0 if blank."""
        return [self.real(k) for k in range(first, stop)]


def motions_of(text: str, place: DeckPlace) -> list[int]:
    """Motions 0 to 5 of components such as "123" or "1 2 3"; none for "0" and ""."""
    digits = "".join(text.split())
    place.require(set(digits) <= set("0123456"), f"{text!r} are not components from 1 to 6.")
    return sorted({int(c) - 1 for c in digits} - {-1})


class Continuations:
    """Finds the entry that a continuation line continues: by its mark, or by the order of lines."""

    def __init__(self) -> None:
        #: mark -> entries whose last line ends with it, by identity
        self._open: dict[str, dict[int, Entry]] = {}
        #: identity of an entry -> the marks of its last line
        self._marks: dict[int, tuple[str, ...]] = {}
        self._last: Entry | None = None
        #: continuations that were joined to the entry before them, which has no mark
        self._by_order: list[tuple[Entry, MeshError]] = []

    def note_end(self, entry: Entry, mark: str) -> None:
        """Note that the last line of the last entry, `entry`, ends with `mark`."""
        self._last = entry
        label = mark.strip().upper()
        # without a sign, the first letter stands for one
        marks = (label[1:].strip(),) if label[:1] in ("+", "*") else (label, label[1:])
        if any(marks):
            self._marks[id(entry)] = marks
            for key in filter(None, marks):
                self._open.setdefault(key, {})[id(entry)] = entry

    def entry_of(self, name: str, place: DeckPlace) -> Entry:
        """The entry that a line with the first field `name` continues."""
        label = name[1:].strip().upper()
        entry = self._last
        if entry is None:
            raise place.error("a continuation without an entry before it.")
        marks = self._marks.get(id(entry), ())
        if label and label not in marks:
            candidates = list(self._open.get(label, {}).values())
            lost = f"the continuation {name[:20]!r} does not follow its entry"
            error = place.error(f"{lost}; write it behind the line that ends with its mark.")
            if len(candidates) == 1:
                entry = candidates[0]
            elif candidates or marks:
                entry.fault = error
            else:
                self._by_order.append((entry, error))
        for key in filter(None, self._marks.pop(id(entry), ())):
            del self._open[key][id(entry)]
        return entry

    def mark_lost(self) -> None:
        """Set the faults of entries whose continuation was joined by order but not by mark."""
        waiting = any(len(lines) == 1 and lines[0] for lines in self._marks.values())
        for entry, error in self._by_order if waiting else ():
            entry.fault = entry.fault or error


class BulkData:
    """The entries of a deck and of its included files."""

    def __init__(self, sources: Sources) -> None:
        self.entries: list[Entry] = []
        #: number of a property -> its name in a comment
        self.names: dict[int, str] = {}
        #: warnings, one sentence each
        self.remarks: list[str] = []
        #: selections of the case control, if there is one: (SPC or MPC, number of the subcase;
        #: 0: above all subcases) -> set
        self.selected: dict[tuple[str, int], int] | None = None
        self._subcase = 0
        self._sources = sources
        lines = sources.main_lines()
        # a file without case control contains only bulk data
        self._started = not any(_is_begin_bulk(line.split("$")[0]) for line in lines)
        self._ended = False
        self._continuations = Continuations()
        #: whether the next line continues a list of free fields
        self._continued = False
        #: changes of the fields of the last copied entry
        self._changes: list[str] | None = None
        self._read_lines(lines, sources.name)
        if not self.entries:
            raise MeshError(f"{sources.name} contains no bulk data (GRID, CHEXA, …).")
        self._continuations.mark_lost()

    def _read_lines(self, lines: list[str], file: str) -> None:
        """Read the lines of one file."""
        number = 0
        while number < len(lines) and not self._ended:
            number += 1
            line = lines[number - 1]
            place = DeckPlace(file, number)
            line, comment, text = line.partition("$")
            for pattern in PROPERTY_NAME_COMMENTS if comment else ():
                if noted := pattern.match("$" + text):
                    self.names[int(noted[1][:18])] = noted[2].strip()
            line = line.rstrip()
            if not line.strip():
                continue
            if match := _INCLUDE_LINE.match(line):
                file_name = match[1].strip()
                while file_name[:1] in "'\"" and file_name and file_name.count(file_name[0]) < 2:
                    if number >= len(lines):  # the name ends at its quote
                        break
                    file_name += lines[number].strip()
                    number += 1
                try:
                    included = self._sources.enter_file(file_name, place)
                except MeshError as error:
                    if self._started:
                        raise
                    self.remarks.append(f"{error} It is not read: it stands before the bulk data.")
                    continue
                self._read_lines(included, file_name.strip("'\" "))
                self._sources.leave_file()
            elif not self._started:
                self._read_control(line)
            else:
                self._read_line(line.expandtabs(8), place)

    def _read_control(self, line: str) -> None:
        """Read a line of the case control section."""
        if _is_begin_bulk(line):
            self._started = True
            return
        self.selected = self.selected or {}
        self._subcase += bool(_SUBCASE_LINE.match(line))
        if match := _SELECTED_SET.match(line):
            self.selected[match[1].upper(), self._subcase] = int(match[2][:18])

    def _read_line(self, line: str, place: DeckPlace) -> None:
        """Read a line of bulk data."""
        words = line.upper().split()
        if words[0].startswith("ENDDATA"):
            self._ended = True
            return
        if words[0] == "BEGIN":  # of superelements, after the first
            if words[1:] != ["BULK"]:
                raise place.error("superelements are not read here: write the elements out.")
            return
        continued = self._continued
        self._continued = "," in line and line.endswith(",")
        if continued and words[0][0].isdigit() and "," in line:
            line = "," + line

        if words[0].startswith(FREE_TEXT_ENTRIES):
            self._begin_entry(Entry(words[0][:6], place))
            return
        if self.entries and self.entries[-1].name in FREE_TEXT_ENTRIES and line[0] in " +*,":
            return
        name, fields, large, mark = fields_of(line)
        is_long = name == "GRID" and any(fields[8:])
        is_long |= any(map(_CONTINUATION_MARK.match, fields[4:]))
        fault = place.error(LONG_LINE_REMEDY) if is_long else None

        if name[:1] == "=":
            self._copy_last(words[0].split(",")[0], fields, place)
        elif name[:1] in ("", "+", "*"):
            entry = self._continuations.entry_of(name, place)
            filled = -len(entry.fields) % 8
            if filled and not (large and filled == 4):
                entry.fields += [""] * filled
            entry.fields += fields
            entry.fault = entry.fault or fault
            self._continuations.note_end(entry, mark)
        elif name[0].isalpha():
            self._begin_entry(Entry(name.rstrip("*").strip().upper(), place, fields, fault), mark)
        else:
            fault = place.error(f"{name[:20]!r} is not an entry of Nastran's bulk data.")
            if not self.entries:
                raise fault
            self.entries[-1].fault = fault

    def _begin_entry(self, entry: Entry, mark: str = "") -> None:
        """Begin an entry."""
        self.entries.append(entry)
        self._continuations.note_end(entry, mark)

    def _copy_last(self, name: str, fields: list[str], place: DeckPlace) -> None:
        """Copy the last entry: = repeats a field, == the remaining ones, *(2) adds 2."""
        place.require(self.entries, "a copy (=) without an entry before it.")
        times = 1
        if name != "=":
            times = whole_number(name[1:].strip("()"), place)
            allowed = 0 < times <= MAX_COPIES and self._changes is not None
            place.require(allowed, f"{name[:20]!r} repeats no copy, or one too often.")
        else:
            self._changes = [*takewhile(lambda word: word != "==", fields)]
        changes = self._changes or []
        for _ in range(times):
            last = self.entries[-1]
            pairs = zip_longest(last.fields, changes[: len(last.fields)], fillvalue="=")
            fields = [_changed_field(*pair, place) for pair in pairs]
            self._begin_entry(Entry(last.name, place, fields))


def _is_begin_bulk(line: str) -> bool:
    """Whether bulk data begins after this line."""
    return line.upper().split()[:2] == ["BEGIN", "BULK"]


def _changed_field(old: str, change: str, place: DeckPlace) -> str:
    """The field `old` of a copied entry after `change`: "=", "*(step)" or the new text."""
    if not change.startswith("*"):
        return old if change == "=" else change
    step = change[1:].strip("() ")
    if "." in step:
        return repr(real_number(old or "0", place) + real_number(step, place))
    return str(whole_number(old or "0", place) + whole_number(step, place))


def fields_of(line: str) -> tuple[str, list[str], bool, str]:
    """(name, fields, whether they are large, mark of the continuation) of a line."""
    if "," in line:
        first, *other_parts = (part.strip() for part in line.split(","))
        first, *other_fields = first.split() if first[:1].isalpha() else [first]
        other_parts = [*other_fields, *other_parts]  # blanks separate free fields, too
        large = first.endswith("*") or first.startswith("*")
        count = 4 if large else 8
        mark = "".join(other_parts[count : count + 1])
        if any(other_parts[count + 1 :]) or _NUMBER_START.match(mark):  # as long as the entry
            return first, other_parts + [""] * (-len(other_parts) % count), large, ""
        return first, (other_parts + [""] * count)[:count], large, mark
    name = line[:8].strip()
    large = "*" in name
    width, count = (16, 4) if large else (8, 8)
    body = line[8 : 8 + width * count].ljust(width * count)
    fields = [body[k * width : (k + 1) * width].strip() for k in range(count)]
    return name, fields, large, line[72:80]


def thru_ranges(words: list[str], place: DeckPlace) -> Iterator[tuple[int, int]]:
    """Yield (first, last) of the ranges in a list with THRU; a single number is a range of one."""
    words = [word for word in words if word]
    k = 0
    while k < len(words):
        first = last = whole_number(words[k], place)
        if k + 2 < len(words) and words[k + 1].upper() == "THRU":
            last = whole_number(words[k + 2], place)
            k += 2
        k += 1
        yield first, last


class CellFormat(NamedTuple):
    """Rules for reading an element that is a cell of a mesh; fields count from 0."""

    #: a key of `antiosc.io.neutral.EDGES`
    shape: str
    role: str
    #: property cards that may give its section
    properties: tuple[str, ...]
    #: index of the middle node on each edge; () if it has none
    middles: tuple[int, ...] = ()
    #: field of its first node
    first: int = 2
    #: fields of THETA or MCID, ZOFFS and TFLAG of a shell
    theta: int = 0
    offset: int = 0
    flag: int = 9


_SOLID_ROLE = ("solid", ("PSOLID", "PCOMPS"))
_SHELL_ROLE = ("shell", ("PSHELL", "PCOMP", "PCOMPG"))
#: Properties of beams.
BEAM_PROPERTIES = ("PBAR", "PBARL", "PBEAM", "PBEAML")
_BEAM_CELL = CellFormat("line", "beam", BEAM_PROPERTIES)
_ROD_CELL = CellFormat("line", "rod", ("PROD",))
_PYRAMID_CELL = CellFormat("pyramid", *_SOLID_ROLE, tuple(range(8)))
#: Element that is a cell -> how it is read. Nastran lists the middles of the upright edges of a
#: solid before those of its top.
CELL_FORMATS = {
    "CTETRA": CellFormat("tetra", *_SOLID_ROLE, tuple(range(6))),
    "CPYRAM": _PYRAMID_CELL,
    "CPYRA": _PYRAMID_CELL,
    "CPENTA": CellFormat("wedge", *_SOLID_ROLE, (0, 1, 2, 6, 7, 8, 3, 4, 5)),
    "CHEXA": CellFormat("hexahedron", *_SOLID_ROLE, (0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7)),
    **dict.fromkeys(
        ("CTRIA3", "CTRIAR", "CTRIA3K"), CellFormat("triangle", *_SHELL_ROLE, theta=5, offset=6)
    ),
    "CTRIA6": CellFormat("triangle", *_SHELL_ROLE, (0, 1, 2), theta=8, offset=9, flag=13),
    **dict.fromkeys(
        ("CQUAD4", "CQUADR", "CQUAD4K"), CellFormat("quad", *_SHELL_ROLE, theta=6, offset=7)
    ),
    "CQUAD8": CellFormat("quad", *_SHELL_ROLE, (0, 1, 2, 3), theta=14, offset=15, flag=16),
    **dict.fromkeys(("CBAR", "CBEAM"), _BEAM_CELL),
    "CROD": _ROD_CELL,
    "CTUBE": _ROD_CELL._replace(properties=("PTUBE",)),
    "CONROD": _ROD_CELL._replace(properties=("PROD",), first=1),
}
#: Entries that define several items in one line -> number of fields of each item.
FIELDS_PER_ITEM = dict.fromkeys(("CORD1R", "CORD1C", "CORD1S", "PELAS"), 4)
FIELDS_PER_ITEM |= dict.fromkeys(("PDAMP", "PMASS"), 2)
#: Fields of CBAR and CBEAM that are blank together: property, orientation, offsets' axes.
_BAR_DEFAULT_FIELDS = ((1,), (4, 5, 6), (7,))
#: Entry -> (entry with its defaults, groups of fields that take them if all of a group are blank).
DEFAULT_ENTRIES = {
    "GRID": ("GRDSET", ((1,), (5,), (6,))),
    "CBAR": ("BAROR", _BAR_DEFAULT_FIELDS),
    "CBEAM": ("BEAMOR", _BAR_DEFAULT_FIELDS),
}
#: Properties that give sections.
SECTION_PROPERTIES = tuple(
    dict.fromkeys(name for cell in CELL_FORMATS.values() for name in cell.properties)
)
#: Elements that are read but are not cells of a mesh.
NON_CELL_ELEMENTS = (
    *(f"{kind}{k}" for kind in ("CELAS", "CDAMP", "CMASS") for k in (1, 2, 3, 4)),
    *("CONM2", "CBUSH", "CBUSH1D", "RBE2", "RBE3", "RBAR"),
)
#: Material, element or property -> the field (from 0) of its damping GE.
DAMPING_FIELDS = {"MAT1": 7, "MAT2": 12, "MAT8": 16, "MAT9": 30}
DAMPING_FIELDS |= dict.fromkeys(("PCOMP", "PCOMPG", "CELAS2"), 6)
#: Elements without a counterpart here, as are those that begin with C and are in no list.
UNSUPPORTED_ELEMENTS = """
RBE1 RBAR1 RROD RTRPLT RTRPLT1 RSPLINE RJOINT RSSCON CFAST CWELD CSEAM CBEAM3 CBUSH2D CDAMP5 CTRIAX
CTRIAX6 CTRAX3 CTRAX6 CQUADX CQUADX4 CQUADX8 CQUAD CPLSTN3 CPLSTN4 CPLSTN6 CPLSTN8 CPLSTS3 CPLSTS4
CPLSTS6 CPLSTS8 CHACAB CHACBR CAABSF CFLUID2 CFLUID3 CFLUID4 CRAC2D CRAC3D
"""

_OTHER_READ_ENTRIES = """
GRID GRDSET SPOINT CORD1R CORD1C CORD1S CORD2R CORD2C CORD2S BAROR BEAMOR PELAS PDAMP
PBUSH PBUSH1D PMASS MAT1 MAT2 MAT8 MAT9 MAT11 SPC SPC1 SPCADD MPC MPCADD PARAM
"""
_HARMLESS_ENTRIES = """
ECHOON ECHOOFF MDLPRM PLOTEL PLOTEL3 PLOTEL4 PLOTEL6 PLOTEL8 PLOTTET PLOTPYR PLOTPEN PLOTHEX POINT
SEQGP CNGRNT SNORM MATCID CBARAO TABLE3D SET1 SET2 SET3 SPCOFF SPCOFF1 ASET ASET1 BSET BSET1 CSET
CSET1 OMIT OMIT1 QSET QSET1 USET USET1 BNDFIX BNDFIX1 BNDFREE BNDFREE1 SESET SEBSET SEBSET1 SECSET
SECSET1 SEQSET SEQSET1 SEUSET SEUSET1 SESUP SETREE SEEXCLD SELABEL SENQSET SELOAD EIGB EIGC EIGP
EIGR EIGRL MODTRAK DYNRED DTI FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 FREQ6 TSTEP TSTEP1 TSTEPNL NLPARM
NLPCI NLSTEP NLCNTL NLCNTL2 NLCNTLG NLADAPT NLOUT NLMOPTS NXSTRAT ITER TABDMP1 TABLED1 TABLED2
TABLED3 TABLED4 TABLED5 TABLEM1 TABLEM2 TABLEM3 TABLEM4 TABLES1 TABLEST TABLEH1 TABLEHT TABRND1
TABRNDG RANDPS RANDT1 DELAY DPHASE LSEQ DESVAR DRESP1 DRESP2 DRESP3 DCONSTR DCONADD DVPREL1 DVPREL2
DVMREL1 DVMREL2 DVCREL1 DVCREL2 DVTREL1 DVGRID DVBSHAP DVSHAP DLINK DEQATN DTABLE DOPTPRM DSCREEN
DDVAL TOPVAR DMNCON GROUP DTPG AERO AEROS AECOMP AECOMPL AEFACT AELINK AELIST AEPARM AESTAT AESURF
AESURFS AEDW AEFORCE AEPRESS CAERO1 CAERO2 CAERO3 CAERO4 CAERO5 CAERO7 PAERO1 PAERO2 PAERO3 PAERO4
PAERO5 FLFACT FLUTTER MKAERO1 MKAERO2 SPLINE1 SPLINE2 SPLINE3 SPLINE4 SPLINE5 SPLINE6 SPLINE7 TRIM
TRIM2 DIVERG UXVEC CSSCHD MONPNT1 MONPNT2 MONPNT3 MONDSP1 ROTORG ROTORD MAT4 MAT5 RADM RADBC RADCAV
RADLST RADMTX RADSET VIEW VIEW3D CONV CONVM PCONV PCONVM PHBDY DMI DMIJ DMIJI DMIK
PBEND PSHEAR PGAP PVISC PQUAD1 PQUAD2 PTRIA1 PTRIA2 PQDMEM PQDMEM1 PQDMEM2 PTRMEM PIHEX
PFAST PWELD PSEAM PBEAM3 PBUSH2D PDAMP5 PRAC2D PRAC3D PLPLANE PPLANE PLSOLID PCOMPLS PBCOMP PBMSECT
PBRSECT PCONEAX PMIC PACABS PAABSF PACBAR PGPLSN MAT3 MAT10 MAT3D MATG MATHE MATHP MATEV MATPOR
BCPARA BCTPARA BCTPARM BCRPARA BFRIC BSURF BSURFS BCPROP BCPROPS BLSEG BCMATL BCRGSRF BCNURBS
"""
#: Cards of contact, which are ignored when one piece of the deck is read alone.
CONTACT_ENTRIES = (
    *("BCTABLE", "BCTABL1", "BCONTACT", "BCONECT", "BCONP", "BCTSET", "BCTADD", "BCBODY"),
    *("BCBODY1", "BCGRID", "BCRIGID"),
)
_REFUSED_ENTRIES = {
    "contact": " ".join(CONTACT_ENTRIES),
    "glue": "BGSET BGADD BGPARM",
    "a matrix": "DMIG DMIAX TF",
    "a superelement: write the elements out": "CSUPER CSUPEXT RELEASE SEMPLN SEELT SEBNDRY SEBULK "
    "SECONCT SELOC",
    "an entry of NASTRAN of the 1970s: give it as that of today": "CQUAD1 CQUAD2 CQDMEM CQDMEM1 "
    "CQDMEM2 CTRIA1 CTRIA2 CTRMEM CIHEX1 CIHEX2 CHEXA1 CHEXA2 CWEDGE CRIGD1 CRIGD2",
    "a shear panel: give it as a thin CQUAD4": "CSHEAR",
    "a curved beam: give it as straight ones": "CBEND",
    "a gap: join what touches": "CGAP",
    "a nonstructural mass: give it in the property, or as CONM2": "NSM NSM1 NSML NSML1 NSMADD",
    "a matrix of masses: give it as CONM2": "CONM1",
    "a stiffness matrix": "GENEL",
    "the mass of a fluid": "MFLUID ELIST FLSYM FSLIST",
    "an axisymmetric model": "AXIC AXIF RINGAX RINGFL GRIDB CYAX CYJOIN CYSUP CYSYM SECTAX",
    "a support of edges or surfaces": "SPCAX GMSPC GMBC GMBNDC FEEDGE FEFACE",
    "a generator of nodes or elements": "CGEN GRIDG EGRID",
}

#: Free in normal modes (SOL 103), fixed in those of a Craig–Bampton reduction.
_SUPORT_FATE = Fate("ignored", "(what it supports stays free)")

ENTRY_FATES = fate_table(
    read=(*_OTHER_READ_ENTRIES.split(), *CELL_FORMATS, *SECTION_PROPERTIES, *NON_CELL_ELEMENTS),
    harmless=_HARMLESS_ENTRIES.split(),
    refused=_REFUSED_ENTRIES | {"": UNSUPPORTED_ELEMENTS},
)
#: Loads that begin as elements do.
ENTRY_FATES |= dict.fromkeys(("CLOAD", "CREEP", "CHBDY", "CHBDYE", "CHBDYG", "CHBDYP"), Fate())
ENTRY_FATES |= dict.fromkeys(("SUPORT", "SUPORT1"), _SUPORT_FATE)


def fate_of(name: str) -> Fate:
    """The fate of the entries called `name`; unknown elements are refused."""
    return ENTRY_FATES.get(name, Fate("refused") if name.startswith("C") else Fate())


def is_non_cell(name: str) -> bool:
    """Whether entries called `name` are elements but not cells of a mesh."""
    return name in NON_CELL_ELEMENTS or name.startswith("CHBDY") or fate_of(name).kind == "refused"


def account_for(entries: Sequence[Entry], name: str) -> Account:
    """The fate of each entry of a deck."""
    return Account(name, [(entry.name, entry.place, fate_of(entry.name)) for entry in entries])


def split_items(entries: Sequence[Entry]) -> list[Entry]:
    """The entries, each split so that it defines one item."""
    separate = []
    for entry in entries:
        if (width := FIELDS_PER_ITEM.get(entry.name)) is None:
            separate.append(entry)
            continue
        starts = (k for k in range(0, 8, width) if entry.text(k))
        separate += [replace(entry, fields=entry.fields[k : k + width]) for k in starts]
    return separate


def fill_defaults(entries: Sequence[Entry]) -> None:
    """Fill blank fields with the defaults (BAROR, GRDSET, …)."""
    names = {name for name, _ in DEFAULT_ENTRIES.values()}
    defaults = {entry.name: entry for entry in entries if entry.name in names}
    for entry in entries if defaults else ():
        name, groups = DEFAULT_ENTRIES.get(entry.name, ("", ()))
        if default := defaults.get(name):
            entry.fields += [""] * (8 - len(entry.fields))
            for group in groups:
                if not any(entry.text(k) for k in group):
                    if group in ((1,), (5,)):  # numbers of properties and systems
                        default.integer(group[0], 0)
                    entry.fields[group[0] : group[-1] + 1] = [default.text(k) for k in group]


def report_damping(account: Account, entries: Sequence[Entry]) -> None:
    """Report the damping of materials (GE) and of the structure (PARAM,G) as ignored."""
    for entry in entries:
        field = DAMPING_FIELDS.get(entry.name)
        if entry.name == "PARAM" and entry.text(0).upper() == "G":
            field = 1
        if field is not None and entry.real(field):
            label = f"{'PARAM,G' if field == 1 else f'GE of {entry.name}'}, damping"
            account.options.append((label, entry.place, Fate("ignored")))
