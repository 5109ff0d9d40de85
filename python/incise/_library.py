# SPDX-License-Identifier: LGPL-2.1-or-later
"""The C libraries by ctypes: finding and loading them, their errors, their structs.

Each library is loaded at its first use, so that importing incise maps none. The structs repeat
those of the public headers; tests/python/abi compares every field with the compiler's.
"""

import ctypes
import errno
import importlib
import os
import re
from typing import Union

VERSION = "0.2.0"
SOVERSION = 2

c_double, c_int, c_bool, c_char = ctypes.c_double, ctypes.c_int, ctypes.c_bool, ctypes.c_char
c_int64, c_uint64, c_void_p, c_char_p = (
    ctypes.c_int64,
    ctypes.c_uint64,
    ctypes.c_void_p,
    ctypes.c_char_p,
)


PathLike = Union[str, "os.PathLike[str]"]


class Error(OSError):
    """A failure of the library: one line that says what, where and what to do.

    ``errno`` is the code of the C library; ``str()`` is the line.
    """

    def __str__(self):
        return self.strerror or ""


class NotFound(Error, FileNotFoundError):
    """A file, device or module that is not there."""


class Invalid(Error, ValueError):
    """A value, a file or data that cannot be used."""


class Exists(Error, FileExistsError):
    """A file that is there, and is not overwritten unasked."""


_kinds = {
    errno.ENOENT: NotFound,
    errno.EEXIST: Exists,
    errno.EINVAL: Invalid,
    errno.ENODATA: Invalid,
    errno.ERANGE: Invalid,
    errno.EDOM: Invalid,
    errno.E2BIG: Invalid,
    errno.ENOTSUP: Invalid,
    errno.EBADMSG: Invalid,
}


def make_error(code, text):
    """The exception for a positive errno and its line."""
    if code == errno.ENOMEM:
        return MemoryError(text)
    return _kinds.get(code, Error)(code, text)


_types = {
    "void": None,
    "char": c_char,
    "int": c_int,
    "unsigned int": ctypes.c_uint,
    "uint8_t": ctypes.c_uint8,
    "uint32_t": ctypes.c_uint32,
    "bool": c_bool,
    "double": c_double,
    "int64_t": c_int64,
    "uint64_t": c_uint64,
    "size_t": ctypes.c_size_t,
}
_structs = {}


class Struct(ctypes.Structure):
    """A struct of a public header, by its name there."""

    def __init_subclass__(cls, of):
        cls.c_name = of
        _structs[of] = cls


def _field(declarator, kind):
    """Name and type of a member: "*path" or "tip_mm[3]" of its kind."""
    for _ in range(declarator.count("*")):
        kind = {None: c_void_p, c_char: c_char_p}.get(kind) or ctypes.POINTER(kind)
    for n in reversed(re.findall(r"\[(\d+)\]", declarator)):
        kind = kind * int(n)
    return re.search(r"\w+", declarator).group(), kind


def structs(text, **types):
    """Structs by their declarations, as in the headers; types: of names that C does not have."""
    made = []
    for name, body in re.findall(r"(struct \w+) \{(.*?)\};", text, re.S):
        fields = []
        for kind, declarators in re.findall(
            r"((?:struct |unsigned )?\w+) ([^;]+);", body.replace("const ", "")
        ):
            base = {**_types, **_structs, **types}[kind]
            fields += [_field(declarator, base) for declarator in declarators.split(",")]
        made.append(type(Struct)(name.split()[1], (Struct,), {"_fields_": fields}, of=name))
    return made


(ErrorStruct,) = structs("""
    struct incise_error {
        int code;
        char text[500];
    };
    """)


class Failure:
    """An ``incise_error`` for one call."""

    def __init__(self):
        self.struct = ErrorStruct()
        self.ref = ctypes.byref(self.struct)

    def exception(self, code):
        text = self.struct.text.decode("utf-8", "replace")
        return make_error(code, text or os.strerror(code))

    def check(self, rc):
        """Return rc, or raise the error that it stands for."""
        if rc < 0:
            raise self.exception(-rc)
        return rc

    def require(self, pointer):
        """Return a pointer, or raise."""
        if not pointer:
            raise self.exception(self.struct.code or ctypes.get_errno() or errno.EIO)
        return pointer


