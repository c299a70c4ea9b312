// Faster versions of correct but slow parts of rp2040js 1.4.1.
const SRAM = 0x20000000
const USB = 0x50100000
const WIDE = 0xe800 // opcodes from here on have another halfword

const extend = (bits) => (value) => (value << bits) >> bits
const NAMES = { pcRegister: 15, spRegister: 13, signExtend8: extend(24), signExtend16: extend(16), LOG_NAME: 'CortexM0Core' }

/**
 * executeInstruction: as published a chain of eighty comparisons, here a jump by the opcode to the same statements.
 * The chain stays for wide instructions and invalid ones.
 */
function jumping(published) {
  const source = published.toString()
  const branches = [...source.matchAll(/^ {8}(?:else )?if \((opcode .*)\) \{\n([^]*?)^ {8}\}\n/gm)]
  const [begin, end] = [branches[0]?.index, source.indexOf('        this.cycles += deltaCycles;')]
  if (branches.length < 80 || end < 0) {
    throw new Error('rp2040js is not 1.4.1: executeInstruction does not look as tools/emulator/speed.mjs expects')
  }
  const conditions = branches.map(([, condition]) => new Function('opcode', 'opcode2', `return ${condition}`))
  const branchOf = new Uint8Array(0x10000)
  for (let opcode = 0; opcode < WIDE; opcode++) branchOf[opcode] = 1 + conditions.findIndex((is) => is(opcode, 0))
  const cases = branches.map(([, , statements], k) => `case ${k + 1}: {\n${statements}break }\n`)
  const jump = `switch (branchOf[opcode]) {\n${cases.join('')}default: ${source.slice(begin, end)} }\n`
  const method = `return { ${source.slice(0, begin)}${jump}${source.slice(end)} }.executeInstruction`
  return new Function('branchOf', ...Object.keys(NAMES), method)(branchOf, ...Object.values(NAMES))
}

let quick = null // made once, of the first core's

/** The core's instructions and its access to SRAM and the USB's memory; later corrections may replace the chip's. */
export function speedUp(mcu) {
  const { core, sramView, usbDPRAM, usbDPRAMView, usbCtrl } = mcu
  quick ??= jumping(core.executeInstruction)
  core.executeInstruction = quick
  const last = sramView.byteLength - 4
  core.readUint32 = (address) => {
    const at = (address >>> 0) - SRAM
    return at >= 0 && at <= last && (at & 3) === 0 ? sramView.getUint32(at, true) : mcu.readUint32(address)
  }
  core.writeUint32 = (address, value) => {
    const at = (address >>> 0) - SRAM
    if (at >= 0 && at <= last) sramView.setUint32(at, value, true)
    else mcu.writeUint32(address, value)
  }
  const write = mcu.writeUint8.bind(mcu)
  mcu.writeUint8 = (address, value) => {
    const at = (address >>> 0) - USB // as published two arrays are made for each byte
    if (at < 0 || at >= usbDPRAM.length) return write(address, value)
    usbDPRAM[at] = value
    usbCtrl.DPRAMUpdated(at & ~3, usbDPRAMView.getUint32(at & ~3, true))
  }
}
