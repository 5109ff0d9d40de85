# SPDX-License-Identifier: LGPL-2.1-or-later
"""Fuzzy force models: evaluated, saved, compiled to fixed point, and learnt from data."""

from __future__ import annotations

import ctypes
import errno
import math
import os
import tempfile
import warnings
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Union

from . import _library
from ._library import ArrowArrayStream, Failure, Invalid, c_bool, c_char, c_double, c_int, c_void_p
from ._library import function, text
from .recording import PathLike, Recording

INPUTS_MAX, RULES_MAX, NAME_MAX = 8, 256, 64
_doubles = ctypes.POINTER(c_double)

FIXED_ONE = 1 << 16  # 1.0 in a compiled model


class VariableStruct(ctypes.Structure):
    """struct incise_variable"""

    _fields_ = [("name", c_char * NAME_MAX), ("min", c_double), ("max", c_double)]
    c_name = "struct incise_variable"


class ModelInfoStruct(ctypes.Structure):
    """struct incise_model_info"""

    _fields_ = [
        ("name", c_char * NAME_MAX),
        ("n_inputs", c_int),
        ("n_rules", c_int),
        ("and_method", c_int),
        ("input", VariableStruct * INPUTS_MAX),
        ("output", VariableStruct),
        ("n_mfs", c_int * INPUTS_MAX),
    ]
    c_name = "struct incise_model_info"


class PairsStruct(ctypes.Structure):
    """struct incise_pairs"""

    _fields_ = [("rows", _doubles), ("n", ctypes.c_size_t), ("n_inputs", c_int)]
    c_name = "struct incise_pairs"


class SideStruct(ctypes.Structure):
    """struct incise_train_side"""

    _fields_ = [("pairs", PairsStruct), ("groups", ctypes.POINTER(c_int)), ("n_groups", c_int)]
    c_name = "struct incise_train_side"


_Progress = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p)


class TrainOptionsStruct(ctypes.Structure):
    """struct incise_train_options"""

    _fields_ = [
        ("epochs", c_int),
        ("step", c_double),
        ("ridge", c_double),
        ("classic", c_bool),
        ("groups", ctypes.POINTER(c_int)),
        ("seed", ctypes.c_uint64),
        ("progress", _Progress),
        ("user", c_void_p),
        ("starts", c_int),
        ("tuned", ctypes.c_size_t),
        ("uncertainty", ctypes.POINTER(c_void_p)),
        ("ranges", ctypes.POINTER(VariableStruct)),
    ]
    c_name = "struct incise_train_options"


class Stop:
    """The progress of a training, by which another thread ends it."""

    def __init__(self, options: TrainOptionsStruct):
        self.set = False
        options.progress = _Progress(lambda _user, _step: self.set)

    def cancel(self) -> None:
        self.set = True


class TrainReportStruct(ctypes.Structure):
    """struct incise_train_report"""

    _fields_ = [
        ("epochs", c_int),
        ("best_epoch", c_int),
        ("ridge", c_double),
        ("train_rmse", c_double),
        ("check_rmse", c_double),
        ("condition", c_double),
        ("parameters", c_int),
        ("rules_unfired", c_int),
        ("train_r2", c_double),
        ("check_r2", c_double),
        ("crossval_rmse", c_double),
        ("start", c_int),
        ("pairs_tuned", ctypes.c_size_t),
        ("unfired", c_bool * RULES_MAX),
        ("averaged", c_int),
        ("plane_weight", c_double),
        ("mean_weight", c_double),
        ("cut_weight", c_double),
    ]
    c_name = "struct incise_train_report"


class BaselinesStruct(ctypes.Structure):
    """struct incise_baselines"""

    _fields_ = [("mean", c_double), ("linear", c_double), ("knn", c_double), ("k", c_int)]
    c_name = "struct incise_baselines"


class FixedOptionsStruct(ctypes.Structure):
    """struct incise_fixed_options"""

    _fields_ = [("budget", c_double), ("arithmetic", c_int), ("cells", c_int)]
    c_name = "struct incise_fixed_options"


class FixedInputStruct(ctypes.Structure):
    """struct incise_fixed_input"""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("min", ctypes.c_int32),
        ("max", ctypes.c_int32),
        ("n_mfs", ctypes.c_int32),
        ("cell_shift", ctypes.c_int32),
        ("cells", ctypes.c_int32),
        ("values", ctypes.POINTER(ctypes.c_int32)),
    ]
    c_name = "struct incise_fixed_input"


