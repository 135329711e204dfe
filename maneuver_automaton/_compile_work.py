"""A process that compiles, and nothing else: kernel after kernel, as their names come in.

What numba works out again and again is worked out once here: its own methods are replaced. So an
installation takes over a quarter less processor time for its kernels, and their machine code stays
the same, instruction by instruction, but for the words of an error that no kernel raises.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import inspect
import itertools
import operator
import os
import sys
from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any

from llvmlite import binding
from llvmlite.ir import types
from numba import version_info
from numba.core import ir, postproc, transforms
from numba.core.rewrites import rewrite_registry
from numba.core.typing.templates import builtin_registry
from numba.np import arrayobj

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
    replaced: dict[str, Callable[[Method], Method]] = {
        "llvmlite.ir.values.Block.descr": lambda _: write,
        "numba.core.base.BaseContext.get_abi_sizeof": once_a_type,
        "numba.core.base.BaseContext.refresh": where_something_is_new,
        "numba.core.base._has_loc": functools.cache,
        "numba.core.compiler_machinery.PassManager._runPass": lambda _: run_alone,
        "numba.core.errors.WarningsFixer.catch_warnings": without_context,
        "numba.core.ir.Inst._rec_list_vars": lambda _: variables_in,
        "numba.core.lowering.Lower.delvar": where(references_are_counted),
        "numba.core.lowering.Lower.storevar": over_nothing_counted,
        "numba.core.lowering.new_error_context": without_context,
        "numba.core.postproc.PostProcessor.run": without_lives,
        "numba.core.targetconfig.TargetConfig.__eq__": same_values_first,
        "numba.core.targetconfig.TargetConfig.__hash__": lambda _: lambda self: 0,  # as numba's
        "numba.core.typed_passes.NopythonRewrites.run_pass": where(a_rule_matches),
        "numba.core.typeinfer.new_error_context": without_context,
        "numba.core.types.abstract.Type.__hash__": once_an_object,
        "numba.core.types.functions.BaseFunction.get_call_type": once_for_types,
        "numba.core.typing.context.BaseContext.find_matching_getattr_template": functools.cache,
        "numba.core.typing.context.BaseContext.refresh": where_something_is_new,
        "numba.core.typing.templates._OverloadFunctionTemplate._get_jit_decorator": not_for_c,
        "numba.core.untyped_passes.InlineClosureLikes.run_pass": where(
            lambda _, state: any(map(inspect.iscode, state.func_id.code.co_consts))
        ),
    }
    for place, wrapper in replaced.items():
        holder, _, name = place.rpartition(".")
        setattr(resolve_name(holder), name, wrapper(resolve_name(place)))
    text = arrayobj.raise_with_shape_context  # which kernels else put together, shapes and all
    (short, long) = (one for one in builtin_registry.functions if one.key is text)
    long._overload_func = staticmethod(short._overload_func)


def where(needed: Method) -> Callable[[Method], Method]:
    """A step that is left out where it would change nothing."""
    return lambda usual: lambda *args: usual(*args) if needed(*args) else args[-1]


def a_rule_matches(_: Any, state: Any) -> bool:
    rules, code = rewrite_registry.rewrites["after-inference"], state.func_ir
    asked = itertools.product((rule(state) for rule in rules), code.blocks.values())
    return any(one.match(code, block, state.typemap, state.calltypes) for one, block in asked)


def references_are_counted(self: Any, name: str) -> bool:
    model = self.context.data_model_manager[self.typeof(name)]
    return bool(self.context.enable_nrt and model.contains_nrt_meminfo())


def over_nothing_counted(usual: Method) -> Method:
    """To store a variable: what it held is read, to release it, only where that is counted."""
    return lambda self, value, name, argidx=None: usual(
        self, value, name, argidx if references_are_counted(self, name) else 0
    )


def run_alone(self: Any, _: int, step: Any, state: Any) -> None:
    """A pass of the compiler, with no look at what passes of others may leave, and no clock."""
    step.analysis = self._analysis
    step.run_pass(state)


def write(self: Any, text: list[str]) -> None:
    """The text of a block, with no string of its own for each instruction in it."""
    text.append(f"{self._format_name()}:\n")
    for one in self.instructions:
        if not isinstance(one.type, types.VoidType):
            text.append(f"{one.get_reference()} = ")
        one.descr(text)
        text.append("\n")


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
    return lambda self: functools.partial(usual(self), no_cfunc_wrapper=True)


def once_an_object(usual: Method) -> Method:
    """The hash of a type, which is made of those of all types in it."""
    known: dict[int, tuple[int, Any]] = {}  # with the type, or another one might take its address

    def hash_of(self: Any) -> int:
        found = known.get(id(self))
        if found is None:
            found = known[id(self)] = usual(self), self
        return found[0]

    return hash_of


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


def variables_in(self: Any, value: Any) -> list[Any]:
    """The variables in what an instruction holds, without a list for each thing in it."""
    found = list[Any]()
    for one in value.values() if isinstance(value, dict) else value:
        if isinstance(one, ir.Var):
            found.append(one)
        elif isinstance(one, ir.Inst):
            found += one.list_vars()
        elif isinstance(one, (dict, list, tuple)):
            found += variables_in(self, one)
    return found
