"""`tradeoff`: error of an impact against seconds and memory, and the cheapest sufficient method.

A member is a mesh of `strike` with one number of anti-oscillators: a few, more, or enough of them.
Each has an error budget of its own. The last mesh is the first whose bar is `BRACKETING_SHARE` of
the tolerance: the tolerance then lies between members, and the difference of each member to the
finest is an error without an estimate. Seconds do not include the compiling and loading of finite
elements, which is done once for all members and counted in `Tradeoff.compilation`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

# imported at the first use otherwise, within the seconds of the first member
import antiosc.fem.prestress.state
import antiosc.reduce.site.at_points
import antiosc.reduce.site.surface  # noqa: F401
from antiosc.base import checks
from antiosc.base._types import Figure
from antiosc.base.clock import uncounted_seconds
from antiosc.base.errors import InputError, RangeError, warn, without_warnings
from antiosc.base.progress import doing
from antiosc.base.texts import Result, engineering, percent, plain_number
from antiosc.fem.elements.weak_form import measure
from antiosc.fem.linalg.petsc_algebra import uses_cells
from antiosc.fem.linalg.solver import cost_of_factor
from antiosc.fem.linalg.solver_choice import assembled_entries
from antiosc.fem.mesh import Mesh
from antiosc.fem.platform import collective, compat
from antiosc.fem.structure.structure import Structure
from antiosc.fem.structure.support import Support
from antiosc.impact.enclosure import enclosures, proved_error
from antiosc.impact.histories import History
from antiosc.impact.histories.bars import QUANTITIES, relative_differences
from antiosc.impact.scene import simulate
from antiosc.models.anti_oscillators import AntiOscillators
from antiosc.models.body import AUTO, AnyLaw, LinearBody
from antiosc.models.motion import Motion
from antiosc.plot.charts import few_log_ticks, figure_or_path, new_figure
from antiosc.reduce.site.site import Site
from antiosc.strikes.strike import (
    Material,
    MeshAnswer,
    RunFunction,
    accuracy_of_steps,
    answer_with_n,
    strike_to_tolerance,
)
from antiosc.strikes.unreduced import (
    UNREDUCED_METHOD,
    MethodOutcome,
    curve_results,
    run_unreduced,
    unreduced_impact,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from antiosc.fem.structure.meshed import MeshedStructure

#: Numbers of anti-oscillators tried on every mesh besides the sufficient number, and least ratio of
#: the sufficient number to these.
FEW_OSCILLATOR_COUNTS, LEAST_COUNT_RATIO = (3, 8, 20, 60), 2.5
#: The last mesh has a bar of at most this share of the tolerance.
BRACKETING_SHARE = 0.5
#: Bytes of an entry of K and of M, both together.
BYTES_PER_MATRIX_ENTRY = 24.0


@dataclass(frozen=True)
class TradeoffMember:
    """One method to compute the impact, with cost, accuracy and results (SI units)."""

    family: str  # of the elements
    size: float  # mean size of the cells [m], the root of their mean volume (area, length)
    order: int  # degree of the elements
    dofs: int
    n: int  # number of anti-oscillators
    step: float  # mean time step in contact
    seconds: float  # of assembly, factorization, extraction with error estimates, and runs
    gigabytes: float  # K and M as stored, and the solver as forecast
    peak_force: float  # this, impulse and contact_time are those of the corrected model
    bar: float  # the largest of `bars`, without the error of the contact law
    #: largest relative difference of results from the finest member; NaN before it is known
    difference: float = 0.0
    impulse: float = math.nan
    contact_time: float = math.nan
    #: "antiosc"; in `Tradeoff.others` "unreduced", with bar = inf, n = 0 and no correction
    method: str = "antiosc"
    #: relative error bars of results, or `difference` plus the finest member's bar if larger
    bars: dict[str, float] = field(default_factory=dict)
    bar_with_law: float | None = None  # `bar` with the error of the law; None if unknown
    #: proved relative error of the peak force by modes left out of the model; NaN if not proved
    proved: float = math.nan

    @property
    def force_bar(self) -> float:
        """The relative error bar of the peak force; `bar` if it is not known."""
        return self.bars.get("peak_force", self.bar)

    def cells(self) -> tuple[str, ...]:
        """The entries of the member's row in the table."""
        return (
            *(self.method, self.family, engineering(self.size, "m"), f"{self.order}"),
            *(f"{self.dofs}", f"{self.n or '–'}", engineering(self.step, "s")),
            *(
                plain_number(self.seconds, 3),
                plain_number(self.gigabytes),
                plain_number(self.peak_force, 4),
            ),
            *(
                plain_number(100 * share)
                for share in (self.force_bar, self.bar, self.difference, self.proved)
            ),
        )


