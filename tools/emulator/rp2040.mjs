// The RP2040 as a chip for Machine: rp2040js, corrected, and the boot ROM's way into the flash.
import { ConsoleLogger, LogLevel, RP2040 } from 'rp2040js'

import { crcStep } from './dma.mjs'
import { correctCore } from './faults.mjs'
import { BootRom } from './rom.mjs'
import { speedUp } from './speed.mjs'

const FLASH_BYTES = 2 * 1024 * 1024 // of a Pico
const BOOT2_BYTES = 0x100
const BOOT2_AT = 0x20041f00 // where the boot ROM copies the first 256 bytes of flash, and jumps to
const SRAM = 0x20000000

/** The boot ROM would run this second-stage boot: the CRC-32 is right, with no final inversion. */
function bootable(flash) {
  const stored = Buffer.from(flash.subarray(BOOT2_BYTES - 4, BOOT2_BYTES)).readUInt32LE(0)
  return flash.subarray(0, BOOT2_BYTES - 4).reduce(crcStep, 0xffffffff) === stored
}

export const rp2040 = {
  flashBytes: FLASH_BYTES,
  family: 0xe48bff56, // of UF2 files
  Rom: BootRom,

  /** Throws an Error that says why the boot ROM would not start this image. */
  checkImage(image) {
    if (image.length <= BOOT2_BYTES || image.length > FLASH_BYTES) {
      throw new Error(`has ${image.length} bytes: expected a flash image of 257 bytes to 2 MiB`)
    }
    if (!bootable(image)) {
      throw new Error('does not begin with a second-stage boot and its CRC: expected the .bin of a Pico image')
    }
  },

  make(nanos) {
    const mcu = new RP2040()
    mcu.clock.nanosCounter = nanos
    mcu.logger = new ConsoleLogger(LogLevel.Error, true)
    mcu.blocks = { timer: mcu.peripherals[0x40054], watchdog: mcu.peripherals[0x40058], resets: mcu.peripherals[0x4000c] }
    mcu.resetBits = { spi0: 1 << 16, usb: 1 << 24 }
    mcu.dmaTimers = 0x420
    correctCore(mcu.core)
    speedUp(mcu)
    return mcu
  },

  /** The boot ROM: the first 256 bytes run from SRAM and find their way to the image. False: to the loader. */
  boot({ core, sram, flash }) {
    if (!bootable(flash)) return false
    sram.set(flash.subarray(0, BOOT2_BYTES), BOOT2_AT - SRAM)
    core.SP = BOOT2_AT
    core.LR = 0
    core.PC = BOOT2_AT
    return true
  },
}
