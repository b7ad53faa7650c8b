"""Writes an exported run as an FMU or as one C99 file.

FMI 2.0.4 and 3.0.1 for co-simulation, https://fmi-standard.org.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from antiosc import __version__
from antiosc.base import files
from antiosc.base.archives import atomic_archive
from antiosc.base.errors import MissingDependencyError
from antiosc.engine import library
from antiosc_app.run_data import RunData, Variable, distinct_names, model_file

_ENTRY_DATE = (2020, 1, 1, 0, 0, 0)  # of all entries: equal models make equal files
#: units in SI base units
_UNIT_EXPONENTS = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.s": {"kg": 1, "m": 1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "s": {"s": 1},
}
_CAUSALITIES = ("input", "output", "parameter")
_PACKAGE_FOLDER = Path(library.__file__).parents[1]
#: platform of FMI 3 -> its folder in FMI 2, the ending of a library there
PLATFORMS = {
    "x86_64-linux": ("linux64", ".so"),
    "aarch64-linux": ("", ".so"),
    "x86_64-windows": ("win64", ".dll"),
    "x86_64-darwin": ("darwin64", ".dylib"),
    "aarch64-darwin": ("", ".dylib"),
}
#: source files, each compiled by itself
COMPILED_SOURCES = ("antiosc_march.c", "export/antiosc_model.c", "export/fmu.c")


def write_fmu(path: Path, data: RunData, *, fmi: int) -> None:
    """Write a run as an FMU for version `fmi` (2 or 3) of the standard."""
    name = c_identifier(path.stem)
    with atomic_archive(path, "the FMU") as archive:
        _add_file(
            archive,
            "modelDescription.xml",
            _xml_bytes(_model_description(name, path.stem, data, fmi)),
        )
        _add_file(archive, "resources/model.aom", model_file(data))
        for platform, library in library_binaries().items():
            fmi2_folder, ending = PLATFORMS[platform]
            folder = platform if fmi == 3 else fmi2_folder
            if folder:
                _add_file(archive, f"binaries/{folder}/{name}{ending}", library)
        for file, text in c_sources().items():
            _add_file(archive, f"sources/{file}", text.encode())
        if fmi == 3:
            _add_file(archive, "sources/buildDescription.xml", _xml_bytes(_build_description(name)))


#: Keywords and reserved words of C99.
RESERVED_C_WORDS = frozenset(
    """auto break case char const continue default do double else enum extern float for goto if
    inline int long main register restrict return short signed sizeof static struct switch typedef
    union unsigned void volatile while""".split()  # noqa: SIM905
)


def c_identifier(text: str) -> str:
    """A valid identifier of C made from a text: "top plate" -> "top_plate"."""
    name = re.sub(r"\W", "_", text, flags=re.ASCII)
    invalid = name in RESERVED_C_WORDS or not name[:1].isalpha()
    return f"model_{name}" if invalid else name


def _add_file(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """Add a file to an archive, with a fixed date, so that equal runs make equal archives."""
    entry = zipfile.ZipInfo(name, _ENTRY_DATE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, content)


def _xml_bytes(root: ET.Element) -> bytes:
    """An XML element as bytes."""
    ET.indent(root)
    return ET.tostring(root, "utf-8", xml_declaration=True)


def _numbered_variables(data: RunData) -> Iterator[tuple[int, str, Variable]]:
    """Yields (value reference, causality, variable), numbered as in `csrc/export/fmu.c`."""
    groups = (data.input_variables, data.output_variables, data.parameter_variables)
    number = 0
    for causality, variables in zip(_CAUSALITIES, groups, strict=True):
        for variable in variables:
            number += 1
            yield number, causality, variable


def _model_description(name: str, title: str, data: RunData, fmi: int) -> ET.Element:
    """The content of modelDescription.xml; `name` is an identifier, `title` the file's stem."""
    is_fmi2 = fmi == 2
    attributes = {
        "fmiVersion": f"{fmi}.0",
        "modelName": title,
        "guid" if is_fmi2 else "instantiationToken": data.content_hash,
        "description": "an impact on anti-oscillators, or a port of a linear structure",
        "generationTool": f"antiosc {__version__}",
        "variableNamingConvention": "flat",
    }
    if is_fmi2:
        attributes["numberOfEventIndicators"] = "0"
    root = ET.Element("fmiModelDescription", attributes)

    abilities = ["canHandleVariableCommunicationStepSize"]
    if is_fmi2:
        abilities.append("canNotUseMemoryManagementFunctions")
        abilities += ["canInterpolateInputs"] if data.input_variables else []
    of_slave = {"modelIdentifier": name, **dict.fromkeys(abilities, "true")}
    slave = ET.SubElement(root, "CoSimulation", of_slave)
    if is_fmi2:
        source_files = ET.SubElement(slave, "SourceFiles")
        for unit in COMPILED_SOURCES:
            ET.SubElement(source_files, "File", name=unit)

    units = ET.SubElement(root, "UnitDefinitions")
    for unit, base in _UNIT_EXPONENTS.items():
        powers = {base_unit: str(power) for base_unit, power in base.items()}
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", powers)
    experiment = {"startTime": 0, "stopTime": float(data.duration)}
    experiment |= {"tolerance": float(data.options[1]), "stepSize": float(data.duration) / 1000}
    told = {key: repr(value) for key, value in experiment.items()}
    ET.SubElement(root, "DefaultExperiment", told)
    _add_variables(root, data, is_fmi2)

    structure = ET.SubElement(root, "ModelStructure")
    outputs = [
        number for number, causality, _ in _numbered_variables(data) if causality == "output"
    ]
    for group in ("Output", "InitialUnknown"):
        unknowns = ET.SubElement(structure, f"{group}s") if is_fmi2 else structure
        for number in outputs:
            if is_fmi2:  # indices count from 1
                ET.SubElement(unknowns, "Unknown", index=str(number))
            else:
                ET.SubElement(unknowns, group, valueReference=str(number))
    return root