#: Costs over which errors are drawn -> labels of the axes.
COST_AXES = {"seconds": "time (s)", "gigabytes": "memory (GB)"}
#: Names and widths of the columns of the printed table.
TABLE_COLUMNS = {
    "method": -10, "family": -6, "mean cell": 11, "order": 6, "dofs": 9, "N": 5, "step": 9,
    "seconds": 9, "GB": 9, "peak N": 11, "force ± %": 11, "all ± %": 9, "to finest %": 12,
    "proved %": 10,
}  # fmt: skip


def line_of(row: Sequence[str] = tuple(TABLE_COLUMNS)) -> str:
    """A row of the printed table as text; default: the header."""
    cells = zip(row, TABLE_COLUMNS.values(), strict=True)
    return "".join(f"{x:>{w}}" if w > 0 else f"{x:<{-w}}" for x, w in cells)


@dataclass(frozen=True, eq=False, repr=False)
class Tradeoff(Result):
    """The methods that `tradeoff` compared, the cheapest first."""

    table: tuple[TradeoffMember, ...]
    tol: float  #: relative tolerance that was asked for
    hit: History  #: of the last mesh, as for `strike`
    #: other methods (`compare`) on the mesh of `best(tol)`, or of the finest member
    others: tuple[TradeoffMember, ...] = ()
    notes: tuple[str, ...] = ()  #: sentences on methods that were not run, and on a single mesh
    compilation: float = 0.0  #: seconds of compiling or loading elements, in no member's seconds

    def best(self, tol: float | None = None, seconds: float | None = None) -> TradeoffMember:
        """The cheapest member whose bar is at most `tol`, or the most accurate within `seconds`.

        InputError unless one of the two is set, or if no member meets it.
        """
        if (tol is None) == (seconds is None):
            raise InputError("best takes one of tol and seconds.")
        if tol is not None:
            tol = checks.tolerance(tol)
            members = [member for member in self.table if member.bar <= tol]
            if not members:
                least = min(member.bar for member in self.table)
                raise InputError(
                    f"no member has a bar of at most {100 * tol:.3g} %, the least is"
                    f" {100 * least:.3g} %: give tradeoff a smaller tol, or see its message."
                )
            return min(members, key=lambda one: one.seconds)

        limit = checks.positive("seconds", seconds, "s")
        members = [member for member in self.table if member.seconds <= limit]
        if not members:
            fastest = min(member.seconds for member in self.table)
            raise InputError(
                f"no member takes at most {plain_number(limit, 3)} s, the fastest "
                f"{plain_number(fastest, 3)} s."
            )

        return min(members, key=lambda one: one.bar)

    @property
    def front(self) -> tuple[TradeoffMember, ...]:
        """The methods for which no other is both faster and more accurate, the fastest first."""
        front: list[TradeoffMember] = []
        for member in sorted(self.table, key=lambda one: one.seconds):
            if not front or member.bar < front[-1].bar:
                front.append(member)

        return tuple(front)

    @property
    def status(self) -> int:
        """0 if a method has an error bar of at most `tol`, else 1."""
        return 0 if min(member.bar for member in self.table) <= self.tol else 1

    @property
    def message(self) -> str:
        """Text: the cheapest method within `tol`, or the smallest error bar if none is."""
        if self.status:
            smallest_bar = min(member.bar for member in self.table)
            sentence = f"The least bar is {100 * smallest_bar:.3g} %, tol {100 * self.tol:.3g} %."
            notes = self.hit.error_budget.notes[-1:]
            return " ".join([sentence, *notes])

        best = self.best(tol=self.tol)
        sentence = (
            f"The cheapest within {percent(self.tol)}: N = {best.n}, {best.dofs} dofs,"
            f" {engineering(best.seconds, 's')}; its bar, {percent(best.bar)}, leaves out the error"
            " of the contact law"
        )
        if best.bar_with_law is None:
            return f"{sentence}. {self.hit.error_budget.law}".rstrip()
        return f"{sentence}: with it the bar is {percent(best.bar_with_law)}."

    def numbers(self) -> dict[str, object]:
        """Tables, status, message and notes as JSON values by name."""
        table = [asdict(member) for member in self.table]
        others = [{**asdict(member), "bar": None} for member in self.others]
        tables = {"table": table, "others": others, "notes": list(self.notes)}
        return {**tables, **super().numbers()}

    def summary(self) -> str:
        """The table as text, followed by the other methods and the notes."""
        rows = [tuple(TABLE_COLUMNS), *(member.cells() for member in (*self.table, *self.others))]
        return "\n".join([*map(line_of, rows), *self.notes])

    def plot(self, path: str | Path | None = None) -> Figure | Path:
        """Figure of bars and differences over seconds and over memory; with `path` it is written.

        A star marks the member `best(tol=self.tol)`, if there is one. Squares are other methods.
        """
        figure = new_figure((9.0, 4.0), path is None)
        axes = figure.subplots(1, 2, sharey=True)
        for ax, name in zip(axes, COST_AXES, strict=True):
            self.draw(ax, name)
        axes[1].set_ylabel("")
        axes[0].legend(fontsize="small")
        return figure_or_path(figure, path)

    def draw(self, ax: Axes, over: str = "seconds") -> None:
        """Draw bars and differences over "seconds" or "gigabytes" into axes of matplotlib."""
        checks.choice("over", over, tuple(COST_AXES))

        def points(
            members: Sequence[TradeoffMember], quantity: str
        ) -> tuple[list[float], list[float]]:
            x = [getattr(member, over) for member in members]
            return x, [100 * getattr(member, quantity) for member in members]

        ax.loglog(*points(self.table, "bar"), "o", mfc="none", label="error bar")
        apart = [member for member in self.table if member.difference]
        ax.loglog(*points(apart, "difference"), ".", label="difference to the finest")
        proved = [member for member in self.table if math.isfinite(member.proved)]
        if proved:
            ax.loglog(*points(proved, "proved"), "x", label="proved, without the mesh")
        ax.axhline(100 * self.tol, color="0.6", lw=0.8, label="tol")
        if self.status == 0:
            best = [self.best(tol=self.tol)]
            ax.plot(*points(best, "bar"), "*", ms=12, label="best(tol)")

        for method in self.others:
            ax.plot(*points([method], "difference"), "s", mfc="none", label=method.method)

        if over == "seconds":
            ax.step(*points(self.front, "bar"), where="post", lw=0.8, label="front")
        few_log_ticks(ax)
        ax.set_xlabel(COST_AXES[over])
        ax.set_ylabel("relative error (%)")