class Handle:
    """An object of the C library, freed with the last reference to it; it cannot be copied."""

    def __init__(self, pointer, free):
        self._as_parameter_ = pointer
        self._free = free

    def __del__(self):
        pointer, self._as_parameter_ = self._as_parameter_, None
        if pointer:
            function(self._free)(pointer)

    def __reduce__(self):
        raise TypeError("an object of the C library cannot be copied or pickled")


# --- finding ---------------------------------------------------------------------------


def _folders():
    """The folders of the libraries, in order; None stands for the system's own search."""
    given = os.environ.get("INCISE_LIBDIR")
    if given:
        yield given
        return
    here = os.path.dirname(os.path.abspath(__file__))
    build = os.path.join(here, "..", "..", "build", "lib")
    if os.path.exists(os.path.join(here, "..", "..", "lib", "libincise.map")):
        yield os.path.normpath(build)
    try:
        from . import _installed  # written by make install

        yield _installed.LIBDIR
    except ImportError:
        pass
    yield None


def _load(name):
    file = f"{name}.so.{SOVERSION}"
    tried = []
    for folder in _folders():
        path = os.path.join(folder, file) if folder else file
        if folder and not os.path.exists(path):
            tried.append(path)
            continue
        try:
            return ctypes.CDLL(path, use_errno=True)
        except OSError as failure:
            tried.append(str(failure))
    hint = (
        "set INCISE_LIBDIR to the folder of the libraries"
        if "INCISE_LIBDIR" not in os.environ
        else "mend INCISE_LIBDIR"
    )
    raise NotFound(
        errno.ENOENT,
        f"{file}: cannot be loaded ({'; '.join(tried)}); install libincise{SOVERSION}, run make "
        f"in a source tree, or {hint}",
    )


class _Libraries:
    """The libraries that are loaded; a fork may go on using them."""

    def __init__(self):
        self.loaded = {}

    def get(self, name):
        library = self.loaded.get(name)
        if library is None:
            if name != "libincise":
                self.get("libincise")
            library = _load(name)
            if name == "libincise":
                library.incise_version.restype = c_char_p
                found = library.incise_version().decode()
                if found != VERSION:
                    raise Invalid(
                        errno.EINVAL,
                        f"python incise {VERSION} needs libincise {VERSION}, and found {found}; "
                        "install the same version of both",
                    )
            self.loaded[name] = library
        return library


_libraries = _Libraries()

# Functions with their library, result and arguments: {name: (library, result, *arguments)}.
_signatures = {}
_functions = {}


def _type(declaration):
    """The type of a parameter or a result, without its name."""
    words = re.sub(r"\bconst\b", " ", declaration).replace("*", " * ").split()
    name = " ".join(words[: 2 if words[0] in ("struct", "unsigned") else 1])
    stars = words.count("*") or declaration.endswith("]")
    if words[0] == "enum" and not stars:
        return c_int
    if stars:
        base = c_char if name == "char" else _structs.get(name)
        return _field("*x", base)[1] if stars == 1 else c_void_p
    return _types.get(name, c_void_p)  # also for a typedef of a function


def declare(library, signatures):
    """Note the functions of a library: {name: (result, *arguments)}; nothing is loaded yet."""
    for name, signature in signatures.items():
        _signatures[name] = (library,) + signature


declared = []  # all prototypes, for tests


def prototypes(library, text):
    """Note the functions of a library by their prototypes, as in its headers."""
    declared.append(text)
    for result, name, arguments in re.findall(r"(\w[^;]*?)(\w+)\(([^;]*)\);", text):
        types = [_type(argument.strip()) for argument in arguments.split(",")]
        declare(library, {name: (_type(result), *types)})


