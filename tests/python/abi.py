# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether the structs of python/incise are those of the headers.

    python3 tests/python/abi.py [CC]

Writes a C program that holds size and place of each field against what ctypes laid out, and
compiles and runs it. A struct whose fields are fewer in Python is found by its size.
"""

import ctypes
import importlib
import os
import subprocess
import sys
import tempfile

import incise

MODULES = "_corpus _host _library arrow calibrate capture model plan recording verify wall".split()
HEADERS = (
    "arrow camera capture calibrate_depth calibrate_force calibrate_tip calibration corpus fixed host model plan prove recording "
    "stability tracker train uncertainty verify wall"
).split()


def structs():
    """All structs with a name in C, once each."""
    found = {}
    for module in MODULES:
        # Not `from incise import verify`, which is a function.
        for value in vars(importlib.import_module(f"incise.{module}")).values():
            if (
                isinstance(value, type)
                and issubclass(value, ctypes.Structure)
                and hasattr(value, "c_name")
            ):
                found[value.c_name] = value
    return found


def program():
    lines = ["#include <stddef.h>", "#include <stdio.h>"]
    lines += [f"#include <incise/{header}.h>" for header in HEADERS]
    lines += [
        "#define HOLDS(what, c, python) do { if ((size_t)(c) != (size_t)(python)) { "
        'printf("%s: %zu in C, %zu in Python\\n", what, (size_t)(c), (size_t)(python)); bad = 1; } '
        "} while (0)",
        "int main(void)\n{\n\tint bad = 0;",
    ]
    count = 0
    for name, struct in structs().items():
        lines.append(f'\tHOLDS("{name}", sizeof({name}), {ctypes.sizeof(struct)});')
        for field, *_ in struct._fields_:
            c_field = getattr(struct, "c_fields", {}).get(field, field)
            place = getattr(struct, field)
            lines.append(
                f'\tHOLDS("{name} {c_field}", offsetof({name}, {c_field}), {place.offset});'
            )
            lines.append(
                f'\tHOLDS("{name} {c_field}, size", sizeof((({name} *)0)->{c_field}), {place.size});'
            )
            count += 1
    lines.append(f'\tif (!bad) puts("{len(structs())} structs, {count} fields");')
    lines.append("\treturn bad;\n}")
    return "\n".join(lines) + "\n"


def main():
    include = os.path.join(os.path.dirname(incise.__file__), "..", "..", "lib", "include")
    with tempfile.TemporaryDirectory() as folder:
        source, out = os.path.join(folder, "abi.c"), os.path.join(folder, "abi")
        with open(source, "w") as file:
            file.write(program())
        compiler = sys.argv[1] if len(sys.argv) > 1 else "cc"
        subprocess.run([compiler, "-I", include, "-o", out, source], check=True)
        return subprocess.run([out]).returncode


sys.exit(main())