class FixedStruct(ctypes.Structure):
    """struct incise_fixed"""

    _fields_ = [
        ("arithmetic", c_int),
        ("n_inputs", ctypes.c_int32),
        ("n_rules", ctypes.c_int32),
        ("shift_a", ctypes.c_int32),
        ("shift_b", ctypes.c_int32),
        ("bound", ctypes.c_uint64),
        ("input", FixedInputStruct * 4),
        ("name", ctypes.c_char_p),
        ("output", ctypes.c_char_p),
        ("data", c_void_p),
        ("blob", c_void_p),
        ("size", ctypes.c_uint32),
    ]
    c_name = "struct incise_fixed"


_path = ctypes.c_char_p
_library.declare(
    "libincise",
    {
        "incise_model_load": (c_void_p, _path, c_void_p),
        "incise_model_save_notes": (c_int, c_void_p, _path, ctypes.c_char_p, c_void_p),
        "incise_model_free": (None, c_void_p),
        "incise_model_info": (ctypes.POINTER(ModelInfoStruct), c_void_p),
        "incise_model_set_clamp": (None, c_void_p, c_bool),
        "incise_inputs_check": (
            c_int, c_void_p, c_int, c_void_p, ctypes.c_size_t, c_void_p, c_void_p
        ),
        "incise_model_eval_many": (None, c_void_p, c_void_p, ctypes.c_size_t, c_void_p, c_void_p),
        "incise_uncertainty_load": (c_void_p, _path, c_void_p, c_void_p),
        "incise_uncertainty_save": (c_int, c_void_p, _path, c_void_p),
        "incise_uncertainty_free": (None, c_void_p),
        "incise_uncertainty_noise": (c_double, c_void_p),
        "incise_uncertainty_sd_many": (
            None,
            c_void_p,
            c_void_p,
            c_void_p,
            ctypes.c_size_t,
            c_void_p,
        ),
        "incise_uncertainty_parts_many": (
            None,
            c_void_p,
            c_void_p,
            c_void_p,
            ctypes.c_size_t,
            c_void_p,
        ),
        "incise_fixed_compile": (
            ctypes.POINTER(FixedStruct),
            c_void_p,
            ctypes.POINTER(FixedOptionsStruct),
            c_void_p,
        ),
        "incise_fixed_load": (ctypes.POINTER(FixedStruct), _path, c_void_p),
        "incise_fixed_save": (c_int, ctypes.POINTER(FixedStruct), _path, c_void_p),
        "incise_fixed_free": (None, ctypes.POINTER(FixedStruct)),
        "incise_fixed_bound": (c_double, ctypes.POINTER(FixedStruct)),
        "incise_fixed_arithmetic_name": (ctypes.c_char_p, c_int),
        "incise_fixed_options_init": (None, ctypes.POINTER(FixedOptionsStruct)),
        "incise_fixed_eval_double": (c_double, ctypes.POINTER(FixedStruct), c_void_p),
        "incise_fixed_eval_batch": (
            None,
            ctypes.POINTER(FixedStruct),
            c_void_p,
            c_void_p,
            ctypes.c_size_t,
        ),
    },
)
_names = ctypes.POINTER(ctypes.c_char_p)
_library.declare(
    "libincise-learn",
    {
        "incise_dataset_read_where": (
            c_void_p,
            _path,
            _names,
            c_int,
            ctypes.c_char_p,
            ctypes.c_char_p,
            ctypes.POINTER(ctypes.c_size_t),
            c_void_p,
        ),
        "incise_dataset_from_arrow": (
            c_void_p,
            ctypes.POINTER(ArrowArrayStream),
            _names,
            c_int,
            ctypes.c_char_p,
            ctypes.c_char_p,
            ctypes.POINTER(ctypes.c_size_t),
            c_void_p,
        ),
        "incise_dataset_has": (c_bool, _path, ctypes.c_char_p, c_void_p),
        "incise_dataset_free": (None, c_void_p),
        "incise_dataset_rows": (ctypes.c_size_t, c_void_p),
        "incise_train_options_init": (None, ctypes.POINTER(TrainOptionsStruct)),
        "incise_train_split": (
            c_int,
            c_void_p,
            c_double,
            ctypes.c_uint64,
            ctypes.POINTER(SideStruct),
            ctypes.POINTER(SideStruct),
            c_void_p,
        ),
        "incise_train_side_free": (None, ctypes.POINTER(SideStruct)),
        "incise_train_start": (
            c_void_p,
            ctypes.POINTER(PairsStruct),
            _names,
            c_int,
            ctypes.POINTER(c_int),
            ctypes.POINTER(TrainOptionsStruct),
            c_void_p,
        ),
        "incise_train": (
            c_int,
            c_void_p,
            ctypes.POINTER(PairsStruct),
            ctypes.POINTER(PairsStruct),
            ctypes.POINTER(TrainOptionsStruct),
            ctypes.POINTER(TrainReportStruct),
            c_void_p,
        ),
        "incise_baselines": (
            c_int,
            ctypes.POINTER(PairsStruct),
            ctypes.POINTER(c_int),
            ctypes.POINTER(PairsStruct),
            _Progress,
            c_void_p,
            ctypes.POINTER(BaselinesStruct),
            c_void_p,
        ),
    },
)


