"""Decoder of protobuf messages by the file descriptors recorded with them."""

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from importers.decoding.blocks import Buffer, Decoded, Offsets
from importers.decoding.leaves import Kind, Leaf, columns_of_messages
from navreplay.timeline import LogError

__all__ = ["ProtobufDecoder"]

_F = FieldDescriptor
_DTYPES: dict[int, np.dtype] = {
    _F.CPPTYPE_INT32: np.dtype("i4"),
    _F.CPPTYPE_INT64: np.dtype("i8"),
    _F.CPPTYPE_UINT32: np.dtype("u4"),
    _F.CPPTYPE_UINT64: np.dtype("u8"),
    _F.CPPTYPE_DOUBLE: np.dtype("f8"),
    _F.CPPTYPE_FLOAT: np.dtype("f4"),
    _F.CPPTYPE_BOOL: np.dtype("?"),
    _F.CPPTYPE_ENUM: np.dtype("i4"),
    _F.CPPTYPE_STRING: np.dtype(object),
}
_TIMES = ("google.protobuf.Timestamp", "google.protobuf.Duration")
_VECTORS = (("x", "y", "z"), ("x", "y", "z", "w"))


class ProtobufDecoder:
    """Decodes the messages of one channel.

    Fields that are not set have protobuf's defaults (0, empty). Repeated messages, and messages nested in themselves, are
    left out; enumerations are their numbers. Raises LogError where the descriptors are damaged or lack the type.
    """

    def __init__(self, name: str, descriptors: bytes) -> None:
        self._name = name
        descriptor = _find(name, descriptors)
        self._class = GetMessageClass(descriptor)
        self._leaves = tuple(_flatten(descriptor, "", ()))

    def decode(self, buffer: Buffer, start: Offsets, stop: Offsets) -> Decoded:
        """See `Decoder`."""
        kept, messages = [], []
        for place, (a, b) in enumerate(zip(start, stop, strict=True)):
            message = self._parse(buffer[a:b].tobytes())
            if message is not None:  # the others are counted by their absence from kept
                messages.append(message)
                kept.append(place)
        columns = columns_of_messages(self._leaves, messages)
        return Decoded(columns, np.array(kept, dtype=np.intp), reason=f"not decodable as {self._name}")

    def _parse(self, content: bytes) -> Message | None:
        try:
            return self._class.FromString(content)
        except DecodeError:
            return None


def _find(name: str, descriptors: bytes) -> Descriptor:
    try:
        files = {file.name: file for file in FileDescriptorSet.FromString(descriptors).file}
    except DecodeError as error:
        raise LogError(f"the protobuf descriptors of type {name} are damaged; the channel cannot be read") from error
    pool = DescriptorPool()
    try:
        while files:
            _add(pool, files, next(iter(files)))
        return pool.FindMessageTypeByName(name)
    except (TypeError, KeyError, RecursionError) as error:
        raise LogError(f"the protobuf descriptors in the log do not define type {name}; the channel cannot be read") from error


def _add(pool: DescriptorPool, files: dict[str, FileDescriptorProto], name: str) -> None:
    """A file goes into the pool after those it depends on."""
    file = files.pop(name)
    for dependency in file.dependency:
        if dependency in files:
            _add(pool, files, dependency)
    pool.Add(file)


def _flatten(descriptor: Descriptor, prefix: str, above: tuple[str, ...]) -> list[Leaf]:
    leaves: list[Leaf] = []
    for field in descriptor.fields:
        path = prefix + field.name
        if field.cpp_type == _F.CPPTYPE_MESSAGE:
            if not field.is_repeated and field.message_type.full_name not in above:
                leaves += _nested(field.message_type, path, (*above, descriptor.full_name))
        elif field.is_repeated:
            leaves.append(Leaf(path, (path,), Kind.LIST, _DTYPES[field.cpp_type]))
        else:
            kind = Kind.TEXT if field.cpp_type == _F.CPPTYPE_STRING else Kind.NUMBER
            leaves.append(Leaf(path, (path,), kind, _DTYPES[field.cpp_type]))
    return leaves


def _nested(descriptor: Descriptor, path: str, above: tuple[str, ...]) -> list[Leaf]:
    names = tuple(field.name for field in descriptor.fields)
    parts = tuple(f"{path}.{name}" for name in names)
    if descriptor.full_name in _TIMES:
        return [Leaf(path, (f"{path}.seconds", f"{path}.nanos"), Kind.TIME, np.dtype("i8"))]
    kinds = {field.cpp_type for field in descriptor.fields}
    if names in _VECTORS and len(kinds) == 1 and kinds <= {_F.CPPTYPE_DOUBLE, _F.CPPTYPE_FLOAT}:
        return [Leaf(path, parts, Kind.VECTOR, _DTYPES[kinds.pop()], len(parts))]
    return _flatten(descriptor, f"{path}.", above)
