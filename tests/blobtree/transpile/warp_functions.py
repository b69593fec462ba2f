"""Every typed function of a module as a Warp kernel over arrays, made from its annotations.

    call(falloff, squared_distance=np.linspace(0, 1, 100))      the function at 100 arguments
    typed_functions(blobtree.kernels)                           what a module defines, with the types

Warp reads kernels from files, so a file of kernels is written per module; its text, and so Warp's cache of
the compiled kernels, is the same in every run.
"""

import atexit
import importlib.util
import shutil
import sys
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike, NDArray

from blobtree.declare.claims import OperatorRow
from blobtree.declare.skeleton import Skeleton
from blobtree.declare.warp import SpaceWarp
from blobtree.transpile.glsl import uniforms_of

_SCALARS = {wp.float32: np.float32, wp.int32: np.int32, wp.uint32: np.uint32, wp.bool: np.bool_}


@dataclass(frozen=True)
class TypedFunction:
    """A `@wp.func`, what it takes and what it returns, as Warp types or `wp.array`s of them."""

    function: wp.Function
    parameters: dict[str, Any]
    returned: Any

    @property
    def name(self) -> str:
        return str(self.function.key)


def typed_functions(module: ModuleType) -> list[TypedFunction]:
    """The typed functions that `module` and its kinds define, save those that Warp specialises."""
    rows = OperatorRow | Skeleton | SpaceWarp
    kinds: list[Any] = [value for value in vars(module).values() if isinstance(value, type | rows)]
    names = ("operator", "skeleton", "warp")
    kinds += [row for kind in kinds for name in names if isinstance(row := vars(kind).get(name), rows)]
    found = {}
    for value in chain(vars(module).values(), *(vars(kind).values() for kind in kinds)):
        if (
            isinstance(value, wp.Function)
            and value.func is not None
            and value.func.__module__ == module.__name__
        ):
            hints = dict(value.func.__annotations__)
            returned = hints.pop("return")
            if not value.func.__code__.co_freevars:
                found[value.key] = TypedFunction(value, hints, returned)
    return [*found.values()]


def python_function(function: Any) -> FunctionType:
    """Return the Python function from which Warp made one."""
    assert isinstance(function.func, FunctionType)
    return function.func


def is_whole(hint: Any) -> bool:
    """Return True for parameters that are the same for all rows: arrays and structs of uniforms."""
    return isinstance(hint, wp.array) or uniforms_of(hint) is not None


def element(hint: Any) -> Any:
    """Return the type of one value of a parameter: of an array, that of its elements."""
    return hint.dtype if isinstance(hint, wp.array) else hint


def numpy_type(hint: Any) -> tuple[Any, tuple[int, ...]]:
    """NumPy type and shape of one value."""
    if hint in _SCALARS:
        return _SCALARS[hint], ()
    return _SCALARS[hint._wp_scalar_type_], hint._shape_


def call(function: Any, **arguments: Any) -> NDArray[Any]:
    """Call `function` for row i of every argument, for all i; arrays and structs are passed whole."""
    kernel, typed = _kernels(function.func.__module__)[str(function.key)]
    assert set(arguments) == set(typed.parameters), f"{typed.name} takes {list(typed.parameters)}"
    structs = {name for name, hint in typed.parameters.items() if uniforms_of(hint) is not None}
    prepared = {
        name: _prepared(hint, arguments[name])
        for name, hint in typed.parameters.items()
        if name not in structs
    }
    singles = [name for name, hint in typed.parameters.items() if not is_whole(hint)]
    count = max((len(prepared[name]) for name in singles), default=1)
    inputs: list[Any] = []
    for name, hint in typed.parameters.items():
        if name in structs:
            inputs.append(arguments[name])
            continue
        array = prepared[name]
        if name in singles:
            array = np.ascontiguousarray(np.broadcast_to(array, (count, *array.shape[1:])))
        inputs.append(wp.array(array, dtype=element(hint), device="cpu"))
    out = wp.empty(count, dtype=typed.returned, device="cpu")
    wp.launch(kernel, dim=count, inputs=inputs, outputs=[out], device="cpu")
    result: NDArray[Any] = out.numpy()
    return result


def _prepared(hint: Any, argument: ArrayLike) -> NDArray[Any]:
    dtype, shape = numpy_type(element(hint))
    array = np.asarray(argument, dtype)
    return array.reshape(-1, *shape)


@lru_cache
def _kernels(module_name: str) -> dict[str, tuple[wp.Kernel, TypedFunction]]:
    """Name → kernel over arrays, of every typed function of the module of this name."""
    functions = typed_functions(import_module(module_name))
    generated = f"generated_{module_name.replace('.', '_')}"
    folder = Path(tempfile.mkdtemp(prefix="kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)  # Warp reads the file as long as it runs
    path = folder / f"{generated}.py"
    path.write_text("\n".join([_HEAD, *map(_kernel_source, functions)]))
    spec = importlib.util.spec_from_file_location(generated, path)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    vars(made).update({function.name: function.function for function in functions})
    sys.modules[generated] = made
    spec.loader.exec_module(made)
    return {function.name: (getattr(made, f"run_{function.name}"), function) for function in functions}


_HEAD = (
    "import warp as wp\n\nfrom blobtree.kernels import KERNEL_OPTIONS\n\n"
    "wp.set_module_options(KERNEL_OPTIONS)\n"
)


def _kernel_source(typed: TypedFunction) -> str:
    def spelled(hint: Any, name: str = "return") -> str:
        if uniforms_of(hint) is not None:
            return f"{typed.name}.func.__annotations__[{name!r}]"
        return f"wp.array(dtype=wp.{element(hint).__name__})"

    parameters = ", ".join(f"x_{name}: {spelled(hint, name)}" for name, hint in typed.parameters.items())
    arguments = ", ".join(
        f"x_{name}" if is_whole(hint) else f"x_{name}[i]" for name, hint in typed.parameters.items()
    )
    separator = ", " if parameters else ""
    return f"""\
@wp.kernel
def run_{typed.name}({parameters}{separator}out: {spelled(typed.returned)}):
    i = wp.tid()
    out[i] = {typed.name}({arguments})
"""