class Variable(NamedTuple):
    """An input or the output of a model, with the range that it was trained on."""

    name: str
    min: float
    max: float


class Points:
    """Inputs of a model as one block of doubles, in the form that they came in.

    Columns of tables go by their names. Values have to be finite; a warning counts the points
    outside the ranges.
    """

    def __init__(self, x: Any, inputs: Any):
        """inputs: structs of the variables, in the order of the model."""
        n_inputs = len(inputs)
        columns = self._by_name(x, [text(variable.name) for variable in inputs])
        if columns is not None:
            x = self._join(columns)
        self.array = self._of_numpy(x)
        if self.array is not None:
            self._check_shape(self.array.shape, n_inputs)
            self.shape = self.array.shape[:-1]
            self.n = math.prod(self.shape)
            self.address = self.array.ctypes.data
        else:
            rows, self.shape = self._of_lists(x, n_inputs)
            self.n = len(rows) // n_inputs
            self._block = (c_double * max(len(rows), 1))(*rows)
            self.address = ctypes.addressof(self._block)
        self._check(inputs)

    def _check(self, inputs: Any) -> None:
        failure, outside = Failure(), ctypes.c_size_t()
        failure.check(
            function("incise_inputs_check")(
                (VariableStruct * len(inputs))(*inputs),
                len(inputs),
                self.address,
                self.n,
                ctypes.byref(outside),
                failure.ref,
            )
        )
        if outside.value:
            ranges = ", ".join(f"{text(v.name)} {v.min:.4g} to {v.max:.4g}" for v in inputs)
            warnings.warn(
                f"{outside.value} of {self.n} points are outside the training range ({ranges}) and "
                "are clamped to it",
                stacklevel=4,
            )

    @staticmethod
    def _by_name(x: Any, names: List[str]) -> Optional[List[Any]]:
        """The columns of a table, {column: values} or structured array; None: it is none."""
        found = getattr(getattr(x, "dtype", None), "names", None)
        for attribute in ("column_names", "columns"):
            found = getattr(x, attribute, None) if found is None else found
        if found is None and hasattr(x, "keys"):
            found = x.keys()
        if found is None or not any(isinstance(name, str) for name in found):
            return None
        missing = [name for name in names if name not in list(found)]
        if missing:
            raise Invalid(
                errno.EINVAL,
                f"inputs have no column {', '.join(missing)}; the columns are "
                f"{', '.join(map(str, found))}",
            )
        return [x[name] for name in names]

    @classmethod
    def _join(cls, columns: List[Any]) -> Any:
        """One array, or rows without numpy."""
        arrays = [cls._of_numpy(column) for column in columns]
        if all(array is not None for array in arrays):
            import numpy

            try:
                return numpy.stack(arrays, axis=-1)
            except ValueError as failure:
                raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None
        if not all(hasattr(column, "__len__") for column in columns):
            return columns
        if len({len(column) for column in columns}) > 1:
            raise Invalid(errno.EINVAL, "inputs of a model: columns of different lengths")
        return list(zip(*columns))

    @staticmethod
    def _of_numpy(x: Any) -> Any:
        """An array of doubles, or None for plain lists and numbers without numpy."""
        import sys

        numpy = sys.modules.get("numpy")
        if numpy is None:
            if not hasattr(x, "__array__"):
                return None
            import numpy
        elif isinstance(x, (tuple, list)) and x and isinstance(x[0], (int, float)):
            return None
        try:
            if numpy.iscomplexobj(x):
                raise TypeError("complex numbers")
            if numpy.ma.isMaskedArray(x):
                x = x.astype(numpy.float64).filled(math.nan)
            return numpy.ascontiguousarray(x, dtype=numpy.float64).reshape(numpy.shape(x))
        except (TypeError, ValueError) as failure:
            raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None

    @staticmethod
    def _check_shape(shape: Tuple[int, ...], n_inputs: int) -> None:
        if not shape or shape[-1] != n_inputs:
            raise Invalid(
                errno.EINVAL,
                f"inputs have the shape {tuple(shape)}; the model has {n_inputs} inputs, so the "
                f"last length must be {n_inputs}",
            )

    @classmethod
    def _of_lists(cls, x: Any, n_inputs: int) -> Tuple[List[float], Optional[Tuple[int, ...]]]:
        try:
            single = not x or isinstance(x[0], (int, float))
            rows = [x] if single else list(x)
            numbers = [float(value) for row in rows for value in row]
        except (TypeError, ValueError, KeyError) as failure:
            raise Invalid(errno.EINVAL, f"inputs of a model: {failure}") from None
        for row in rows:
            cls._check_shape((len(row),), n_inputs)
        return numbers, None if single else (len(rows),)

    def results(self, width: int = 1) -> Tuple[Any, int]:
        """Room for width results a point: (block, its address)."""
        if self.array is not None:
            import numpy

            shape = self.shape + ((width,) if width > 1 else ())
            block = numpy.empty(shape, dtype=numpy.float64)
            return block, block.ctypes.data
        block = (c_double * max(self.n * width, 1))()
        return block, ctypes.addressof(block)

    def finish(self, block: Any, width: int = 1) -> Any:
        """Results in the form of the inputs: an array, a list, or for one point a number."""
        if self.array is not None:
            return block if block.shape else float(block)
        values: List[Any] = list(block[: self.n * width])
        if width > 1:
            values = [values[i : i + width] for i in range(0, len(values), width)]
        return values if self.shape is not None else values[0]