def function(name):
    """A function of the C library, with its types."""
    found = _functions.get(name)
    if found is None:
        library, result, *arguments = _signatures[name]
        found = getattr(_libraries.get(library), name)
        found.restype = result
        found.argtypes = arguments
        _functions[name] = found
    return found


def call(name, *arguments):
    """Call a function whose last argument is an incise_error; return its result, or raise."""
    failure, called = Failure(), function(name)
    result = called(*arguments, failure.ref)
    checked = failure.check if called.restype in (c_int, c_int64) else failure.require
    return checked(result)


def path_bytes(path):
    """A path as the C library takes it."""
    text = os.fsencode(os.fspath(path))
    if b"\0" in text:
        raise Invalid(errno.EINVAL, f"{path!r}: a path has no NUL; give another one")
    return text


def new_path(path, ending, overwrite=None):
    """The path of a file to write: it has that ending, and is new or may be overwritten.

    overwrite: None where the caller has no such choice.
    """
    name = path_bytes(path)
    if not name.endswith(ending.encode()):
        raise Invalid(errno.EINVAL, f"{os.fsdecode(name)}: expected a name that ends in {ending}")
    if not overwrite and os.path.lexists(name):
        remedy = "" if overwrite is None else ", or overwrite=True"
        raise Exists(errno.EEXIST, f"{os.fsdecode(name)}: exists; give another name{remedy}")
    return name


_pip_names = {"PIL": "pillow", "sklearn": "scikit-learn"}


