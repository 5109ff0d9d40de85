# SPDX-License-Identifier: GPL-2.0-or-later
"""incise bench all: benchmarks of incise bench, one after the other, and their report. Each is a program of its own,
so that none meets what another has left in memory.

  incise-bench NAME --json ─▶ data/NAME.json ─┐
                    -o     ─▶ plots/          ├─▶ report.{json,html,md}

  FOLDER/.unfinished/{data,plots,report.*}  ─▶  FOLDER/{data,plots,report.*}

Standard input has the job of incise-bench-all.c. A benchmark that fails is in the report with its last line, and the
others go on. A signal ends the benchmark that runs, and FOLDER is as it was.
"""
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import compare
import report as pages

END_S = 3  # of a benchmark that is to end
LINES = 20  # of warnings that are kept
LINE_CHARACTERS = 600
OWN_PROGRAM = {"view"}
DRAWN = {"precision", "stability"}

stopped = []


def fail(text):
    sys.exit(f"incise bench all: {text}")


def progress(line):
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[J" + line[:shutil.get_terminal_size().columns - 1])
        sys.stderr.flush()


def run(command, out, said, title):
    """Its status, as of subprocess."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=said)
    while process.poll() is None:
        if stopped:
            process.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(END_S)
            process.kill()
            process.wait()
            break
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


def measure_all(job, folder):
    """The report, but for what it is compared with; None where a signal came."""
    names, begun = job["benchmarks"], job["report"]
    command = "incise bench all -o DIR" + " --quick" * job["quick"] + (" --only " + ",".join(names)) * job["only"]
    report = {"schema": begun["schema"], "version": begun["version"],
              "date": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()), "command": command, "quick": job["quick"],
              "machine": begun["machine"], "runs": {}, "failed": [], "benchmarks": {}, "figures": []}
    for i, name in enumerate(names):
        begin = time.monotonic()
        state, why, lines, found = measure(name, job, folder, f"{name} ({i + 1} of {len(names)})")
        if stopped:
            return None
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
    return report


def compare_with(path, old, report):
    """The comparison, or the reason why there is none."""
    try:
        found = compare.compare(old.get("benchmarks", old), path, report["benchmarks"], "this run")
    except compare.NoReport as why:
        found = {"failed": str(why)}
    return dict(found, file=path)


def remove(path):
    if os.path.isdir(path) and not os.path.islink(path):
        shutil.rmtree(path)
    else:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)


def begin_report(job, unfinished):
    """The measurements in a folder, or nothing."""
    report = None
    try:
        for part in ("data", "plots"):
            os.makedirs(os.path.join(unfinished, part))
        report = measure_all(job, unfinished)
    finally:
        if not report:
            remove(unfinished)
            if job["made"]:
                os.rmdir(job["folder"])
    if not report:
        fail(f"{signal.strsignal(stopped[0])}: {job['folder']} is unchanged")
    return report


def make(job):
    """A new report is made within the folder, hidden, and takes the old one's place when it is whole. If it cannot,
    the measurements stay there."""
    folder, unfinished = job["folder"], os.path.join(job["folder"], ".unfinished")
    remove(unfinished)
    report = begin_report(job, unfinished)
    if "old" in job:
        report["against"] = compare_with(job["against"], job["old"], report)
    with open(os.path.join(unfinished, "report.json"), "w", encoding="utf-8") as file:
        json.dump(report, file, indent=1, ensure_ascii=False)
        file.write("\n")
    pages.bench(unfinished)
    for part in ("data", "plots", "report.json", "report.html", "report.md"):
        remove(os.path.join(folder, part))
        os.rename(os.path.join(unfinished, part), os.path.join(folder, part))
    os.rmdir(unfinished)


def print_report(job, report):
    folder, text = job["folder"], None
    if job["json"]:
        with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
            text = file.read()
    else:
        text = (f"wrote {folder}/report.html, report.md, report.json: {len(report['benchmarks'])} of "
                f"{len(report.get('runs') or {})} benchmarks\n")
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as why:
        sys.stdout = None
        sys.exit(1) if isinstance(why, BrokenPipeError) else fail(f"standard output: {why.strerror}")


def judge(job, report):
    """One line for the worst that is not as it should be."""
    failed, against = report["failed"], report.get("against", {})
    why = f"{job['folder']}/report.md says"
    worse = against.get("worse", 0) + len(against.get("gone", []))
    if not report["benchmarks"] and not failed:
        fail(f"nothing was measured; {why} why")
    if failed:
        fail(f"{len(failed)} of {len(report['runs'])} benchmarks failed; {why} why")
    if "failed" in against:
        fail(against["failed"])
    if worse:
        fail(f"{worse} metric{'s are' if worse > 1 else ' is'} worse or missing compared with {job['against']}; "
             f"{why} which")


def main():
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda number, _: stopped.append(number))
    job = json.load(sys.stdin)
    try:
        if job["benchmarks"]:
            make(job)
        else:
            pages.bench(job["folder"])
    except OSError as why:
        fail(f"{why.filename}: {why.strerror}")
    except (TypeError, ValueError, AttributeError, KeyError) as why:
        fail(f"report: {type(why).__name__}: {why}")
    with open(os.path.join(job["folder"], "report.json"), encoding="utf-8") as file:
        report = json.load(file)
    print_report(job, report)
    if job["benchmarks"]:
        judge(job, report)


if __name__ == "__main__":
    main()