class CompiledModel:
    """The model of a .fx file: in fixed point, with a certified bound of its error."""

    def __init__(self, path: PathLike):
        failure = Failure()
        name = _library.path_bytes(path)
        self._own(failure.require(function("incise_fixed_load")(name, failure.ref)))

    def _own(self, pointer: Any) -> None:
        self._pointer = _library.Handle(pointer, "incise_fixed_free")
        self._struct = pointer.contents
        self._inputs = [
            VariableStruct(v.name, v.min / FIXED_ONE, v.max / FIXED_ONE)
            for v in self._struct.input[: self._struct.n_inputs]
        ]

    @classmethod
    def _of(cls, pointer: Any) -> "CompiledModel":
        """Of a pointer that it frees."""
        compiled = cls.__new__(cls)
        compiled._own(pointer)
        return compiled

    def __reduce__(self) -> Any:
        return _compiled_of_bytes, (ctypes.string_at(self._struct.blob, self._struct.size),)

    @classmethod
    def load(cls, path: PathLike) -> "CompiledModel":
        """Read a .fx file: the same as CompiledModel(path)."""
        return cls(path)

    @property
    def bound(self) -> float:
        """Certified largest error, in the output's unit."""
        return function("incise_fixed_bound")(self._pointer)

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self._struct.size

    @property
    def arithmetic(self) -> str:
        """direct, table or force."""
        return text(function("incise_fixed_arithmetic_name")(self._struct.arithmetic))

    def __call__(self, x: Any) -> Any:
        """The output at one point, or at each point of an array (…, inputs)."""
        points = Points(x, self._inputs)
        block, address = points.results()
        one = function("incise_fixed_eval_double")
        step = 8 * self._struct.n_inputs
        out = (c_double * points.n).from_address(address) if points.n else []
        for k in range(points.n):
            out[k] = one(self._pointer, points.address + k * step)
        return points.finish(block)

    def save(self, path: PathLike) -> None:
        """Write the .fx file, whole or not at all."""
        failure = Failure()
        failure.check(
            function("incise_fixed_save")(self._pointer, _library.path_bytes(path), failure.ref)
        )


