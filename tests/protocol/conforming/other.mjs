// The wire from SPEC.md and schema.json alone, in another language, for protocol/conformance. Shares no code with ours.
import {readFileSync} from "node:fs";
import {createInterface} from "node:readline";

const schema = JSON.parse(readFileSync(new URL("../../../protocol/schema.json", import.meta.url)));
const messages = new Map(Object.values(schema.link.message).map((message) => [message.id, message]));
const BYTES = {u8: 1, u16: 2, u32: 4, i16: 2, i32: 4};
const MOST_BYTES = schema.link.wire.max_frame_bytes + 1;

const hex = (bytes) => (bytes.length ? Buffer.from(bytes).toString("hex") : "-");
const unhex = (text) => (text === "-" ? [] : [...Buffer.from(text, "hex")]);

function crc32(bytes) {
    let crc = ~0;
    for (const byte of bytes) {
        crc ^= byte;
        for (let bit = 0; bit < 8; bit++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
    }
    return ~crc >>> 0;
}

function cobs(plain) {
    const out = [];
    let group = []; // up to the next zero
    const end = (last) => {
        while (group.length >= 254) {
            out.push(255, ...group.splice(0, 254));
            if (last && !group.length) return; // the end needs no code
        }
        out.push(group.length + 1, ...group);
        group = [];
    };
    for (const byte of plain) byte ? group.push(byte) : end(false);
    end(true);
    return out;
}

function uncobs(encoded) {
    const out = [];
    for (let at = 0; at < encoded.length; ) {
        const code = encoded[at];
        const next = at + code;
        if (code === 0 || next > encoded.length || encoded.slice(at + 1, next).includes(0)) return null;
        out.push(...encoded.slice(at + 1, next));
        if (code < 255 && next < encoded.length) out.push(0);
        at = next;
    }
    return out.length || encoded.length ? out : null;
}

const little = (value, bytes) => Array.from({length: bytes}, (_, k) => Math.floor(value / 2 ** (8 * k)) & 255);
const fromLittle = (bytes) => bytes.reduce((sum, byte, k) => sum + byte * 2 ** (8 * k), 0);
const sizeOf = (message) => message.fields.reduce((sum, {type, count = 1}) => sum + BYTES[type] * count, 0);

function pack(message, text) {
    const values = new Map(text.split("; ").map((field) => [field.split(" ")[0], field.split(" ").slice(1).map(Number)]));
    return message.fields.flatMap(({name, type}) => values.get(name).flatMap((value) => little(value, BYTES[type])));
}

function unpack(message, payload) {
    let at = 0;
    return message.fields.map(({name, type, count = 1}) => {
        const size = BYTES[type];
        const values = Array.from({length: count}, () => {
            const value = fromLittle(payload.slice(at, (at += size)));
            return type[0] === "i" && value >= 2 ** (8 * size - 1) ? value - 2 ** (8 * size) : value;
        });
        return [name, ...values].join(" ");
    }).join("; ");
}

function frame(id, payload) {
    const plain = [id, ...payload];
    return [...cobs([...plain, ...little(crc32(plain), 4)]), 0];
}

function unframe(wire) {
    const counts = {tooLong: 0, badCobs: 0, badCrc: 0, badLength: 0};
    const told = [];
    let piece = [];
    for (const byte of wire) {
        if (byte) {
            piece.push(byte);
            continue;
        }
        const [encoded, plain] = [piece, uncobs(piece)];
        piece = [];
        if (!encoded.length) continue;
        if (encoded.length > MOST_BYTES) counts.tooLong++;
        else if (!plain) counts.badCobs++;
        else if (plain.length < 5 || crc32(plain.slice(0, -4)) !== fromLittle(plain.slice(-4))) counts.badCrc++;
        else {
            const message = messages.get(plain[0]);
            if (message && sizeOf(message) !== plain.length - 5) counts.badLength++;
            else told.push(`frame ${hex([plain[0]])} ${hex(plain.slice(1, -4))}`);
        }
    }
    return [...told, `counts ${Object.values(counts).join(" ")}`].join("; ");
}

const answers = {
    crc: (data) => crc32(unhex(data)).toString(16).padStart(8, "0"),
    cobs: (plain) => hex(cobs(unhex(plain))),
    uncobs: (encoded) => { const plain = uncobs(unhex(encoded)); return plain ? hex(plain) : "bad"; },
    frame: (id, payload) => hex(frame(parseInt(id, 16), unhex(payload))),
    unframe: (_, wire) => unframe(unhex(wire)),
    pack: (id, ...text) => hex(pack(messages.get(parseInt(id, 16)), text.join(" "))),
    unpack: (id, payload) => unpack(messages.get(parseInt(id, 16)), unhex(payload)),
};

for await (const line of createInterface({input: process.stdin})) {
    const [word, ...rest] = line.split(" ");
    console.log(answers[word] ? answers[word](...rest) : "no");
}
