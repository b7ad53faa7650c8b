"""Check of scripts in gmsh's `.geo` language: words that describe no geometry are refused.

A `.geo` file is a program. It can run system commands, read and write files, and execute programs
named in fields, options and plugins (gmsh's `Gmsh.y`, `DefaultOptions.h`, `Field.cpp`; 4.8 to
4.15). None of that is needed to describe a part. Names can be composed at run time only by
`StringToName`, which is refused too.
"""

from __future__ import annotations

import re

from antiosc.base.errors import MeshError

#: Comments, which gmsh does not get: gmsh runs the very text that is checked.
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
#: Commands and fields that run programs, or read or write files.
COMMANDS = (
    *("System", "SystemCall", "NonBlockingSystemCall", "OnelabRun", "Plugin", "CreateDir"),
    *("Include", "Merge", "MergeWithBoundingBox", "Print", "Save", "SendToServer"),
    *("ShapeFromFile", "ListFromFile", "StringToName", "S2N"),
    *("ExternalProcess", "Structured", "ExternalField"),
)
#: Options that name files and programs, or commands to be executed later.
OPTIONS = (
    *(r"FileName\w*", r"File\d+", r"Command\w*", r"Executable\w*", "Interpreter", "Editor"),
    *(r"WatchFile\w*", r"RemoteLogin\d*", "SocketName", "SaveOptions", "SaveSession"),
    "Solver",
)
#: Anywhere in the text, also behind a digit or in a string: gmsh may begin a word there.
REFUSED = re.compile(rf"(?:{'|'.join(COMMANDS + OPTIONS)})(?![A-Za-z_0-9])", re.ASCII)
#: A geometry of CAD beside the script may be merged.
MERGE = re.compile(r'\bMerge\s*"(\w[\w\- .+=()]*\.(?:step|stp|brep|iges|igs))"\s*;', re.ASCII)
#: `Printf("…") > "file"`: what is printed goes into a file.
PRINTING = re.compile(r"Printf|Error|Warning")
INTO_FILE = re.compile(r"[)\]]\s*>")


def harmless(text: str, name: str) -> tuple[str, list[str]]:
    """(the script `text` of the file `name` as gmsh may run it, the files beside it that it
    merges).

    Raises
    ------
    MeshError
        It holds a word that runs programs, or reads or writes files.
    """
    if "\0" in text:
        raise MeshError(
            f"{name} is binary and no script of gmsh, as the geometries of GiD: write it there as "
            ".step, or its mesh as .inp or .bdf."
        )

    text = COMMENT.sub(lambda found: " " + "\n" * found[0].count("\n"), text)
    checked = MERGE.sub(lambda found: "\n" * found[0].count("\n"), text)
    refused = REFUSED.search(checked)
    if refused is None and PRINTING.search(checked):
        refused = INTO_FILE.search(checked)
    if refused:
        line = checked.count("\n", 0, refused.start()) + 1
        raise MeshError(
            f"{name} is refused for line {line} ({' '.join(refused[0].split())}): a geometry may "
            "run no program, read no file but CAD beside it, and write none; if you know who wrote "
            "it, read it with trust (in Python alone)."
        )
    # gmsh 4.8 ignores a last line without a line end
    return text + "\n", MERGE.findall(text)