class TrainReport(NamedTuple):
    """Report of :func:`incise.train`; errors in the output's unit, NaN without data."""

    pairs: int  #: trained from
    check_pairs: int  #: kept back
    left_out: int  #: rows where the blade did not advance
    epochs: int
    ridge: float
    train_rms_error: float
    check_rms_error: float
    crossval_rms_error: float
    condition: float
    parameters: int
    rules_unfired: int
    train_r2: float
    check_r2: float
    baselines: Dict[str, float]  #: rms error of mean, linear, knn on the pairs kept back


class Model:
    """The fuzzy model of a .fis file, with its standard deviation if PATH.sd is there: call it with
    inputs in the order of :attr:`inputs`, or with a table, {column: values} or structured array that
    has columns of their names.

    model((5, 20)) is one force; model(x) of an array (…, inputs) an array; with sd=True a pair of
    these, the output and its standard deviation for a new cut. A value that is not finite or is masked
    is an error; points outside the ranges are clamped to them, with a warning.
    """

    def __init__(self, path: PathLike):
        failure = Failure()
        name = _library.path_bytes(path)
        self._own(failure.require(function("incise_model_load")(name, failure.ref)))
        if os.path.exists(name + b".sd"):
            self._set_uncertainty(
                failure.require(
                    function("incise_uncertainty_load")(
                        name + b".sd", self._pointer, failure.ref
                    )
                )
            )

    def _own(self, pointer: int) -> None:
        self._pointer = _library.Handle(pointer, "incise_model_free")
        self._set_uncertainty(None)
        self.report: Optional[TrainReport] = None  #: of the training, if it was trained here
        self._notes = b""  # of a training from many sources: version, options and sources

    @classmethod
    def _of(cls, pointer: int) -> "Model":
        """Of a pointer that it frees."""
        model = cls.__new__(cls)
        model._own(pointer)
        return model

    @classmethod
    def load(cls, path: PathLike) -> "Model":
        """The same as Model(path)."""
        return cls(path)

    def _set_uncertainty(self, pointer: Optional[int]) -> None:
        self._uncertainty = pointer and _library.Handle(pointer, "incise_uncertainty_free")

    def __reduce__(self) -> Any:
        """Copies and pickles are the files, whose numbers are exact."""
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "model.fis")
            self.save(path)
            texts = tuple(
                _bytes_of(name) if os.path.exists(name) else None for name in (path, path + ".sd")
            )
        return _model_of_bytes, (*texts, self.report, self._notes)

    def __repr__(self) -> str:
        inputs = ", ".join(variable.name for variable in self.inputs)
        return f"<incise.Model {self.output.name} of {inputs}, {self.n_rules} rules>"

    def _inputs(self) -> Any:
        return self._info().input[: self._info().n_inputs]

    def _info(self) -> ModelInfoStruct:
        return function("incise_model_info")(self._pointer).contents

    @property
    def inputs(self) -> Tuple[Variable, ...]:
        """Inputs, with their ranges."""
        info = self._info()
        return tuple(
            Variable(text(v.name), v.min, v.max) for v in info.input[: info.n_inputs]
        )

    @property
    def output(self) -> Variable:
        """The output, with the range that it was trained on."""
        v = self._info().output
        return Variable(text(v.name), v.min, v.max)

    @property
    def n_rules(self) -> int:
        """Rules."""
        return self._info().n_rules

    @property
    def noise(self) -> float:
        """Standard deviation of new cuts where data are dense; NaN without a .sd file."""
        if not self._uncertainty:
            return math.nan
        return function("incise_uncertainty_noise")(self._uncertainty)

    def __call__(self, x: Any, *, sd: bool = False, parts: bool = False) -> Any:
        """The output; with sd=True (output, standard deviation).

        With parts=True too (output, standard deviation, parts): in the last dimension of the parts
        data, model, calibration and rig, whose squares add up to that of the standard deviation.
        """
        if parts and not sd:
            raise Invalid(errno.EINVAL, "parts are those of the standard deviation; give sd=True")
        points = Points(x, self._inputs())
        block, address = points.results()
        function("incise_model_eval_many")(
            self._pointer, points.address, points.n, address, None
        )
        if not sd:
            return points.finish(block)
        if not self._uncertainty:
            raise Invalid(
                errno.EINVAL,
                "the model has no standard deviation; train it here, or load a .fis that has its "
                ".fis.sd beside it",
            )
        spread, spread_address = points.results()
        function("incise_uncertainty_sd_many")(
            self._uncertainty, self._pointer, points.address, points.n, spread_address
        )
        if not parts:
            return points.finish(block), points.finish(spread)
        # struct incise_uncertainty_parts: the total, and four parts
        whole, whole_address = points.results(5)
        function("incise_uncertainty_parts_many")(
            self._uncertainty, self._pointer, points.address, points.n, whole_address
        )
        each = points.finish(whole, 5)
        if points.array is not None:
            each = each[..., 1:]
        elif points.shape is None:
            each = each[1:]
        else:
            each = [row[1:] for row in each]
        return points.finish(block), points.finish(spread), each

    def gradient(self, x: Any) -> Any:
        """Slopes of the output by each input, in the last dimension; 0 outside the ranges."""
        n_inputs = self._info().n_inputs
        points = Points(x, self._inputs())
        _, address = values = points.results()
        block, gradient_address = points.results(n_inputs)
        function("incise_model_eval_many")(
            self._pointer, points.address, points.n, address, gradient_address
        )
        del values
        return points.finish(block, n_inputs)

    def save(self, path: PathLike) -> None:
        """Write the .fis file, and its standard deviation as PATH.sd; each whole or not at all.

        A model trained from a list of sources notes version, options and sources, as the tool does.
        """
        failure = Failure()
        name = _library.path_bytes(path)
        failure.check(
            function("incise_model_save_notes")(self._pointer, name, self._notes, failure.ref)
        )
        if self._uncertainty:
            failure.check(
                function("incise_uncertainty_save")(
                    self._uncertainty, name + b".sd", failure.ref
                )
            )

    def compile(self, *, budget_mN: float = 0.1) -> CompiledModel:
        """Compile to fixed point; the certified error is at most budget_mN (0: any)."""
        options = FixedOptionsStruct()
        function("incise_fixed_options_init")(ctypes.byref(options))
        options.budget = budget_mN * 1e-3
        failure = Failure()
        return CompiledModel._of(
            failure.require(
                function("incise_fixed_compile")(
                    self._pointer, ctypes.byref(options), failure.ref
                )
            )
        )