def package(name, purpose):
    """Import an optional package, or raise one line that names it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        top = name.partition(".")[0]
        raise NotFound(
            errno.ENOENT,
            f"{purpose} needs {top}; install python3-{top.lower()}, "
            f"or pip install {_pip_names.get(top, top)}",
        ) from None


# --- structs ----------------------------------------------------------------------------


Stream, RecordingInfo, CalibrationStruct, FrameStruct = structs("""
    struct incise_stream {
        char name[16], device[64];
        bool timestamped;
        double nominal_hz, delay_ms, delay_sd_ms;
        uint64_t rows, lost, late;
        double rate_hz, drift_ppm, drift_sd_ppm, jitter_ms, jitter_max_ms, offset_ms;
        double offset_sd_ms;
        char ended[200], note[300];
    };
    struct incise_recording_info {
        bool complete;
        int64_t start_ns, end_ns;
        char started[32], rig[256];
        uint64_t force, tracker, depth, force_lost, tracker_lost, force_clipped;
        int bits;
        double full_scale_V, offset_V, force_mV_N, zero_mV, depth_mm_px, surface_normal[3];
        double surface_point_mm[3], tip_mm[3];
        int cuts;
        double depth_max_mm, force_max_N;
        struct incise_stream streams[3];
        int n_streams;
        bool newtons;
        int64_t start_utc_ns;
        bool summary;
    };
    struct incise_calibration {
        double force_mV_N, force_zero_mV, depth_mm_px, force_delay_ms, force_delay_sd_ms;
        double tracker_delay_ms, tracker_delay_sd_ms, camera_delay_ms, camera_delay_sd_ms;
        double tip_mm[3], surface_u_mm, stepper_N_step, stepper_backlash_mm;
        double stepper_hysteresis_N, stepper_stiction_N, stepper_steps_s;
        double frame_turn_deg[3], frame_mm[3];
    };
    struct incise_camera_frame {
        int64_t t_ns;
        uint64_t seq;
        int width, height, stride, pixels;
        void *data;
        size_t size;
    };
    """)


ExportProgress = ctypes.CFUNCTYPE(c_int, c_void_p, c_double)


(ExportOptions,) = structs(
    """
    struct incise_export_options {
        double rate_hz;
        int depth_bins, velocity_bins;
        double depth_max_mm, velocity_max_mm_s;
        bool by_cut;
        int min_count;
        bool resample;
        struct incise_calibration *calibration;
        bool provenance, ros2, tai;
        int uncertainty;
        double from_s, to_s;
        int cut;
        double every_s;
        const char *calibration_path;
        ExportProgress progress;
        void *context;
    };
    """,
    ExportProgress=ExportProgress,
)


class ArrowSchema(Struct, of="struct ArrowSchema"):
    pass


class ArrowArray(Struct, of="struct ArrowArray"):
    pass


class ArrowArrayStream(Struct, of="struct ArrowArrayStream"):
    pass


ArrowSchema._fields_ = [
    ("format", c_char_p),
    ("name", c_char_p),
    ("metadata", c_void_p),
    ("flags", c_int64),
    ("n_children", c_int64),
    ("children", ctypes.POINTER(ctypes.POINTER(ArrowSchema))),
    ("dictionary", ctypes.POINTER(ArrowSchema)),
    ("release", ctypes.CFUNCTYPE(None, ctypes.POINTER(ArrowSchema))),
    ("private_data", c_void_p),
]
ArrowArray._fields_ = [
    ("length", c_int64),
    ("null_count", c_int64),
    ("offset", c_int64),
    ("n_buffers", c_int64),
    ("n_children", c_int64),
    ("buffers", ctypes.POINTER(c_void_p)),
    ("children", ctypes.POINTER(ctypes.POINTER(ArrowArray))),
    ("dictionary", ctypes.POINTER(ArrowArray)),
    ("release", ctypes.CFUNCTYPE(None, ctypes.POINTER(ArrowArray))),
    ("private_data", c_void_p),
]
ArrowArrayStream._fields_ = [
    (
        "get_schema",
        ctypes.CFUNCTYPE(c_int, ctypes.POINTER(ArrowArrayStream), ctypes.POINTER(ArrowSchema)),
    ),
    (
        "get_next",
        ctypes.CFUNCTYPE(c_int, ctypes.POINTER(ArrowArrayStream), ctypes.POINTER(ArrowArray)),
    ),
    ("get_last_error", ctypes.CFUNCTYPE(c_char_p, ctypes.POINTER(ArrowArrayStream))),
    ("release", ctypes.CFUNCTYPE(None, ctypes.POINTER(ArrowArrayStream))),
    ("private_data", c_void_p),
]


def text(value):
    """A text of the C library."""
    return value.decode("utf-8", "replace")


def values(struct, names):
    """Members of a struct as Python's values: texts, and tuples for arrays."""
    for name in names:
        value = getattr(struct, name)
        if isinstance(value, bytes):
            value = text(value)
        elif isinstance(value, ctypes.Array):
            value = tuple(value)
        yield "" if value is None else value


def call_interruptible(call, cancel):
    """Run a long C call in a thread, so that Ctrl-C works: it calls cancel(), and the call ends.

    Python handles signals between its own instructions only, and has none during a C call.
    """
    import signal
    import threading

    if threading.current_thread() is not threading.main_thread():
        return call()
    result, done, stopped = [], threading.Event(), []

    def run():
        try:
            result.append((True, call()))
        except BaseException as failure:  # raised again in the caller
            result.append((False, failure))
        finally:
            done.set()

    def stop(failure):
        stopped.append(failure)
        cancel()

    def interrupted(number, frame):
        try:
            handler(number, frame)
        except BaseException as failure:
            stop(failure)

    # The caller frees what the call uses, so nothing is raised before the call has ended. A handler of
    # our own, since Python's may raise in Thread.start(), when the call runs already.
    handler = signal.getsignal(signal.SIGINT)
    if callable(handler):
        signal.signal(signal.SIGINT, interrupted)
    try:
        threading.Thread(target=run, daemon=True).start()
        while not done.is_set():
            try:
                done.wait()
            except BaseException as failure:  # of another signal's handler
                stop(failure)
    finally:
        if callable(handler):
            signal.signal(signal.SIGINT, handler)
    if stopped:
        raise stopped[0]
    good, value = result[0]
    if not good:
        raise value
    return value
