"""Records of arrays are handed from one compiled function to the next by their address.

numba hands over a named tuple field by field: for a scene and a library some five hundred words in
every call, each of them an instruction for LLVM, on both sides. Records of this package that hold
arrays lie in memory instead, nested ones within those that hold them, and a call takes one pointer.
Nobody writes to a record once it is made, so that whoever reads one may keep what it read.

No references are counted to what a record by its address holds. One that kernels make of arrays of
their own is decorated as `by_value`, and handed over as numba does.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.base import BaseContext
from numba.core.boxing import unbox_tuple
from numba.core.datamodel import default_manager
from numba.core.datamodel.models import DataModel, TupleModel, UniTupleModel
from numba.core.funcdesc import default_mangler
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.pythonapi import NativeValue, unbox
from numba.core.registry import cpu_target
from numba.core.types.containers import BaseNamedTuple, NamedTuple, NamedUniTuple
from numba.np.numpy_support import as_dtype

USUAL = BaseContext.make_tuple, BaseContext.mangler  # of numba
ADDRESS = ir.IntType(8).as_pointer()
NEVER_WRITTEN = ("noalias", "captures(none)")  # memory behind an argument


def is_record(kind: types.Type) -> bool:
    """Whether values of a type are handed over by their address."""
    return (
        isinstance(kind, BaseNamedTuple)
        and kind.instance_class.__module__.startswith(f"{__package__}.")
        and not getattr(kind.instance_class, "by_value", False)
        and any(isinstance(one, types.Array) or is_record(one) for one in kind)
    )


class RecordModel(DataModel):  # type: ignore[misc]
    """A record as its address; who makes one, or is returned one, has room for it."""

    @functools.cached_property
    def laid_out(self) -> ir.LiteralStructType:
        """What lies at the address: the fields in their order, records among them whole."""
        models = map(default_manager.lookup, self.fe_type)
        kinds = [
            one.laid_out if isinstance(one, RecordModel) else one.get_value_type() for one in models
        ]
        return ir.LiteralStructType(kinds)

    def get_value_type(self) -> ir.Type:
        """An address."""
        return ADDRESS

    def get_data_type(self) -> ir.Type:
        """The fields."""
        return self.laid_out

    get_return_type = get_data_type

    def as_data(self, builder: Any, value: Any) -> Any:
        """The fields."""
        return builder.load(builder.bitcast(value, self.laid_out.as_pointer()))

    def from_data(self, builder: Any, value: Any) -> Any:
        """The address of a copy."""
        room = _room(builder, self.laid_out)
        builder.store(value, room)
        return builder.bitcast(room, ADDRESS)

    as_return, from_return = as_data, from_data

    def as_argument(self, builder: Any, value: Any) -> Any:
        """The address."""
        return value

    def from_argument(self, builder: Any, value: Any) -> Any:
        """The address, and what may be taken for granted of the memory there."""
        for one in NEVER_WRITTEN:
            value.add_attribute(one)
        return value

    @functools.cached_property
    def offsets(self) -> list[int]:
        """Where each field begins [bytes]."""
        data = cpu_target.target_context.target_data
        return [self.laid_out.get_element_offset(data, n) for n in range(len(self.fe_type))]

    def place(self, builder: Any, value: Any, n: int) -> Any:
        """The address of a field."""
        return builder.gep(value, [ir.IntType(64)(self.offsets[n])], inbounds=True)

    def field(self, builder: Any, value: Any, n: int) -> Any:
        """A field: its address if it is a record, or else what lies there."""
        place = self.place(builder, value, n)
        kind = self.laid_out.elements[n]
        if is_record(self.fe_type[n]):
            return place
        return _read(builder, builder.bitcast(place, kind.as_pointer()), kind)

    def made(self, builder: Any, values: Sequence[Any]) -> Any:
        """The address of a new record."""
        room = builder.bitcast(_room(builder, self.laid_out), ADDRESS)
        for n, (kind, value) in enumerate(zip(self.laid_out.elements, values, strict=True)):
            place = self.place(builder, room, n)
            if is_record(self.fe_type[n]):
                size = kind.get_abi_size(cpu_target.target_context.target_data)
                cgutils.raw_memcpy(builder, place, value, ir.IntType(64)(size), 1)
            else:
                builder.store(value, builder.bitcast(place, kind.as_pointer()))
        return room


def _room(builder: Any, kind: ir.Type) -> Any:
    with builder.goto_entry_block():
        return builder.alloca(kind)


def _read(builder: Any, place: Any, kind: ir.Type) -> Any:
    """What lies at an address, word by word: LLVM takes no larger value apart."""
    if not isinstance(kind, ir.LiteralStructType | ir.ArrayType):
        return builder.load(place)
    whole = kind(ir.Undefined)
    parts = kind.elements if isinstance(kind, ir.LiteralStructType) else [kind.element] * kind.count
    for n, part in enumerate(parts):
        at = cgutils.gep_inbounds(builder, place, 0, n)
        whole = builder.insert_value(whole, _read(builder, at, part), n)
    return whole


@lower_getattr_generic(NamedTuple)  # type: ignore[untyped-decorator]
@lower_getattr_generic(NamedUniTuple)  # type: ignore[untyped-decorator]
def _attribute(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    n, model = kind.fields.index(name), context.data_model_manager[kind]
    if isinstance(model, RecordModel):
        found = model.field(builder, value, n)
    else:
        found = builder.extract_value(value, n)
    return impl_ret_borrowed(context, builder, kind[n], found)


def hand_over_by_address(wanted: bool = True) -> None:
    """Have numba do so, or not, for records of this package and for nothing else."""
    for kind, usual in ((NamedTuple, TupleModel), (NamedUniTuple, UniTupleModel)):

        def model(manager: Any, one: types.Type, usual: type[DataModel] = usual) -> DataModel:
            return (RecordModel if wanted and is_record(one) else usual)(manager, one)

        default_manager.register(kind, model)
    default_manager._cache.clear()
    contexts = type(cpu_target.target_context)
    contexts.make_tuple = functools.partialmethod(_made, USUAL[0]) if wanted else USUAL[0]
    contexts.mangler = staticmethod(_mangled) if wanted else USUAL[1]


def _made(context: Any, usual: Any, builder: Any, kind: types.Type, values: Sequence[Any]) -> Any:
    model = context.data_model_manager[kind]
    if not isinstance(model, RecordModel):
        return usual(context, builder, kind, values)
    if context.enable_nrt:
        name = model.fe_type.instance_class.__qualname__
        raise TypeError(f"{name}: made where references are counted: decorate it as by_value")
    return model.made(builder, values)


def _mangled(name: str, args: Sequence[Any], *, abi_tags: Any = (), uid: Any = None) -> str:
    """A name of a function, with a digest of its types where they would take pages."""
    whole = default_mangler(name, args, abi_tags=abi_tags, uid=uid)
    if not any(map(is_record, args)):
        return str(whole)
    digest = hashlib.sha256("".join(map(str, args)).encode()).hexdigest()[:16]
    return str(default_mangler(name, (), abi_tags=(*abi_tags, f"r{digest}"), uid=uid))


@unbox(NamedTuple)  # type: ignore[untyped-decorator]
@unbox(NamedUniTuple)  # type: ignore[untyped-decorator]
def _from_python(kind: types.Type, value: Any, c: Any) -> NativeValue:
    if not is_record(kind):
        return unbox_tuple(kind, value, c)
    model = c.context.data_model_manager[kind]
    room = c.builder.bitcast(_room(c.builder, model.laid_out), ADDRESS)
    return NativeValue(room, is_error=_fill(model, room, value, c))


def _fill(model: RecordModel, room: Any, value: Any, c: Any) -> Any:
    """Fill a record from a named tuple of Python; whether that failed."""
    failed = cgutils.false_bit
    for n, kind in enumerate(model.fe_type):
        one, place = c.pyapi.tuple_getitem(value, n), model.place(c.builder, room, n)
        if is_record(kind):
            wrong = _fill(c.context.data_model_manager[kind], place, one, c)
        elif isinstance(kind, types.Array):
            wrong = c.builder.call(_array_reader(kind, c), [one, place])
        else:
            native = c.unbox(kind, one)
            c.builder.store(native.value, c.builder.bitcast(place, native.value.type.as_pointer()))
            wrong = native.is_error
        failed = c.builder.or_(failed, wrong)
    return failed


def _array_reader(kind: types.Array, c: Any) -> Any:
    """The function of a module that puts an array of Python at an address, and tells of failure.

    It counts no reference: who calls a kernel holds the array until that returns. Written out
    wherever it is needed, it would be sixty instructions, and a search has hundreds of arrays.
    """
    name = f"array_of_python.{hashlib.sha256(str(kind).encode()).hexdigest()[:16]}"
    typed = ir.FunctionType(ir.IntType(1), [c.pyapi.pyobj, ADDRESS])
    reader = cgutils.get_or_insert_function(c.builder.module, typed, name)
    if reader.is_declaration:
        reader.linkage = "internal"
        reader.attributes.add("noinline")
        builder = ir.IRBuilder(reader.append_basic_block("entry"))
        pyapi = c.context.get_python_api(builder)
        array = c.context.make_array(kind)(c.context, builder)
        address = builder.bitcast(array._getpointer(), ADDRESS)
        adapted = ir.FunctionType(ir.IntType(32), [pyapi.pyobj, ADDRESS])
        code = builder.call(
            pyapi._get_function(adapted, "numba_adapt_ndarray"), [reader.args[0], address]
        )
        size = array.itemsize.type(as_dtype(kind.dtype).itemsize)
        other = builder.icmp_unsigned("!=", array.itemsize, size)
        failed = builder.or_(cgutils.is_not_null(builder, code), other)
        with builder.if_then(failed, likely=False):
            pyapi.err_set_string("PyExc_TypeError", f"not an array that {kind} stands for")
        whole = array._getvalue()
        builder.store(whole, builder.bitcast(reader.args[1], whole.type.as_pointer()))
        builder.ret(failed)
    return reader
