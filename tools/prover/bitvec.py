"""C's arithmetic as z3 bit-vectors: for masks, shifts by unknown numbers and counts of leading zeros."""

from __future__ import annotations

from typing import Any

import z3

from .cnumbers import COMPARE, COMPUTE, UINT, CType
from .integers import Questions


def vector(x: Any, bits: int) -> Any:
    return z3.BitVecVal(x, bits) if isinstance(x, int) else x


class BitVectorDomain(Questions):
    def input(self, name: str, kind: CType) -> Any:
        return self.inputs.setdefault(name, z3.BitVec(name, kind.bits))

    def binary(self, op: str, kind: CType, a: Any, b: Any, guard: Any) -> Any:
        x = vector(a, kind.bits)
        if op in ("<<", ">>"):
            amount = vector(b, kind.bits) if isinstance(b, int) else resized(b, kind.bits, signed=True)
            self.require("a shift by too much", z3.ULT(amount, kind.bits), guard)
            if op == ">>":
                return x >> amount if kind.signed else z3.LShR(x, amount)
            if kind.signed:
                back = z3.And(x >= 0, (x << amount) >> amount == x, (x << amount) >= 0)
                self.require("a shift to the left overflows", back, guard)
            return x << amount
        y = vector(b, kind.bits)
        if kind.signed:
            self.require_no_overflow(op, x, y, guard)
        if op in ("/", "%"):
            self.require("division by 0", y != 0, guard)
            if kind.signed:
                return x / y if op == "/" else z3.SRem(x, y)
            return z3.UDiv(x, y) if op == "/" else z3.URem(x, y)
        return COMPUTE[op](x, y)

    def require_no_overflow(self, op: str, x: Any, y: Any, guard: Any) -> None:
        if op == "+":
            fits = z3.And(z3.BVAddNoOverflow(x, y, True), z3.BVAddNoUnderflow(x, y))
        elif op == "-":
            fits = z3.And(z3.BVSubNoOverflow(x, y), z3.BVSubNoUnderflow(x, y, True))
        elif op == "*":
            fits = z3.And(z3.BVMulNoOverflow(x, y, True), z3.BVMulNoUnderflow(x, y))
        elif op in ("/", "%"):
            fits = z3.BVSDivNoOverflow(x, y)
        else:
            return
        self.require(f"{op} overflows", fits, guard)

    def compare(self, op: str, kind: CType, a: Any, b: Any) -> Any:
        x, y = vector(a, kind.bits), vector(b, kind.bits)
        unsigned = {} if kind.signed else {"<": z3.ULT, "<=": z3.ULE, ">": z3.UGT, ">=": z3.UGE}
        return unsigned.get(op, COMPARE[op])(x, y)

    def convert(self, x: Any, source: CType, target: CType, guard: Any) -> Any:
        return resized(x, target.bits, signed=source.signed)

    def choose(self, condition: Any, kind: CType, a: Any, b: Any) -> Any:
        return z3.If(condition, vector(a, kind.bits), vector(b, kind.bits))

    def clz(self, x: Any, guard: Any) -> Any:
        self.require("clz of 0", x != 0, guard)
        out = z3.BitVecVal(UINT.bits, UINT.bits)
        for bit in range(UINT.bits):
            out = z3.If(z3.Extract(bit, bit, x) == 1, z3.BitVecVal(UINT.bits - 1 - bit, UINT.bits), out)
        return out


def resized(x: Any, bits: int, *, signed: bool) -> Any:
    have = x.size()
    if bits <= have:
        return z3.Extract(bits - 1, 0, x)
    return z3.SignExt(bits - have, x) if signed else z3.ZeroExt(bits - have, x)