def _add_variables(root: ET.Element, data: RunData, is_fmi2: bool) -> None:
    """Add <ModelVariables>; FMI 3 needs the time among them."""
    variables = ET.SubElement(root, "ModelVariables")
    if not is_fmi2:
        time = {"name": "time", "valueReference": "0", "causality": "independent"}
        ET.SubElement(variables, "Float64", {**time, "variability": "continuous", "unit": "s"})

    for number, causality, variable in _numbered_variables(data):
        attributes = {
            "name": variable.name,
            "valueReference": str(number),
            "description": variable.description,
            "causality": causality,
            "variability": "fixed" if causality == "parameter" else "continuous",
        }
        value = {"unit": variable.unit}
        if causality == "output":
            attributes["initial"] = "calculated"
        else:
            value["start"] = repr(float(variable.start))
        if is_fmi2:
            ET.SubElement(ET.SubElement(variables, "ScalarVariable", attributes), "Real", value)
        else:
            ET.SubElement(variables, "Float64", attributes | value)


def _build_description(name: str) -> ET.Element:
    """buildDescription.xml of FMI 3."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=name)
    source_set = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for unit in COMPILED_SOURCES:
        ET.SubElement(source_set, "SourceFile", name=unit)
    return root


# -- the C sources and compiled libraries in an export


def c_sources() -> dict[str, str]:
    """The C sources: path below csrc -> text."""
    for folder in (_PACKAGE_FOLDER / "csrc", library.SOURCE_FOLDER):
        files = sorted([*folder.glob("*.[ch]"), *folder.glob("export/*.[ch]")])
        if files:
            return {f.relative_to(folder).as_posix(): f.read_text("utf-8") for f in files}
    raise MissingDependencyError("the C sources are missing: install antiosc anew.")


def library_binaries() -> dict[str, bytes]:
    """Platform -> content of its compiled library: this one, and those built for others."""
    libraries = {library.platform(): library.LIBRARY_FILE.read_bytes()}
    sources = library.library.aom_source_hash()
    for name, (_, ending) in PLATFORMS.items():
        file = _PACKAGE_FOLDER / "binaries" / f"{name}{ending}"
        content = file.read_bytes() if file.is_file() else b""
        if sources in content:
            libraries.setdefault(name, content)
    return libraries


#: Source files that a run needs, in this order.
_RUN_SOURCES = (
    "antiosc_march.h", "export/antiosc_model.h", "arena.h", "internal.h", "coupled.c",
    "crossings.c", "flight.c", "forces.c", "laws.c", "memory.c", "responses.c", "runs.c", "start.c",
    "steps.c", "stepper.c", "stretch.c", "export/antiosc_model.c",
)  # fmt: skip
_NON_RUN_SECTION = re.compile(r"^#ifndef AOM_RUN_ONLY\n.*?^#endif\n\n?", re.MULTILINE | re.DOTALL)
_LOCAL_INCLUDE = re.compile(r'^#include "[^"]+"\n', re.MULTILINE)

_FILE_HEAD = """\
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

