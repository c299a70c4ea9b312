"""An interpreter for the core's C in which a number may be a symbol of some domain.

Known numbers are computed here, with C's types and promotions. Unknown ones go to the domain. Both sides of an `if` on
an unknown condition run, each store under its condition; a loop must end by a known condition. Whatever C leaves
undefined is an obligation that the domain must discharge: overflow of a signed type, a shift by too much or of a
negative number to the left, division by 0. Anything else that is not understood raises Unsupported: a proof never
skips what it cannot read.
"""

from __future__ import annotations

from typing import Any, Protocol

from pycparser import c_ast

from .cnumbers import (
    BOOL,
    COMPARE,
    INT,
    UINT,
    CType,
    Undefined,
    Unsupported,
    common,
    known_binary,
    promoted,
    wrapped,
)
from .storage import Frame, Pointer, Storage, Value


class Domain(Protocol):
    """Where unknown numbers live. A condition is a Python bool or the domain's own object."""

    def binary(self, op: str, kind: CType, a: Any, b: Any, guard: Any) -> Any: ...
    def compare(self, op: str, kind: CType, a: Any, b: Any) -> Any: ...
    def convert(self, x: Any, source: CType, target: CType, guard: Any) -> Any: ...
    def choose(self, condition: Any, kind: CType, a: Any, b: Any) -> Any: ...
    def both(self, a: Any, b: Any) -> Any: ...
    def inverse(self, a: Any) -> Any: ...
    def clz(self, x: Any, guard: Any) -> Any: ...


