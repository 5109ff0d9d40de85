# SPDX-License-Identifier: GPL-2.0-or-later
"""Benchmarks of incise bench, one after the other; each is a program of its own, so that none meets what
another has left in memory.

measure.py JOB.json FOLDER   FOLDER/data/NAME.json and FOLDER/plots; the report on standard output

The job is {"programs": a folder, "benchmarks": names, "quick": …, "report": what it is added to}. A benchmark
that fails is in the report with its last line, and the others go on. SIGTERM goes to the whole process group:
a benchmark ends by itself, and this after it.
"""
import json
import os
import shutil
import signal
import subprocess
import sys
import time

LINES = 20  # of warnings that are kept
LINE_CHARACTERS = 600
OWN_PROGRAM = {"view"}
DRAWN = {"precision", "stability"}

stopped = []


def progress(line):
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[J" + line[:shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()


def run(command, out, said, title):
    """Its status, as of subprocess."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=said)
    while process.poll() is None:
        if not stopped:
            progress(f"{title}: {time.monotonic() - begin:.0f} s")
        time.sleep(0.05)
    progress("")
    return process.returncode


def warnings_of(said):
    """Lines of its standard error; "incise bench: " is clear from where a line stands."""
    for line in said.decode(errors="replace").splitlines():
        _, colon, text = line.partition(": ")
        text = (text if colon and line.startswith("incise ") else line).removeprefix("warning: ")
        # A hint to --help is for a person at a shell.
        if text and not text.startswith("Try 'incise "):
            yield text[:LINE_CHARACTERS]


def not_finite(text):
    raise ValueError(f"{text} is no number")


def load(path):
    """An object, or why it is none."""
    try:
        with open(path, encoding="utf-8") as file:
            found = json.load(file, parse_constant=not_finite)
    except ValueError as why:
        return None, str(why)
    return (found, "") if isinstance(found, dict) else (None, "no object")


def measure(name, job, folder, title):
    """Its state, why, its warnings, and its report or None."""
    own = name in OWN_PROGRAM
    program = os.path.join(job["programs"], "incise-bench" + (f"-{name}" if own else ""))
    data = os.path.join(folder, "data", name + ".json")
    if not os.access(program, os.X_OK):
        why = f"{os.path.basename(program)} is missing: it is built if its libraries are installed"
        return "left out", why, [], None
    command = [program] + ([] if own else [name]) + ["--json"] + (["--quick"] if job["quick"] else [])
    if name in DRAWN and shutil.which("gnuplot"):
        command += ["-o", os.path.join(folder, "plots", name)]
    with open(data, "wb") as out, open(os.memfd_create("said"), "w+b") as said:
        status = run(command, out, said, title)
        said.seek(0)
        lines = list(warnings_of(said.read()))
    report, broken = load(data)
    why = ""
    if status < 0:
        why = f"ended by a signal: {signal.strsignal(-status)}"
    elif status:
        why = lines.pop() if lines else f"status {status}"
    elif report is None:
        why = f"its output is not JSON: {broken}"
    if report is None:
        os.unlink(data)
    return "failed" if why else "measured", why, lines[:LINES], report


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        job = json.load(file)
    report, names = job["report"], job["benchmarks"]
    for i, name in enumerate(names):
        begin = time.monotonic()
        state, why, lines, found = measure(name, job, sys.argv[2], f"{name} ({i + 1} of {len(names)})")
        if stopped:
            sys.exit(1)
        report["runs"][name] = {"state": state, "seconds": time.monotonic() - begin if state != "left out" else 0.0,
                                "why": why or None, "warnings": lines}
        if state == "failed":
            report["failed"].append(name)
        if found is None:
            continue
        report["benchmarks"][name] = found
        # Its metrics once more among those of all, named with the benchmark.
        figures = found.get("figures")
        report["figures"] += [dict(figure, name=f"{name}: {figure.get('name', '')}")
                              for figure in figures if isinstance(figure, dict)] if isinstance(figures, list) else []
    json.dump(report, sys.stdout)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    main()