def _bytes_of(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read()


def _write_bytes(path: str, content: bytes) -> None:
    with open(path, "wb") as file:
        file.write(content)


def _model_of_bytes(
    fis: bytes, sd: Optional[bytes], report: Optional[TrainReport], notes: bytes = b""
) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "model.fis")
        _write_bytes(path, fis)
        if sd is not None:
            _write_bytes(path + ".sd", sd)
        model = Model.load(path)
    model.report, model._notes = report, notes
    return model


def _compiled_of_bytes(blob: bytes) -> CompiledModel:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "model.fx")
        _write_bytes(path, blob)
        return CompiledModel.load(path)


def name_array(names: Sequence[str]) -> Any:
    return (ctypes.c_char_p * len(names))(*(name.encode() for name in names))


def is_path(data: Any) -> bool:
    return isinstance(data, (str, bytes, os.PathLike))


def is_recording(data: Any) -> bool:
    """Whether it is a path with the name of a recording."""
    return is_path(data) and _library.path_bytes(data).rstrip(b"/").endswith((b".rec", b".part"))


def has_cuts(data: Any) -> bool:
    """Whether it is a recording, or a file or a table with the column cut."""
    if isinstance(data, Recording) or is_recording(data):
        return True
    if not is_path(data):
        names = getattr(data, "column_names", getattr(data, "columns", data))
        return isinstance(names, Iterable) and "cut" in list(names)
    path = _library.path_bytes(data)
    return os.path.isfile(path) and function("incise_dataset_has")(path, b"cut", None)