class Machine(Storage):
    """One translation unit, run in one domain."""

    def __init__(self, unit: c_ast.FileAST, domain: Domain) -> None:
        self.domain = domain
        self.functions = {node.decl.name: node for node in unit.ext if isinstance(node, c_ast.FuncDef)}
        self.types: dict[str, Any] = {}
        self.globals: dict[str, list[Any]] = {}
        self.structs: dict[str, Any] = {}
        self.frame = Frame(self.globals)
        for node in unit.ext:
            if isinstance(node, c_ast.Typedef):
                self.types[node.name] = node.type
            elif isinstance(node, c_ast.Decl) and not isinstance(node.type, c_ast.FuncDecl):
                self.declare(node)

    def store(self, room: list[Any], at: int, value: Any) -> None:
        if not 0 <= at < len(room):
            raise Undefined(f"write of element {at} of {len(room)}")
        old = room[at]
        if not isinstance(old, Value):
            if self.now() is not True:
                raise Unsupported("a conditional store of something that is not a number")
            room[at] = value
            return
        x = self.converted(value, old.kind)
        if self.now() is not True:
            if old.x is None:
                old = Value(old.kind, 0)
            x = self.domain.choose(self.now(), old.kind, x, old.x)
        room[at] = Value(old.kind, x)

    # ---- conditions ---------------------------------------------------------------------------

    def both(self, a: Any, b: Any) -> Any:
        if a is True:
            return b
        if b is True:
            return a
        return False if a is False or b is False else self.domain.both(a, b)

    def inverse(self, a: Any) -> Any:
        return not a if isinstance(a, bool) else self.domain.inverse(a)

    def here(self) -> Any:
        """The condition under which this statement runs, given that its function was called."""
        return self.both(self.frame.guard, self.frame.live)

    def now(self) -> Any:
        return self.both(self.frame.entry, self.here())

    def truth(self, value: Any) -> Any:
        if isinstance(value, bool):
            return value
        if not isinstance(value, Value):
            raise Unsupported("a condition that is not a number")
        if isinstance(value.x, int):
            return value.x != 0
        return self.domain.compare("!=", value.kind, value.x, 0)

    # ---- expressions --------------------------------------------------------------------------

    def constant(self, node: Any) -> int:
        value = self.number(node)
        if not isinstance(value.x, int):
            raise Unsupported(f"{node.coord}: a number that must be known depends on the input")
        return value.x

    def number(self, node: Any) -> Value:
        value = self.expression(node)
        if not isinstance(value, Value):
            raise Unsupported(f"{type(node).__name__} is not a number")
        return value

    def converted(self, value: Value, kind: CType) -> Any:
        if isinstance(value.x, int):
            return int(value.x != 0) if kind == BOOL else wrapped(kind, value.x)
        if value.kind == kind:
            return value.x
        if kind == BOOL:
            return self.from_condition(self.truth(value)).x
        return self.domain.convert(value.x, value.kind, kind, self.now())

    def from_condition(self, condition: Any) -> Value:
        if isinstance(condition, bool):
            return Value(INT, int(condition))
        return Value(INT, self.domain.choose(condition, INT, 1, 0))

    def binary(self, op: str, a: Value, b: Value) -> Value:
        kind = promoted(a.kind) if op in ("<<", ">>") else common(a.kind, b.kind)
        x = self.converted(a, kind)
        y = self.converted(b, promoted(b.kind) if op in ("<<", ">>") else kind)
        known = isinstance(x, int) and isinstance(y, int)
        if op in COMPARE:
            return self.from_condition(COMPARE[op](x, y) if known else self.domain.compare(op, kind, x, y))
        if known:
            return Value(kind, known_binary(op, kind, x, y))
        return Value(kind, self.domain.binary(op, kind, x, y, self.now()))

    def load(self, room: list[Any], at: int) -> Any:
        if not 0 <= at < len(room):
            raise Undefined(f"read of element {at} of {len(room)}")
        found = room[at]
        if isinstance(found, Value) and found.x is None:
            raise Undefined("a number read before it is stored")
        return Pointer(found, 0) if isinstance(found, list) else found

    def place(self, node: Any) -> tuple[list[Any], int]:
        if isinstance(node, c_ast.ID):
            for names in (self.frame.names, self.globals):
                if node.name in names:
                    return names[node.name], 0
            raise Unsupported(f"unknown name {node.name}")
        if isinstance(node, c_ast.ArrayRef):
            base = self.expression(node.name)
            return base.room, base.at + self.constant(node.subscript)
        if isinstance(node, c_ast.StructRef):
            base = self.expression(node.name)
            if isinstance(base, Pointer):
                base = base.room[base.at]
            return base.fields[node.field.name], 0
        if isinstance(node, c_ast.UnaryOp) and node.op == "*":
            base = self.expression(node.expr)
            return base.room, base.at
        raise Unsupported(f"{type(node).__name__} as an lvalue")

    def expression(self, node: Any) -> Any:
        method = getattr(self, f"on_{type(node).__name__}", None)
        if method is None:
            raise Unsupported(f"{type(node).__name__}")
        return method(node)

    def on_Constant(self, node: Any) -> Value:
        text = node.value.rstrip("uUlL")
        suffix = node.value[len(text) :].lower()
        value = int(text, 0)
        kind = UINT if "u" in suffix else INT
        if "ll" in suffix or value > kind.high:
            kind = CType(kind.signed, 64)
            if not text.isdigit() and value <= UINT.high and "l" not in suffix:
                kind = UINT
        return Value(kind, value)

    def on_ID(self, node: Any) -> Any:
        return self.load(*self.place(node))

    on_ArrayRef = on_StructRef = on_ID

    def on_Cast(self, node: Any) -> Value:
        kind = self.scalar(node.to_type)
        if kind is None:
            raise Unsupported("a cast to something that is not a number")
        value = self.number(node.expr)
        return Value(kind, self.converted(value, kind))

    def on_UnaryOp(self, node: Any) -> Any:
        if node.op == "&":
            return Pointer(*self.place(node.expr))
        if node.op == "*":
            return self.load(*self.place(node))
        if node.op in ("++", "p++", "--", "p--"):
            room, at = self.place(node.expr)
            old = self.load(room, at)
            one = Value(INT, 1)
            self.store(room, at, self.binary(node.op[-1], old, one))
            return old if node.op[0] == "p" else self.load(room, at)
        value = self.number(node.expr)
        if node.op == "!":
            return self.from_condition(self.inverse(self.truth(value)))
        if node.op == "-":
            return self.binary("-", Value(INT, 0), value)
        if node.op == "~":
            return self.binary("^", value, Value(INT, -1))
        if node.op == "+":
            return value
        raise Unsupported(f"operator {node.op}")

    def on_BinaryOp(self, node: Any) -> Value:
        if node.op in ("&&", "||"):
            left = self.truth(self.number(node.left))
            needed = left if node.op == "&&" else self.inverse(left)
            if needed is False:
                return self.from_condition(left)
            right = self.under(needed, lambda: self.truth(self.number(node.right)))
            if node.op == "&&":
                return self.from_condition(self.both(left, right))
            return self.from_condition(self.inverse(self.both(self.inverse(left), self.inverse(right))))
        left = self.expression(node.left)
        if isinstance(left, Pointer):
            return Pointer(left.room, left.at + self.constant(node.right))  # type: ignore[return-value]
        return self.binary(node.op, left, self.number(node.right))

    def on_TernaryOp(self, node: Any) -> Value:
        condition = self.truth(self.number(node.cond))
        if isinstance(condition, bool):
            return self.number(node.iftrue if condition else node.iffalse)
        a = self.under(condition, lambda: self.number(node.iftrue))
        b = self.under(self.inverse(condition), lambda: self.number(node.iffalse))
        kind = common(a.kind, b.kind)
        return Value(kind, self.domain.choose(condition, kind, self.converted(a, kind), self.converted(b, kind)))

    def under(self, condition: Any, run: Any) -> Any:
        frame = self.frame
        before = frame.guard
        frame.guard = self.both(before, condition)
        try:
            return run()
        finally:
            frame.guard = before

    def on_Assignment(self, node: Any) -> Any:
        room, at = self.place(node.lvalue)
        value = self.expression(node.rvalue)
        if node.op != "=":
            value = self.binary(node.op[:-1], self.load(room, at), value)
        self.store(room, at, value)
        return room[at]

    def on_FuncCall(self, node: Any) -> Any:
        arguments = [self.expression(a) for a in node.args.exprs] if node.args else []
        if node.name.name == "__builtin_clz":
            x = self.converted(arguments[0], UINT)
            if isinstance(x, int):
                if x == 0:
                    raise Undefined("clz of 0")
                return Value(INT, 32 - x.bit_length())
            return Value(INT, self.domain.clz(x, self.now()))
        return self.call(node.name.name, *arguments)

    # ---- statements ---------------------------------------------------------------------------

    def call(self, name: str, *arguments: Any) -> Any:
        """Run a function; arguments are Values and Pointers."""
        if name not in self.functions:
            raise Unsupported(f"function {name} has no body here")
        function = self.functions[name]
        caller = self.frame
        self.frame = Frame({}, entry=self.now())
        try:
            parameters = function.decl.type.args.params if function.decl.type.args else []
            for parameter, argument in zip(parameters, arguments, strict=True):
                kind = self.scalar(parameter.type)
                if kind is not None:
                    argument = Value(kind, self.converted(argument, kind))
                self.frame.names[parameter.name] = [argument]
            kind = self.scalar(function.decl.type.type)
            self.frame.result = Value(kind, 0) if kind is not None else None
            self.run(function.body)
            return self.frame.result
        finally:
            self.frame = caller

    def run(self, node: Any) -> None:
        if node is None or self.here() is False:
            return
        method = getattr(self, f"run_{type(node).__name__}", None)
        if method is not None:
            method(node)
        else:
            self.expression(node)

    def run_Compound(self, node: Any) -> None:
        outer = dict(self.frame.names)
        for item in node.block_items or []:
            self.run(item)
        self.frame.names = outer

    run_Decl = Storage.declare

    def run_DeclList(self, node: Any) -> None:
        for decl in node.decls:
            self.declare(decl)

    def run_EmptyStatement(self, node: Any) -> None:
        pass

    run_StaticAssert = run_EmptyStatement

    def run_Return(self, node: Any) -> None:
        if node.expr is not None:
            value = self.expression(node.expr)
            result = self.frame.result
            if isinstance(result, Value):
                x = self.converted(value, result.kind)
                if self.here() is not True:
                    x = self.domain.choose(self.here(), result.kind, x, result.x)
                self.frame.result = Value(result.kind, x)
            else:
                self.frame.result = value
        self.frame.live = self.both(self.frame.live, self.inverse(self.frame.guard))

    def run_If(self, node: Any) -> None:
        condition = self.truth(self.number(node.cond))
        if isinstance(condition, bool):
            self.run(node.iftrue if condition else node.iffalse)
            return
        self.under(condition, lambda: self.run(node.iftrue))
        self.under(self.inverse(condition), lambda: self.run(node.iffalse))

    def run_For(self, node: Any) -> None:
        outer = dict(self.frame.names)
        self.run(node.init)
        while self.here() is not False:
            condition = True if node.cond is None else self.truth(self.number(node.cond))
            if not isinstance(condition, bool):
                raise Unsupported("a loop whose end depends on the input")
            if not condition:
                break
            self.run(node.stmt)
            if node.next is not None:
                self.expression(node.next)
        self.frame.names = outer

    def run_While(self, node: Any) -> None:
        self.run_For(c_ast.For(None, node.cond, None, node.stmt))