@collective()
@checks.within_range
def tradeoff(
    source: str | Path | Mesh | Structure,
    site: Site,
    impactor: LinearBody,
    contact: AnyLaw = AUTO,
    duration: float = checks.REQUIRED,
    *,
    tol: float,
    material: Material | None = None,
    supports: Sequence[Support] = (),
    order: int = 2,
    limit: float | None = None,
    initial_velocity: float | Motion = 0.0,
    gravity: float | Sequence[float] = 0.0,
    gap: float | None = None,
    compare: float | None = None,
    ready: Callable[[TradeoffMember], None] | None = None,
) -> Tradeoff:
    """Error of an impact on a part against computing time and memory, down to a tolerance.

    Parameters
    ----------
    source, site, impactor, contact, duration, material, supports, order, limit
        As for `strike`.
    initial_velocity, gravity, gap
        As for `strike`.
    tol : float
        Relative error of interest of peak force, impulse and contact time; members are made until
        one has half of it. A `Structure`, and a mesh that is not divided, have one mesh.
    compare : float, optional
        Largest time [s] for running the unreduced model on the mesh of `best(tol)`. If its forecast
        is longer, it is not run, and `notes` say so.
    ready : callable, optional
        Called with each member as soon as it is computed, before its difference from the finest
        member is known.

    Returns
    -------
    Tradeoff
        Its `table`, `best(tol=…)` or `best(seconds=…)`, and `plot()`.

    Raises
    ------
    InputError
        Arguments that `strike` refuses.
    """
    tol = checks.tolerance(tol)
    if ready is not None:
        ready = checks.function("ready", ready)
    if compare is not None:
        compare = checks.positive("compare", compare, "s")
    given: dict[str, Any] = {"initial_velocity": initial_velocity, "gravity": gravity, "gap": gap}

    def run(model: AntiOscillators, error: float) -> History:
        return simulate(model, impactor, contact, duration, tol=error, **given)

    compiled = uncounted_seconds()
    accuracy = accuracy_of_steps(BRACKETING_SHARE * tol)
    meshes: list[list[ComputedMember]] = []

    with doing("speed against accuracy") as report:

        def seen(answer: MeshAnswer, site: Site) -> None:
            if meshes:
                meshes[-1][-1].answer.structure.drop_factor()
            own = ComputedMember(answer, site, member_of(answer))
            report(f"{len(meshes) + 1} meshes, bar {100 * own.member.bar:.2g} %")

            most = min(answer.n, answer.structure.dofs) / LEAST_COUNT_RATIO
            fewer = [
                _member_with_n(own, run, accuracy, n) for n in FEW_OSCILLATOR_COUNTS if n <= most
            ]
            meshes.append([*(one for one in fewer if one is not None), own])
            if ready is not None:
                for one in meshes[-1]:
                    ready(replace(one.member, difference=math.nan))

        hit = strike_to_tolerance(
            source, site, impactor, run, BRACKETING_SHARE * tol, material, supports, order, limit,
            seen, asked=tol,
        )  # fmt: skip
        members = [one for of_mesh in meshes for one in of_mesh]
        finest = members[-1]
        table = tuple(made.compared_with(finest) for made in members)
        single = "" if len(meshes) > 1 else _one_mesh_text(source, finest, BRACKETING_SHARE * tol)
        notes = (single,) if single else ()
        compilation = uncounted_seconds() - compiled
        result = Tradeoff(table, tol, hit, (), notes, compilation)
        if compare is None:
            return result

        best = result.best(tol=tol) if result.status == 0 else table[-1]
        base = members[table.index(best)]
        answer = base.answer
        blow = partial(unreduced_impact, answer.structure, base.site, answer.raw, duration)
        found = run_unreduced(blow, compare, report)

    if isinstance(found, str):
        return replace(result, notes=(found, *notes))
    return replace(result, others=(base.unreduced(found, finest.answer.hit),))


