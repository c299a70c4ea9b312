"""C's objects: numbers, arrays, structs and pointers, and how declarations create and fill them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from pycparser import c_ast

from .cnumbers import INT, NAMES, CType, Unsupported


@dataclass
class Value:
    kind: CType
    x: Any  # int, the domain's object, or None before the first store


@dataclass
class Pointer:
    room: list[Any]
    at: int


@dataclass
class Struct:
    fields: dict[str, list[Any]]


@dataclass
class Frame:
    """One call: its names, and the conditions under which it was made and has not returned yet."""

    names: dict[str, list[Any]]
    entry: Any = True
    guard: Any = True  # the ifs around the running statement
    live: Any = True
    result: Any = None


class Storage(ABC):
    """Names and their objects; the expressions in declarations are left to Machine."""

    types: dict[str, Any]
    globals: dict[str, list[Any]]
    structs: dict[str, Any]
    frame: Frame

    @abstractmethod
    def expression(self, node: Any) -> Any:
        """See the machine."""

    @abstractmethod
    def number(self, node: Any) -> Value:
        """See the machine."""

    @abstractmethod
    def constant(self, node: Any) -> int:
        """See the machine."""

    @abstractmethod
    def converted(self, value: Value, kind: CType) -> Any:
        """See the machine."""

    def scalar(self, node: Any) -> CType | None:
        """The number type of a declaration or type name; None if it is no number."""
        while isinstance(node, c_ast.Typename | c_ast.TypeDecl):
            node = node.type
        if isinstance(node, c_ast.Enum):
            return INT
        if isinstance(node, c_ast.IdentifierType):
            name = " ".join(node.names)
            return self.scalar(self.types[name]) if name in self.types else NAMES.get(name)
        return None

    def build(self, node: Any) -> Any:
        """An object of a declared type, with its numbers not yet stored."""
        while isinstance(node, c_ast.TypeDecl | c_ast.Typename):
            node = node.type
        kind = self.scalar(node)
        if kind is not None:
            return Value(kind, None)
        if isinstance(node, c_ast.IdentifierType):
            return self.build(self.types[" ".join(node.names)])
        if isinstance(node, c_ast.ArrayDecl):
            return [self.build(node.type) for _ in range(self.constant(node.dim))]
        if isinstance(node, c_ast.Struct):
            if node.decls is not None and node.name:
                self.structs[node.name] = node.decls
            decls = node.decls if node.decls is not None else self.structs[node.name]
            return Struct({d.name: [self.build(d.type)] for d in decls})
        if isinstance(node, c_ast.PtrDecl):
            return None
        raise Unsupported(f"type {type(node).__name__}")

    def declare(self, node: c_ast.Decl) -> None:
        if isinstance(node.type, c_ast.Struct | c_ast.Enum) and node.name is None:
            self.declare_tag(node.type)
            return
        if "extern" in node.storage:
            return
        kind = node.type
        if isinstance(kind, c_ast.ArrayDecl) and kind.dim is None:
            kind = c_ast.ArrayDecl(kind.type, c_ast.Constant("int", str(len(node.init.exprs))), [])
        room = [self.build(kind)]
        if node.init is not None:
            self.initialise(room, 0, node.init)
        self.frame.names[node.name] = room

    def declare_tag(self, node: Any) -> None:
        if isinstance(node, c_ast.Struct):
            self.build(node)
            return
        following = 0
        for entry in node.values.enumerators if node.values else ():
            following = self.constant(entry.value) if entry.value is not None else following
            self.globals[entry.name] = [Value(INT, following)]
            following += 1

    def initialise(self, room: list[Any], at: int, init: Any) -> None:
        target = room[at]
        if not isinstance(init, c_ast.InitList):
            if isinstance(target, Value):
                value = self.number(init)
                room[at] = Value(target.kind, self.converted(value, target.kind))
            else:
                room[at] = self.expression(init)
            return
        self.clear(room, at)
        index = 0
        for entry in init.exprs:
            if isinstance(entry, c_ast.NamedInitializer):
                (name,) = entry.name
                if isinstance(target, Struct):
                    self.initialise(target.fields[name.name], 0, entry.expr)
                    continue
                index, entry = self.constant(name.expr), entry.expr
            if isinstance(target, Struct):
                self.initialise(list(target.fields.values())[index], 0, entry)
            else:
                self.initialise(target, index, entry)
            index += 1

    def clear(self, room: list[Any], at: int) -> None:
        """Zero the members that an initialiser leaves out, as C does."""
        target = room[at]
        if isinstance(target, Value):
            room[at] = Value(target.kind, 0)
        elif isinstance(target, list):
            for index in range(len(target)):
                self.clear(target, index)
        elif isinstance(target, Struct):
            for field in target.fields.values():
                self.clear(field, 0)
