# SPDX-License-Identifier: LGPL-2.1-or-later
"""Haptic loops, each in a process of its own: `incise haptic`, which no other thread delays."""

from __future__ import annotations

import contextlib
import csv
import errno
import json
import os
import shutil
import signal
import subprocess
import tempfile
import warnings
import weakref
from typing import Any, Dict, List, Optional, Union

from . import _library
from ._columns import Columns
from ._library import Error, Invalid, NotFound, PathLike
from ._model import CompiledModel, Model, model_file


def _program() -> str:
    """The program incise that belongs to the library."""
    folders = [os.path.join(lib, "..", "bin") for lib in _library._folders() if lib]
    path = os.pathsep.join([*folders, os.environ.get("PATH", os.defpath)])
    found = shutil.which("incise", path=path)
    if not found:
        raise NotFound(errno.ENOENT, "no program incise; install incise, or run make in its tree")
    return found


def _values(texts: List[str]) -> Any:
    """A column: numbers, or texts where one is none; arrays where numpy is there."""
    try:
        values: List[Any] = [float(text) for text in texts]
    except ValueError:
        values = list(texts)
    with contextlib.suppress(NotFound):
        return _library.package("numpy", "an array").array(values)
    return values


def read_log(path: PathLike) -> Columns:
    """The columns of a log: a CSV file of ticks or an export, or the trace of a .session, which has the
    rest of the session as its metadata."""
    about: Dict[str, Any] = {}
    try:
        with open(path, newline="") as file:
            if _library.path_bytes(path).endswith(b".session"):
                about = json.load(file)
                trace = about.pop("trace")
                header, rows = trace["columns"], trace["rows"]
            else:
                header, *rows = csv.reader(line for line in file if not line.startswith("#"))
    except OSError as failure:
        raise _library.make_error(
            failure.errno or errno.EIO, f"{path}: {failure.strerror}; give a log of incise"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, csv.Error):
        raise Invalid(
            errno.EINVAL, f"{path}: no .session, and no CSV with a row of names"
        ) from None
    if any(len(row) != len(header) for row in rows):
        raise Invalid(errno.EINVAL, f"{path}: has rows of different lengths")
    columns = zip(*rows) if rows else [()] * len(header)
    log = Columns({n: _values(list(c)) for n, c in zip(header, columns)}, f"rows of {path}")
    log.metadata = about
    return log


class Haptic:
    """A haptic loop that runs as `incise haptic`, from now on until it ends or is stopped.

    scene: a .scene file, or the name of a shipped one. rig: path of a rig.conf, or "sim:KEY=VALUE,…";
    None: the command's default. model: a path, or a model that was trained or compiled here.
    duration_s: 0 runs until stop(). realtime: False is the option --no-rt. session: a .session file to write.
    More options of the command have its names, for example policy="deadline", procedure=True.

        ticks = incise.Haptic("neck", "sim:clock=simulated", duration_s=4).wait()

        with incise.Haptic("neck", "rig.conf") as loop:  # stops behind the block
            …
        loop.report["force_max_N"]
    """

    def __init__(
        self,
        scene: PathLike,
        rig: Optional[PathLike] = None,
        *,
        model: Union[PathLike, Model, CompiledModel, None] = None,
        duration_s: float = 0,
        realtime: bool = True,
        session: Optional[PathLike] = None,
        **options: Union[PathLike, float, bool, None],
    ):
        self.scene = os.fspath(scene)
        self.report: Dict[str, Any] = {}  #: as of --json, once the loop has ended
        self.ticks: Optional[Columns] = None  #: of a loop with duration_s, once it has ended
        self._files = contextlib.ExitStack()
        folder = self._files.enter_context(tempfile.TemporaryDirectory())
        self._log = os.path.join(folder, "ticks.csv") if duration_s else None
        file = None if model is None else self._files.enter_context(model_file(model))
        given = [("rig", rig), ("model", file and os.fsdecode(file)), ("no-rt", not realtime)]
        given += [("output", session), ("output", self._log), ("json", True), *options.items()]
        given += [("duration", f"{duration_s}s" if duration_s else None)]
        command = [_program(), "haptic", self.scene]
        for name, value in given:
            if value is not None and value is not False:
                end = (
                    ""
                    if value is True
                    else f"={os.fspath(value) if hasattr(value, '__fspath__') else value}"
                )
                command.append(f"--{name.replace('_', '-')}{end}")
        self._process: Any = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._process.asked = False
        # At the end of Python, too: no force outlives it.
        self._end = weakref.finalize(self, _hang_up, self._process)

    def __repr__(self) -> str:
        state = "runs" if self._end.alive else "has ended"
        return f"<incise.Haptic {self.scene}: {state}>"

    def __enter__(self) -> "Haptic":
        return self

    def __exit__(self, *exception: Any) -> None:
        self.stop()

    def stop(self) -> None:
        """End it; the force ramps to 0 first. Again is harmless."""
        if self._end.alive:
            _ask_end(self._process)
            self.wait()

    def wait(self) -> Optional[Columns]:
        """Wait for the end; returns the ticks of a loop with duration_s. Ctrl-C ends the loop."""
        if not self._end.alive:
            return self.ticks
        try:
            out, said = self._process.communicate()
            self._read(out, said.splitlines())
        finally:
            self._end()
            self._files.close()
        return self.ticks

    def _read(self, out: str, lines: List[str]) -> None:
        """The report and the ticks."""
        code = self._process.returncode
        prefix = "incise haptic: "
        for line in lines:
            if line.startswith(prefix + "warning: "):
                warnings.warn(line.partition("warning: ")[2], stacklevel=4)
        if code and not (self._process.asked and code == -signal.SIGTERM):  # before it listens
            said = [line[len(prefix) :] for line in lines if line.startswith(prefix)]
            raise Error(errno.EIO, said[-1] if said else f"incise haptic ended with {code}")
        if out:
            self.report = json.loads(out)
        if self._log and os.path.exists(self._log):
            self.ticks = read_log(self._log)
            self.ticks._about = f"ticks of {self.scene}"


def _ask_end(process: Any) -> None:
    """Ask a loop to end, once: a second SIGTERM ends the ramp. SIGHUP may read the scene again."""
    if not process.asked:
        process.asked = True
        process.send_signal(signal.SIGTERM)


def _hang_up(process: Any) -> None:
    """End a loop that is still there, and wait for it."""
    if process.poll() is None:
        _ask_end(process)
        process.communicate()
    process.stdout.close()
    process.stderr.close()
