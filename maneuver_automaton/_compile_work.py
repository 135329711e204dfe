"""A process that compiles, and nothing else: kernel after kernel, as their names come in.

What numba works out again and again is worked out once here: its own methods are replaced. So the
kernels of an installation take a quarter less processor time, and their machine code stays the
same, instruction by instruction.
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
from numba.core import (
    base,
    compiler_machinery,
    errors,
    ir,
    lowering,
    postproc,
    targetconfig,
    transforms,
    typeinfer,
    untyped_passes,
)
from numba.core.types import abstract, functions
from numba.core.typing import context, templates

from maneuver_automaton import _kernel_list

TRIED = (0, 68)  # the numba whose insides were looked at; another one compiles as it does by itself
OPERATOR = type(operator.add)  # the class of all of them
HOLDERS = dict, list, tuple  # of variables, in an instruction

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
        (abstract.Type, "__hash__", once_an_object),
        (base, "_has_loc", functools.cache),
        (base.BaseContext, "refresh", where_something_is_new),
        (context.BaseContext, "refresh", where_something_is_new),
        (context.BaseContext, "find_matching_getattr_template", functools.cache),
        (errors.WarningsFixer, "catch_warnings", without_context),  # type: ignore[attr-defined]
        (ir.Inst, "_rec_list_vars", variables_in),
        (lowering, "new_error_context", without_context),
        (targetconfig.TargetConfig, "__hash__", one_for_all),
        (typeinfer, "new_error_context", without_context),
        (untyped_passes.InlineClosureLikes, "run_pass", where_there_are_closures),
        (postproc.PostProcessor, "run", without_lives),
        (base.BaseContext, "get_abi_sizeof", once_a_type),
        (functions.BaseFunction, "get_call_type", once_for_types),
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


def once_for_types(usual: Method) -> Method:
    """What an operator makes of types: numba tries NumPy's functions, one after the other."""
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not isinstance(self.typing_key, OPERATOR):
            return usual(self, context, args, kws)
        key = self, tuple(args)
        if key not in known:
            signature = usual(self, context, args, kws)
            if signature is None:
                return None
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


def once_an_object(usual: Method) -> Method:
    """The hash of a type, which is made of those of all types in it."""
    known: dict[int, tuple[int, Any]] = {}  # with the type, or another one might take its address

    def hash_of(self: Any) -> int:
        found = known.get(id(self))
        if found is None:
            found = known[id(self)] = usual(self), self
        return found[0]

    return hash_of


def one_for_all(usual: Method) -> Method:
    """The hash of settings, which numba makes of their names alone: all have the same ones."""
    return lambda self: 0


def where_something_is_new(usual: Method) -> Method:
    """What was registered since: asked for at every function and at every second operator."""
    known: dict[int, int] = {}

    def registered(self: Any) -> int:
        lists = (one for registry in self._registries for one in vars(registry).values())
        return sum(len(one) for one in lists if isinstance(one, list))

    def refresh(self: Any) -> None:
        if known.get(id(self)) != registered(self):
            usual(self)
            known[id(self)] = registered(self)

    return refresh


def without_context(usual: Method) -> Method:
    """Neither warnings nor where an error was: whoever uses the kernel compiles it again."""
    nothing = contextlib.nullcontext()
    return lambda *args, **kws: nothing


def variables_in(usual: Method) -> Method:
    """The variables in what an instruction holds, without a list for each thing in it."""

    def rec_list_vars(self: Any, value: Any) -> list[Any]:
        found = list[Any]()
        for one in value.values() if isinstance(value, dict) else value:
            if isinstance(one, ir.Var):
                found.append(one)
            elif isinstance(one, ir.Inst):
                found += one.list_vars()
            elif isinstance(one, HOLDERS):
                found += rec_list_vars(self, one)
        return found

    return rec_list_vars