_MAIN_FUNCTION = """
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


def write_c(path: Path, data: RunData) -> None:
    """Write the C file of a run."""
    files.write_text(path, c_file_text(path.stem, data), "the C file")


def c_file_text(title: str, data: RunData) -> str:
    """The text of the C file of a run; its names begin with `title` as an identifier."""
    code = _run_source_text()
    name = c_identifier(title)
    if re.search(rf"\b{name}\b", re.sub(r"/\*.*?\*/", "", code + _MAIN_FUNCTION, flags=re.DOTALL)):
        name = f"model_{name}"  # a word of the sources
    upper = name.upper()
    outputs = distinct_names(
        c_identifier(variable.name).upper() for variable in data.output_variables
    )
    output_lines = [
        f" *   {upper}_{name_in_c}  {_comment_text(variable.description)} [{variable.unit}]"
        for name_in_c, variable in zip(outputs, data.output_variables, strict=True)
    ]
    inputs = (
        "Forces on the sites: axm_set_input(run, site, force, rate)."
        if data.input_variables
        else ""
    )
    header = _FILE_HEAD.format(
        title=_comment_text(title),
        version=__version__,
        name=name,
        upper=upper,
        first=outputs[0],
        inputs=inputs,
        outputs="\n".join(output_lines),
        duration=data.duration,
        size=data.memory_bytes,
    )
    names = [f"    {upper}_{variable} = {i}" for i, variable in enumerate(outputs)]
    enumeration = "enum {\n" + ",\n".join(names) + "\n};\n"
    main_text = _MAIN_FUNCTION.format(
        name=name, upper=upper, duration=data.duration, count=len(outputs)
    )
    return "\n".join([header, code, enumeration, _model_definition(name, data), main_text])


def _run_source_text() -> str:
    """The C sources that a run needs as one text, without includes of each other."""
    texts = c_sources()
    parts = [_LOCAL_INCLUDE.sub("", texts[file]) for file in _RUN_SOURCES]
    return _NON_RUN_SECTION.sub("", "".join(parts))


def _comment_text(text: str) -> str:
    """A text for a comment of C, with a space in "*/" and "/*"."""
    return re.sub(r"\*(?=/)|/(?=\*)", r"\g<0> ", text)


def _model_definition(name: str, data: RunData) -> str:
    """C definition of the model `name`, and of the constant arrays to which it points."""
    arrays = data.arrays()
    array_names = [part for part in arrays if part not in ("options", "contacts")]
    absent = [] if data.system.laws else ["law_parameters"]
    absent += ["quadratic", "cubic"] if data.system.cubic is None else []
    array_names = [part for part in array_names if part not in absent]
    lines = [_array_definition(f"{name}_{part}", arrays[part]) for part in array_names]
    specs = ", ".join(f"{{{kind}, {index}}}" for kind, index in data.outputs.tolist())
    lines.append(f"static const axm_output_spec {name}_outputs[] = {{{specs}}};")
    modes, rows, contacts, breaks, sites, parameters, count, _, stretch = data.size_counts()
    offset = 0
    contact_lines = []
    scales = arrays["contacts"].reshape(contacts, 7)
    for c, values in zip(data.packed_system.contacts, scales, strict=True):
        row = [_c_number(x) for x in values]
        law = f"{{{c.law.kind}, {c.law.n_params}, {name}_law_parameters + {offset}, 0}}"
        offset += c.law.n_params
        law_text = f"{law}, {row[0]}, {row[1]}, {c.first_tangential}, {c.n_tangential}"
        contact_lines.append(f"    {{{', '.join([law_text, *row[2:], '0', '0'])}}}")
    if contact_lines:
        body = ",\n".join(contact_lines)
        lines.append(f"static const aom_contact {name}_contacts[] = {{\n{body}\n}};")
    pointers = ", ".join(
        f"{name}_{part}"
        for part in ("omega", "decay", "beta", "residual", "breaks", "loads", "offsets")
    )
    tensors = f", {stretch}, {name}_quadratic, {name}_cubic" if stretch else ""
    options = [*(_c_number(x) for x in data.options), "INT64_MAX / 4", "INT64_MAX / 4", "0"]
    lines.append(
        f"static const axm_model {name} = {{\n"
        f"    {{{modes}, {rows}, {contacts}, {breaks}, {pointers},\n"
        f"     {f'{name}_contacts' if contact_lines else '0'}, {name}_q, {name}_v,"
        f" {_c_number(data.system.contact_energy)}, 0{tensors}}},\n"
        f"    {{{', '.join(options)}}},\n"
        f"    {sites}, {name}_site_modes, {name}_site_forces, {name}_site_shifts,\n"
        f"    {parameters}, {name}_parameters, {name}_starts, {count}, {name}_outputs\n}};\n"
    )
    return "\n".join(lines)


def _array_definition(name: str, values: np.ndarray) -> str:
    """C definition of the constant array `name`."""
    rows = [", ".join(_c_number(x) for x in values[k : k + 4]) for k in range(0, len(values), 4)]
    body = ",\n    ".join(rows) or "0.0"
    return f"static const double {name}[] = {{\n    {body}\n}};"


def _c_number(x: float) -> str:
    """A number as an exact C literal: hexadecimal unless it is whole."""
    value = float(x)
    if value == float("inf"):
        return "INFINITY"
    if value != int(value) or abs(value) > 1e15:
        return value.hex()
    return f"{value:.1f}"