def _read_dataset(
    data: Any, columns: Sequence[str], group: Optional[str], where: Optional[str]
) -> Tuple[int, int]:
    """A dataset of a path or a table, and how many rows were left out."""
    failure, left_out = Failure(), ctypes.c_size_t()
    rest = (
        name_array(columns),
        len(columns),
        group.encode() if group else None,
        where.encode() if where else None,
        ctypes.byref(left_out),
        failure.ref,
    )
    if isinstance(data, Recording):
        data = data.pairs(depth_bins=12, velocity_bins=10, by_cut=True)
    if is_recording(data):
        return _read_dataset(Recording(os.fsdecode(data)), columns, group, where)
    if is_path(data):
        dataset = function("incise_dataset_read_where")(_library.path_bytes(data), *rest)
    else:
        from ._producer import open_stream

        stream, keep = open_stream(data)
        dataset = function("incise_dataset_from_arrow")(ctypes.byref(stream), *rest)
        del keep
    return failure.require(dataset), left_out.value


def start(
    pairs: PairsStruct, names: Sequence[str], mf_type: int, mf: Any, options: TrainOptionsStruct
) -> int:
    """The model that a training starts from."""
    failure = Failure()
    return failure.require(
        function("incise_train_start")(
            ctypes.byref(pairs), name_array(names), mf_type, mf, ctypes.byref(options), failure.ref
        )
    )


def baselines(fit: SideStruct, check: SideStruct, progress: Any) -> BaselinesStruct:
    """Errors of simpler predictors on the pairs kept back."""
    failure, result = Failure(), BaselinesStruct()
    failure.check(
        function("incise_baselines")(
            ctypes.byref(fit.pairs),
            fit.groups,
            ctypes.byref(check.pairs),
            progress,
            None,
            ctypes.byref(result),
            failure.ref,
        )
    )
    return result


def report_of(
    report: TrainReportStruct,
    pairs: int,
    check_pairs: int,
    left_out: int,
    others: Optional[BaselinesStruct],
) -> TrainReport:
    return TrainReport(
        pairs,
        check_pairs,
        left_out,
        report.epochs,
        report.ridge,
        report.train_rmse,
        report.check_rmse,
        report.crossval_rmse,
        report.condition,
        report.parameters,
        report.rules_unfired,
        report.train_r2,
        report.check_r2,
        {"mean": others.mean, "linear": others.linear, "knn": others.knn} if others else {},
    )


class _Training:
    """One training; frees what it holds."""

    def __init__(self, dataset: int, share: float, options: TrainOptionsStruct):
        self.dataset, self.options = dataset, options
        self.fit, self.check = SideStruct(), SideStruct()
        self.stop = Stop(options)
        self.failure = Failure()
        self.has_check = share != 0
        self.failure.check(
            function("incise_train_split")(
                dataset,
                share,
                options.seed,
                ctypes.byref(self.fit),
                ctypes.byref(self.check),
                self.failure.ref,
            )
        )
        options.groups = self.fit.groups

    def close(self) -> None:
        function("incise_train_side_free")(ctypes.byref(self.fit))
        if self.has_check:
            function("incise_train_side_free")(ctypes.byref(self.check))
        function("incise_dataset_free")(self.dataset)

    def run(self, model: Model) -> TrainReportStruct:
        report, uncertainty = TrainReportStruct(), c_void_p()
        self.options.uncertainty = ctypes.pointer(uncertainty)
        self.failure.check(
            function("incise_train")(
                model._pointer,
                ctypes.byref(self.fit.pairs),
                ctypes.byref(self.check.pairs) if self.has_check else None,
                ctypes.byref(self.options),
                ctypes.byref(report),
                self.failure.ref,
            )
        )
        model._set_uncertainty(uncertainty.value)
        return report


_mf_types = {"gaussmf": 0, "gbellmf": 1}


def _mf_counts(mf: Union[str, Sequence[int], None], n_inputs: int) -> Any:
    if mf is None:
        mf = (5, 4) if n_inputs == 2 else (3,) * n_inputs
    if isinstance(mf, str):
        if mf != "auto":
            raise Invalid(errno.EINVAL, f"mf={mf!r}: give 'auto', or a count for each input")
        mf = (0,) * n_inputs
    elif len(mf) != n_inputs or not all(1 <= int(n) <= 32 for n in mf):
        raise Invalid(
            errno.EINVAL, f"mf={tuple(mf)!r}: give a count from 1 to 32 for each of {n_inputs} inputs"
        )
    return (c_int * INPUTS_MAX)(*(int(n) for n in mf))


