"""What becomes of the entries of Nastran's bulk data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from antiosc_decks.account import UNKNOWN, Account, Fate, table
from antiosc_decks.nastran.cards import Entry


class Cell(NamedTuple):
    """An element that is a cell of a mesh, and the places of its fields (from 0)."""

    #: a key of `antiosc.io.neutral.EDGES`
    shape: str
    role: str
    #: those that give its section
    properties: tuple[str, ...]
    #: which of its middle nodes lies on each edge; () without such
    middles: tuple[int, ...] = ()
    #: of its first node
    first: int = 2
    #: of a shell: THETA or MCID, ZOFFS, TFLAG
    theta: int = 0
    offset: int = 0
    flag: int = 9


_SOLID, _SHELL = ("solid", ("PSOLID", "PCOMPS")), ("shell", ("PSHELL", "PCOMP", "PCOMPG"))
#: Properties of beams.
BEAMS = ("PBAR", "PBARL", "PBEAM", "PBEAML", "PBEND")
_BEAM = Cell("line", "beam", BEAMS[:4])
_ROD = Cell("line", "rod", ("PROD",))
_PYRAMID = Cell("pyramid", *_SOLID, tuple(range(8)))
#: Nastran lists the middles of the upright edges of solids before those of the top.
CELLS = {
    "CTETRA": Cell("tetra", *_SOLID, tuple(range(6))),
    "CPYRAM": _PYRAMID,
    "CPYRA": _PYRAMID,
    "CPENTA": Cell("wedge", *_SOLID, (0, 1, 2, 6, 7, 8, 3, 4, 5)),
    "CHEXA": Cell("hexahedron", *_SOLID, (0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7)),
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CTRIA3K"), Cell("triangle", *_SHELL, theta=5, offset=6)),
    "CTRIA6": Cell("triangle", *_SHELL, (0, 1, 2), theta=8, offset=9, flag=13),
    **dict.fromkeys(("CQUAD4", "CQUADR", "CQUAD4K"), Cell("quad", *_SHELL, theta=6, offset=7)),
    "CQUAD8": Cell("quad", *_SHELL, (0, 1, 2, 3), theta=14, offset=15, flag=16),
    **dict.fromkeys(("CBAR", "CBEAM"), _BEAM),
    "CBEND": _BEAM._replace(properties=BEAMS[4:]),
    "CROD": _ROD,
    "CTUBE": _ROD._replace(properties=("PTUBE",)),
    "CONROD": _ROD._replace(properties=("PROD",), first=1),
    "CSHEAR": Cell("quad", "panel", ("PSHEAR",)),
}
#: Entries that are read as the nearest that is here -> what of them is not taken.
NEAREST = {
    **dict.fromkeys(("CTRIA3K", "CQUAD4K"), "the rigidity in transverse shear of {} {}"),
    "BEGIN SUPER": "the reduction of {} superelements ({}), the whole that they divide is read",
}
_PLATE, _MEMBRANE = (0, 1, 2, 1, None, 1, None, 3), (0, 1, 2, None, None, None, None, 3)
#: Entries of older versions -> those that they are now, and which of the older fields is in each of
#: the newer ones; () where they are the same, and for those that `renew` names.
OLDER: dict[str, tuple[str, tuple[int | None, ...]]] = {
    **dict.fromkeys(("CQUAD1", "CQUAD2", "CQDMEM", "CQDMEM1", "CQDMEM2"), ("CQUAD4", ())),
    **dict.fromkeys(("CTRIA1", "CTRIA2", "CTRMEM"), ("CTRIA3", ())),
    **dict.fromkeys(("CIHEX1", "CIHEX2", "CHEXA1", "CHEXA2"), ("CHEXA", ())),
    **dict.fromkeys(("PQUAD1", "PTRIA1"), ("PSHELL", ())),
    **dict.fromkeys(("PQUAD2", "PTRIA2"), ("PSHELL", _PLATE)),
    **dict.fromkeys(("PQDMEM", "PQDMEM1", "PQDMEM2", "PTRMEM"), ("PSHELL", _MEMBRANE)),
    **{"CWEDGE": ("CPENTA", ()), "PIHEX": ("PSOLID", (0, 1, 2)), "CRIGD1": ("RBE2", ())},
    "CRIGD2": ("CRIGD2", ()),
}
#: Of these, elements that name their material.
OF_MATERIAL = ("CHEXA1", "CHEXA2", "CWEDGE")
#: Properties that give sections.
PROPERTIES = tuple(dict.fromkeys(name for cell in CELLS.values() for name in cell.properties))
#: Elements that are read, but are no cells of a mesh.
BESIDE = (
    *(f"{kind}{k}" for kind in ("CELAS", "CDAMP", "CMASS") for k in (1, 2, 3, 4)),
    *("CONM1", "CONM2", "CVISC", "CBUSH", "CBUSH1D", "CGAP", "RBE2", "RBE3", "RBAR"),
)
#: Material, element or property -> the field (from 0) of its damping GE.
DAMPING = {"MAT1": 7, "MAT2": 12, "MAT8": 16, "MAT9": 30, "PCOMP": 6, "PCOMPG": 6, "CELAS2": 6}
#: Elements without a counterpart; names that begin with C and are in no list are such, too.
NO_COUNTERPART = (
    *("RBE1", "RBAR1", "RROD", "RTRPLT", "RTRPLT1", "RSPLINE", "RJOINT", "RSSCON"),
    *("CFAST", "CWELD", "CSEAM", "CBEAM3", "CBUSH2D"),
    *("CDAMP5", "CTRIAX", "CTRIAX6", "CTRAX3", "CTRAX6", "CQUADX", "CQUADX4", "CQUADX8", "CQUAD"),
    *("CPLSTN3", "CPLSTN4", "CPLSTN6", "CPLSTN8", "CPLSTS3", "CPLSTS4", "CPLSTS6", "CPLSTS8"),
    *("CHACAB", "CHACBR", "CAABSF", "CFLUID2", "CFLUID3", "CFLUID4", "CRAC2D", "CRAC3D"),
)

_READ = """
GRID GRDSET SPOINT CORD1R CORD1C CORD1S CORD2R CORD2C CORD2S BAROR BEAMOR
PGAP PELAS PDAMP PVISC PBUSH PBUSH1D PMASS MAT1 MAT2 MAT8 MAT9 MAT11 SPC SPC1 SPCADD MPC MPCADD
NSM NSM1 NSML NSML1 NSMADD PARAM SEBULK SECONCT SELOC
"""
_HARMLESS = """
ECHOON ECHOOFF MDLPRM PLOTEL PLOTEL3 PLOTEL4 PLOTEL6 PLOTEL8 PLOTTET PLOTPYR PLOTPEN PLOTHEX
POINT SEQGP CNGRNT SNORM MATCID CBARAO TABLE3D
SET1 SET2 SET3 SPCOFF SPCOFF1
ASET ASET1 BSET BSET1 CSET CSET1 OMIT OMIT1 QSET QSET1 USET USET1 BNDFIX BNDFIX1 BNDFREE BNDFREE1
SESET SEBSET SEBSET1 SECSET SECSET1 SEQSET SEQSET1 SEUSET SEUSET1 SESUP SETREE SEEXCLD SELABEL
SENQSET SELOAD
EIGB EIGC EIGP EIGR EIGRL MODTRAK DYNRED DTI
FREQ FREQ1 FREQ2 FREQ3 FREQ4 FREQ5 FREQ6 TSTEP TSTEP1 TSTEPNL NLPARM NLPCI NLSTEP NLCNTL NLCNTL2
NLCNTLG NLADAPT NLOUT NLMOPTS NXSTRAT ITER
TABDMP1 TABLED1 TABLED2 TABLED3 TABLED4 TABLED5 TABLEM1 TABLEM2 TABLEM3 TABLEM4 TABLES1 TABLEST
TABLEH1 TABLEHT TABRND1 TABRNDG RANDPS RANDT1 DELAY DPHASE LSEQ
DESVAR DRESP1 DRESP2 DRESP3 DCONSTR DCONADD DVPREL1 DVPREL2 DVMREL1 DVMREL2 DVCREL1 DVCREL2
DVTREL1 DVGRID DVBSHAP DVSHAP DLINK DEQATN DTABLE DOPTPRM DSCREEN DDVAL TOPVAR DMNCON GROUP DTPG
AERO AEROS AECOMP AECOMPL AEFACT AELINK AELIST AEPARM AESTAT AESURF AESURFS AEDW AEFORCE AEPRESS
CAERO1 CAERO2 CAERO3 CAERO4 CAERO5 CAERO7 PAERO1 PAERO2 PAERO3 PAERO4 PAERO5 FLFACT FLUTTER MKAERO1
MKAERO2 SPLINE1 SPLINE2 SPLINE3 SPLINE4 SPLINE5 SPLINE6 SPLINE7 TRIM TRIM2 DIVERG UXVEC CSSCHD
MONPNT1 MONPNT2 MONPNT3 MONDSP1 ROTORG ROTORD
MAT4 MAT5 RADM RADBC RADCAV RADLST RADMTX RADSET VIEW VIEW3D CONV CONVM PCONV PCONVM PHBDY
DMI DMIJ DMIJI DMIK
BCPARA BCTPARA BCTPARM BCRPARA BFRIC BSURF BSURFS BCPROP BCPROPS BLSEG BCMATL BCRGSRF BCNURBS
"""
_IGNORED = """
FORCE FORCE1 FORCE2 MOMENT MOMENT1 MOMENT2 PLOAD PLOAD1 PLOAD2 PLOAD4 PLOADX1 GRAV ACCEL ACCEL1
RFORCE RFORCE1 SPCD SPCR SPCN LOAD CLOAD LOADCYN LOADCYH LOADCYT LOADT DLOAD SLOAD DEFORM
TLOAD1 TLOAD2 RLOAD1 RLOAD2 DAREA ACSRCE TIC TICD GUST CHBDYE CHBDYG CHBDYP CHBDY
NOLIN1 NOLIN2 NOLIN3 NOLIN4 EPOINT
TEMP TEMPD TEMPP1 TEMPP3 TEMPRB TEMPB3 TEMPBC TEMPF TEMPG QBDY1 QBDY2 QBDY3 QHBDY QVECT QVOL
BOLT BOLTFOR BOLTFRC BOLTLD BOLTSEQ
MATS1 MATT1 MATT2 MATT3 MATT4 MATT5 MATT8 MATT9 CREEP MATDMG MATPLCY PELAST PBUSHT PDAMPT
"""
_REFUSED = {
    "contact": "BCTABLE BCTABL1 BCONTACT BCONECT BCONP BCTSET BCTADD BCBODY BCBODY1 BCGRID BCRIGID",
    "glue": "BGSET BGADD BGPARM",
    "a matrix": "DMIG DMIAX TF",
    "a superelement": "BEGIN CSUPER CSUPEXT RELEASE SEMPLN SEELT SEBNDRY",
    "a stiffness matrix": "GENEL",
    "the mass of a fluid": "MFLUID ELIST FLSYM FSLIST",
    "an axisymmetric model": "AXIC AXIF RINGAX RINGFL GRIDB CYAX CYJOIN CYSUP CYSYM SECTAX",
    "a support of edges or surfaces": "SPCAX GMSPC GMBC GMBNDC FEEDGE FEFACE",
    "a generator of nodes or elements": "CGEN GRIDG EGRID",
}
#: Properties and materials of elements that are refused; one that is read and names them says so.
_OF_OTHERS = """
PFAST PWELD PSEAM PBEAM3 PBUSH2D PDAMP5 PRAC2D PRAC3D PLPLANE PPLANE
PLSOLID PCOMPLS PBCOMP PBMSECT PBRSECT PCONEAX PMIC PACABS PAABSF PACBAR PGPLSN
MAT3 MAT10 MAT3D MATG MATHE MATHP MATEV MATPOR
"""

#: Free in normal modes (SOL 103), fixed in those of a Craig–Bampton reduction.
_SUPORT = Fate("ignored", "(what it supports stays free)")

ENTRIES = table(
    read=(*_READ.split(), *CELLS, *PROPERTIES, *BESIDE, *NEAREST, *OLDER),
    harmless=(*_HARMLESS.split(), *_OF_OTHERS.split()),
    ignored=_IGNORED.split(),
    refused=_REFUSED | {"": " ".join(NO_COUNTERPART)},
) | dict.fromkeys(("SUPORT", "SUPORT1"), _SUPORT)


def fate_of(name: str) -> Fate:
    """What becomes of an entry."""
    return ENTRIES.get(name, Fate("refused") if name.startswith("C") else UNKNOWN)


def is_other(name: str) -> bool:
    """Whether an entry is an element, but not a cell of a mesh."""
    return name in BESIDE or name.startswith("CHBDY") or fate_of(name) == Fate("refused")


def account_for(entries: Sequence[Entry], name: str) -> Account:
    """What becomes of the entries of a deck."""
    return Account(name, [(entry.name, entry.place, fate_of(entry.name)) for entry in entries])


def renew(entries: Sequence[Entry]) -> list[Entry]:
    """Make entries of older versions what they are now; the further ones that this needs."""
    made: dict[str, Entry] = {}
    more: list[Entry] = []
    known = {entry.text(0) for entry in entries if entry.name == "PSOLID"}
    for entry in entries:
        if entry.name not in OLDER:
            continue
        old, (entry.name, order) = entry.name, OLDER[entry.name]
        if old in OF_MATERIAL:
            material = entry.text(1)
            made.setdefault(material, Entry("PSOLID", entry.place, [material, material]))
        elif old == "CRIGD1":
            entry.fields[2:2] = ["123456"]
        elif old == "CRIGD2":  # pairs of a node and its components
            words = entry.words(0)
            pairs = zip(words[2::2], words[3::2], strict=False)
            more += [Entry("RBE2", entry.place, [*words[:2], c, node]) for node, c in pairs]
        elif old in ("PQUAD1", "PTRIA1"):
            entry.fields = _plate(entry)
        elif order:
            first, second = (
                ["" if k is None else entry.text(start + k) for k in order] for start in (0, 4)
            )
            if entry.name == "PSHELL" and second[0]:  # two of them in one entry
                more.append(Entry(entry.name, entry.place, second))
            entry.fields = first
        known.update([entry.text(0)] if entry.name == "PSOLID" else [])
    return [entry for number, entry in made.items() if number not in known] + more


def _plate(entry: Entry) -> list[str]:
    """Fields of the PSHELL that a PQUAD1 or PTRIA1 is: I for 12I/T³, T3 for TS/T."""
    second = entry.real(4)
    t = entry.real(2) or (12 * max(second, 0.0)) ** (1 / 3)
    entry.needs(t, f"{entry.name} needs a thickness, or I, above 0.")
    shear = repr(entry.real(6) / t) if entry.real(6) else ""
    ratio = repr(12 * second / t**3) if second else ""
    number, membrane, bending, across, extra = (entry.text(k) for k in (0, 1, 3, 5, 7))
    return [number, membrane, repr(t), bending, ratio, across, shear, extra]


def tell_damping(account: Account, entries: Sequence[Entry]) -> None:
    """Account for the damping of materials (GE) and of the structure (PARAM,G): ignored."""
    for entry in entries:
        field = DAMPING.get(entry.name)
        if entry.name == "PARAM" and entry.text(0).upper() == "G":
            field = 1
        if field is not None and entry.real(field):
            label = f"{'PARAM,G' if field == 1 else f'GE of {entry.name}'}, damping"
            account.options.append((label, entry.place, Fate("ignored")))