@dataclass(frozen=True, eq=False)
class ComputedMember:
    """A computed member of the trade-off, with its result and its site."""

    answer: MeshAnswer
    site: Site
    member: TradeoffMember

    def compared_with(self, finest: ComputedMember) -> TradeoffMember:
        """The member with its difference from `finest`, and with bars that cover the difference."""
        member = self.member
        by_name = relative_differences(finest.answer.hit, self.answer.hit)
        apart = max(by_name.values())
        bar = member.bar if apart <= member.bar else apart + finest.member.bar
        wider = {name: by_name[name] + of_finest for name, of_finest in finest.member.bars.items()}
        bars = {
            name: bar if by_name[name] <= bar else wider[name] for name, bar in member.bars.items()
        }
        return replace(member, difference=apart, bar=bar, bars=bars)

    def unreduced(self, outcome: MethodOutcome, finest: History) -> TradeoffMember:
        """The member for the unreduced model on this mesh, with its difference from `finest`."""
        numbers = curve_results(outcome.curve)
        K = self.answer.structure.K
        stored_bytes = 0.0 if uses_cells(K) else BYTES_PER_MATRIX_ENTRY * assembled_entries(K)
        return replace(
            self.member,
            method=UNREDUCED_METHOD,
            n=0,
            proved=math.nan,
            step=float(outcome.curve.time[1]),
            seconds=outcome.seconds,
            gigabytes=(stored_bytes + outcome.bytes) / 1e9,
            bar=math.inf,
            bars={},
            bar_with_law=None,
            difference=max(relative_differences(finest, numbers).values()),
            **asdict(numbers),
        )