def train(
    data: Any,
    *,
    inputs: Sequence[str] = ("depth_mm", "velocity_mm_s"),
    target: str = "force_N",
    group: Optional[str] = None,
    check: float = 0,
    seed: int = 1,
    mf: Union[str, Sequence[int], None] = None,
    mf_type: str = "gaussmf",
    epochs: int = 80,
    ridge: Optional[float] = None,
    starts: int = 3,
    classic: bool = False,
    all_rows: bool = False,
) -> Model:
    """Learn a model as `incise train` does: same data, options and seed give the same model.

    data: a list of sources, or one table, whose pairs are then all in memory.

    A list [source, …] is read twice in bounded memory, and files in it give the very file that the
    tool writes of them. A source is a CSV file, a recording (every force sample of its cuts), a table
    that can be read again (anything with ``__arrow_c_stream__``, a DataFrame, {column: values}), or a
    function that returns such a table anew each time it is called, with the same rows::

        def strokes():  # batch by batch
            file = pyarrow.parquet.ParquetFile("strokes.parquet")
            return pyarrow.RecordBatchReader.from_batches(file.schema_arrow, file.iter_batches())

        incise.train(["a.csv", "b.rec", ("strokes", strokes)], group="cut")

    (name, table) names a table; without one it is "source N" by its place in the list. The SHA-256 of
    the name takes the place of a file's in the random choices and in the notes of the model: with
    names, the order of the list changes nothing.

    One table is a CSV file, a recording (its pairs averaged in 12 × 10 bins, by cut), or a table as
    above. The tool searches the premises of more than 20000 pairs on a random sample of them, and
    holds out other single rows where check is given without group; so does a list, [source] too.

    group: column that names the cut; cross-validation and check keep whole cuts together. In a list
    also "recording" or "rig"; cuts of different sources are different ones. Without it data are
    grouped by "cut" where all have it; "none" takes each row by itself.
    check: share that is kept back, 0 to 1; its error is in ``model.report``.
    mf: membership functions of each input (default 5, 4; else 3 each), or "auto".
    classic: the method of MATLAB's anfis; not for a list.
    all_rows: also take rows whose column ``advancing`` is 0.
    Ctrl-C ends the training.
    """
    if mf_type not in _mf_types:
        raise Invalid(errno.EINVAL, f"mf_type={mf_type!r}: gaussmf or gbellmf")
    if not 0 <= check < 1:
        raise Invalid(errno.EINVAL, f"check={check!r}: a share from 0 to below 1")
    names = [*inputs, target]
    counts = _mf_counts(mf, len(inputs))
    options = TrainOptionsStruct()
    function("incise_train_options_init")(ctypes.byref(options))
    options.epochs, options.seed, options.starts = epochs, seed, starts
    options.classic = classic
    if ridge is not None:
        options.ridge = ridge
    if isinstance(data, (list, tuple)):
        from ._corpus import train_sources

        return train_sources(
            data, names, options, group, check, all_rows, _mf_types[mf_type], counts
        )
    if group is None and has_cuts(data):
        group = "cut"
    group = None if group == "none" else group
    # Not in this thread, whose KeyboardInterrupt a callback of the reading would swallow.
    dataset, left_out = _library.call_interruptible(
        lambda: _read_dataset(data, names, group, None if all_rows else "advancing"),
        lambda: None,
    )
    training = _Training(dataset, check, options)

    def learn() -> Model:
        model = Model._of(start(training.fit.pairs, names, _mf_types[mf_type], counts, options))
        report = training.run(model)
        model.report = report_of(
            report,
            training.fit.pairs.n,
            training.check.pairs.n,
            left_out,
            baselines(training.fit, training.check, options.progress) if training.has_check else None,
        )
        return model

    try:
        return _library.call_interruptible(learn, training.stop.cancel)
    finally:
        training.close()


def load(path: PathLike) -> Union[Model, CompiledModel]:
    """Read a model, .fis or .fx."""
    if os.fspath(path).endswith(".fx"):
        return CompiledModel.load(path)
    return Model.load(path)
