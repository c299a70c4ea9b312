"""protocol/MESSAGES.md: the tables that go with SPEC.md."""

from __future__ import annotations

from pathlib import Path

from .schema import GENERATED, Contract, Message, entries, type_range

CONTROLLER = "host/docs/guides/controller.md"


def messages(contract: Contract) -> str:
    link = contract.link
    wire = link["wire"]
    out = [
        "# Messages",
        "",
        f"<!-- {GENERATED} -->",
        f"Wire version {wire['major']}.{wire['minor']}, schema hash `0x{contract.hash:08X}`. "
        "Framing, CRC and handshake are in [SPEC.md](SPEC.md).",
        "",
        "| id | message | direction, and streams that carry it | payload | on the wire | answered by |",
        "|---|---|---|---|---|---|",
    ]
    for m in sorted(contract.messages, key=lambda m: m.id):
        direction = "host to board" if m.id & 0x80 else ", ".join(["board to host", *(f"`{s}`" for s in m.streams)])
        whole = m.payload_bytes + 1 + 4 + 1 + 1  # id, CRC, COBS code byte, delimiter
        reply = f"`{m.reply}`" if m.reply else ""
        out.append(f"| 0x{m.id:02X} | `{m.name}` | {direction} | {m.payload_bytes} B | {whole} B | {reply} |")
    for m in contract.messages:
        out += ["", f"## {m.name} (0x{m.id:02X})", "", m.doc, "", *field_table(m)]
    for kind, number in (("enum", "value"), ("flags", "bit")):
        for name, table in link[kind].items():
            out += ["", f"## {kind} {name}", "", table["doc"], "", f"| {number} | name | meaning |", "|---|---|---|"]
            out += [f"| {e[number]} | `{k}` | {e['doc']} |" for k, e in entries(table).items()]
    out += ["", "## Settings", "", "`per finger`: a finger's CALIBRATION has a value of its own for it.", ""]
    out += ["| id | name | per finger | unit | range | default | meaning |", "|---|---|---|---|---|---|---|"]
    for name, s in link["setting"].items():
        low, high = s["range"]
        own = f"value[{contract.per_finger.index(name)}]" if name in contract.per_finger else ""
        out.append(f"| {s['id']} | `{name}` | {own} | {s['unit']} | {low} to {high} | {s['default']} | {s['doc']} |")
    return "\n".join(out) + "\n"


TRUST_BEGIN, TRUST_END = "<!-- trust: generated from link.toml -->\n", "<!-- end of trust -->\n"

#: Actions on a flag, and the levels of trust that it allows at most.
FLAG_LISTS = {
    "**Stop**: trust is NONE or HOLD.": ("NONE", "HOLD"),
    "**Widen**: trust is INTERVAL at most.": ("INTERVAL",),
    "**Ignore**, as far as the force goes: these leave trust alone.": ("ACT",),
}


def controller(root: Path, contract: Contract) -> str:
    """controller.md with the contract's table of levels and three lists of flags."""
    levels, flags = entries(contract.link["enum"]["trust"]), entries(contract.link["flags"]["frame"])
    rows = ["| trust | | |", "|---|---|---|"]
    rows += [f"| {level['value']} | `{name}` | {level['doc']} |" for name, level in levels.items()]
    for title, names in FLAG_LISTS.items():
        rows += ["", title, "", "| flag | the force is | do |", "|---|---|---|"]
        for name in names:
            level = f", {name}" if len(names) > 1 else ""
            rows += [
                f"| `{key}`{level} | {flag['force']} | {flag['do']} |"
                for key, flag in flags.items()
                if flag.get("trust", "ACT") == name
            ]
    head, rest = (root / CONTROLLER).read_text(encoding="utf-8").split(TRUST_BEGIN)
    return head + TRUST_BEGIN + "\n".join(rows) + "\n" + TRUST_END + rest.split(TRUST_END)[1]


def field_table(message: Message) -> list[str]:
    out = ["| offset | field | type | unit | range | meaning |", "|---|---|---|---|---|---|"]
    offset = 0
    for f in message.fields:
        kind = f"{f.type}[{f.count}]" if f.count > 1 else f.type
        unit = f"{f.unit} (q{f.frac_bits})" if f.frac_bits else f.unit
        low, high = f.range or type_range(f.type)
        span = f"{low} to {high}"
        out.append(f"| {offset} | `{f.name}` | {kind} | {unit} | {span} | {f.doc} |")
        offset += f.size
    return out
