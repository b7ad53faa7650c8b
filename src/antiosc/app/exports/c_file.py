"""One C99 file of a run: the library's sources, the numbers, and a small interface."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from antiosc import __version__
from antiosc.app.exports.fmu import identifier, sources
from antiosc.app.exports.run_data import RunData
from antiosc.base import files

_ORDER = ("antiosc_march.h", "export/antiosc_model.h", "internal.h")
_OWN_INCLUDE = re.compile(r'^#include "[^"]+"\n', re.MULTILINE)

_HEAD = """\
/* {title}: a run of an impact, written by antiosc {version}. C99, no dependencies but <math.h>.
 *
 *     static union {{ double align[2]; char bytes[{upper}_BYTES]; }} memory;
 *     axm_run *run;
 *     int status = axm_create(&{name}, &memory, sizeof memory, &run);
 *     status = axm_advance(run, time);           time in s, not before the last one
 *     double value = axm_output(run, {upper}_{first});
 *
 * status is AOM_DONE (0) if all is well. {inputs}
 * Nothing is allocated; several runs may live at once. Define {upper}_MAIN for a program that
 * prints the outputs over {duration:.6g} s as a table. The interface is that of antiosc_model.h
 * below.
 *
 * Outputs:
{outputs}
 */
#if defined(__GNUC__)
#define AOM_API static __attribute__((unused)) /* a run needs some of the functions */
#else
#define AOM_API static
#endif
#define {upper}_BYTES {size}
"""

_MAIN = """
#ifdef {upper}_MAIN
#include <stdio.h>

int main(void) {{
    static union {{ double align[2]; char bytes[{upper}_BYTES]; }} memory;
    axm_run *run;
    int status = axm_create(&{name}, &memory, sizeof memory, &run);
    for (int k = 0; k <= 1000 && status == AOM_DONE; k++) {{
        status = axm_advance(run, {duration!r} * k / 1000);
        printf("%.17g", axm_time(run));
        for (int i = 0; i < {count}; i++)
            printf(" %.17g", axm_output(run, i));
        printf("\\n");
    }}
    return status;
}}
#endif
"""


def write(path: Path, data: RunData) -> None:
    """Write the C file of a run."""
    files.write_text(path, text(path.stem, data), "the C file")


def text(title: str, data: RunData) -> str:
    """The C file of a run."""
    name = identifier(title)
    upper = name.upper()
    outputs = [identifier(each.name).upper() for each in data.output_variables]
    listed = [
        f" *   {upper}_{short}  {each.description} [{each.unit}]"
        for short, each in zip(outputs, data.output_variables, strict=True)
    ]
    inputs = (
        "Forces on the sites: axm_set_input(run, site, force, rate)."
        if data.input_variables
        else ""
    )
    head = _HEAD.format(
        title=title, version=__version__, name=name, upper=upper, first=outputs[0], inputs=inputs,
        outputs="\n".join(listed), duration=data.duration, size=data.memory,
    )  # fmt: skip
    names = [f"    {upper}_{each} = {i}" for i, each in enumerate(outputs)]
    enumeration = "enum {\n" + ",\n".join(names) + "\n};\n"
    main = _MAIN.format(name=name, upper=upper, duration=data.duration, count=len(outputs))
    return "\n".join([head, _sources(), enumeration, _numbers(name, data), main])


def _sources() -> str:
    """All sources in one, without their includes of each other."""
    found = sources()
    units = [each for each in found if each.endswith(".c")]
    left_out = ("antiosc_march.c", "export/fmu.c")
    order = [*_ORDER, *(each for each in units if each not in left_out)]
    parts = [_OWN_INCLUDE.sub("", found[each]) for each in order]
    return "".join(parts)


def _numbers(name: str, data: RunData) -> str:
    """The numbers as constant arrays, and the model that points to them."""
    arrays = data.arrays()
    needed = [part for part in arrays if part not in ("options", "contacts")]
    if not data.system.laws:
        needed.remove("law_parameters")
    lines = [_array(f"{name}_{part}", arrays[part]) for part in needed]
    specs = ", ".join(f"{{{kind}, {index}}}" for kind, index in data.outputs.tolist())
    lines.append(f"static const axm_output_spec {name}_outputs[] = {{{specs}}};")
    modes, rows, contacts, breaks, sites, parameters, count, _ = data.counts()
    at, listed = 0, []
    scales = arrays["contacts"].reshape(contacts, 7)
    for c, values in zip(data.given.contacts, scales, strict=True):
        row = [_number(x) for x in values]
        law = f"{{{c.law.kind}, {c.law.n_params}, {name}_law_parameters + {at}, 0}}"
        at += c.law.n_params
        head = f"{law}, {row[0]}, {row[1]}, {c.first_tangential}, {c.n_tangential}"
        listed.append(f"    {{{', '.join([head, *row[2:], '0', '0'])}}}")
    if listed:
        body = ",\n".join(listed)
        lines.append(f"static const aom_contact {name}_contacts[] = {{\n{body}\n}};")
    pointers = ", ".join(
        f"{name}_{part}"
        for part in ("omega", "decay", "beta", "residual", "breaks", "loads", "offsets")
    )
    options = [*(_number(x) for x in data.options), "INT64_MAX / 4", "INT64_MAX / 4", "0"]
    lines.append(
        f"static const axm_model {name} = {{\n"
        f"    {{{modes}, {rows}, {contacts}, {breaks}, {pointers},\n"
        f"     {f'{name}_contacts' if listed else '0'}, {name}_q, {name}_v,"
        f" {_number(data.system.given)}, 0}},\n"
        f"    {{{', '.join(options)}}},\n"
        f"    {sites}, {name}_site_modes, {name}_site_forces, {name}_site_shifts,\n"
        f"    {parameters}, {name}_parameters, {name}_starts, {count}, {name}_outputs\n}};\n"
    )
    return "\n".join(lines)


def _array(name: str, values: np.ndarray) -> str:
    rows = [", ".join(_number(x) for x in values[k : k + 4]) for k in range(0, len(values), 4)]
    body = ",\n    ".join(rows) or "0.0"
    return f"static const double {name}[] = {{\n    {body}\n}};"


def _number(x: float) -> str:
    value = float(x)
    if value == float("inf"):
        return "INFINITY"
    return value.hex() if value != int(value) or abs(value) > 1e15 else f"{value:.1f}"
