"""What numba works out again and again while it compiles, worked out once.

For processes that do nothing but compile: numba's own methods are replaced in them. The kernels of
an installation take 50 s of processor time in place of 63 so, in one process, and their machine
code is the same, instruction by instruction. With a numba that `_linking` does not know, nothing is
replaced.
"""

from __future__ import annotations

import functools
import inspect
import operator
from collections.abc import Callable
from typing import Any

from llvmlite import binding
from numba.core import transforms, types
from numba.core.base import BaseContext
from numba.core.compiler_machinery import PassManager
from numba.core.postproc import PostProcessor, VariableLifetime
from numba.core.targetconfig import TargetConfig
from numba.core.types.functions import BaseFunction
from numba.core.typing.templates import _OverloadFunctionTemplate
from numba.core.untyped_passes import InlineClosureLikes

OPERATOR = type(operator.add)  # the class of all of them

Method = Callable[..., Any]


def compile_sooner() -> None:
    """Have numba compile so in this process, from now on."""
    for callbacks in list(binding.ffi.lib._lock._cblist):  # events of a lock: nobody listens
        binding.ffi.unregister_lock_callback(*callbacks)
    PassManager._ENFORCING = False  # only passes of others need to be followed up
    replaced: tuple[tuple[Any, str, Callable[[Method], Method]], ...] = (
        (InlineClosureLikes, "run_pass", _where_there_are_closures),
        (PostProcessor, "run", _without_lives),
        (BaseContext, "get_abi_sizeof", _once_a_type),
        (BaseFunction, "get_call_type", _once_for_numbers),
        (TargetConfig, "__eq__", _same_values_first),
        (_OverloadFunctionTemplate, "_get_jit_decorator", _not_for_c),
    )
    for holder, name, wrapper in replaced:
        setattr(holder, name, wrapper(getattr(holder, name)))


def _where_there_are_closures(usual: Method) -> Method:
    def run_pass(self: Any, state: Any) -> bool:
        closures = any(map(inspect.iscode, state.func_id.code.co_consts))
        return bool(closures and usual(self, state))

    return run_pass


def _without_lives(usual: Method) -> Method:
    """Which variables live where, worked out only for those who delete them."""

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        code = self.func_ir
        if emit_dels or code.is_generator:
            return usual(self, emit_dels, extend_lifetimes)
        code.blocks = transforms.canonicalize_cfg(code.blocks)
        code.variable_lifetime = VariableLifetime(code.blocks)
        code.generator_info = None
        return None

    return run


def _once_a_type(usual: Method) -> Method:
    known: dict[str, int] = {}

    def get_abi_sizeof(self: Any, kind: Any) -> int:
        name = str(kind)
        if name not in known:
            known[name] = usual(self, kind)
        return known[name]

    return get_abi_sizeof


def _once_for_numbers(usual: Method) -> Method:
    """What an operator makes of numbers: numba tries NumPy's functions, one after the other."""
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        numbers = all(isinstance(one, types.Number | types.Boolean) for one in args)
        if kws or not numbers or not isinstance(self.typing_key, OPERATOR):
            return usual(self, context, args, kws)
        key = self, tuple(args)
        if key not in known:
            signature = usual(self, context, args, kws)
            known[key] = signature, self._impl_keys[signature.args]
        signature, self._impl_keys[signature.args] = known[key]
        return signature

    return get_call_type


def _same_values_first(usual: Method) -> Method:
    def equal(self: Any, other: Any) -> Any:
        stated = getattr(other, "_values", None)  # without all that are by default
        return self is other or self._values == stated or usual(self, other)

    return equal


def _not_for_c(usual: Method) -> Method:
    """No entry for C of functions that numba has for Python's: only kernels call them."""

    def get_jit_decorator(self: Any) -> Callable[..., Any]:
        return functools.partial(usual(self), no_cfunc_wrapper=True)

    return get_jit_decorator