def _one_mesh_text(source: object, finest: ComputedMember, goal: float) -> str:
    """Sentence on why there is only one mesh; "" if the message of the history has it."""
    if isinstance(source, Structure):
        return "Only one mesh was tried, that of the given structure."
    bar = finest.member.bar
    if bar > goal:
        return ""

    return (
        f"Only one mesh was tried: the first one has a bar of {percent(bar)}, which is within half"
        " of the tolerance."
    )


def _member_with_n(
    mesh: ComputedMember, run: RunFunction, accuracy: float, n: int
) -> ComputedMember | None:
    """The member with `n` anti-oscillators on a mesh; None beyond the contact law's range."""
    try:
        with without_warnings():  # it is tried: what it lacks is in its bar
            answer = answer_with_n(mesh.answer.structure, mesh.site, run, accuracy, n)
    except RangeError as error:
        warn(f"{n} anti-oscillators are left out of the trade-off: {error}")
        return None

    return ComputedMember(answer, mesh.site, member_of(answer))


def member_of(answer: MeshAnswer) -> TradeoffMember:
    """The member of the trade-off for a result on one mesh."""
    structure = answer.structure
    matrices = cast("MeshedStructure", structure.matrices)
    mesh = matrices.mesh
    solver = structure.factorize()
    cost = solver.cost or cost_of_factor(getattr(solver, "entries", 0.0), 1.0)
    K = structure.K
    stored_bytes = 0.0 if uses_cells(K) else BYTES_PER_MATRIX_ENTRY * assembled_entries(K)
    integrand = compat.constant(mesh.dolfinx, 1.0) * measure(mesh, 1)
    volume = compat.integrate(integrand, mesh.dolfinx)
    seconds = structure.seconds["assembly"] + answer.seconds
    proved = math.nan
    with suppress(InputError):  # outside the assumptions of the proof
        (proof,) = enclosures(answer.raw.assembly, answer.raw.run)
        proved = proved_error(proof, "peak", answer.raw.peak_force)

    return TradeoffMember(
        family=type(matrices.parts[0][0]).__name__,
        size=float((volume / mesh.n_cells) ** (1 / mesh.tdim)),
        order=matrices.form.degree,
        dofs=structure.dofs,
        n=answer.n,
        proved=proved,
        step=answer.hit.step,
        seconds=max(structure.comm.allgather(seconds)),
        gigabytes=(stored_bytes + cost.bytes) / 1e9,
        peak_force=answer.hit.peak_force,
        bar=answer.budget.numerical,
        bars={name: answer.budget[name].numerical for name in QUANTITIES},
        bar_with_law=None if answer.budget.law else answer.budget.worst,
        impulse=answer.hit.impulse,
        contact_time=answer.hit.contact_time,
    )
