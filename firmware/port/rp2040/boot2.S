// The second-stage boot: the chip's ROM copies the first 252 bytes of flash to SRAM and runs them, if the CRC-32 in the
// next four fits (data sheet 2.8.1.3; tools/image/boot2.py writes it). This code sets the flash's serial interface up
// for reads of the address space, then starts the watchdog and the program.
//
// 03h and nothing else: every serial flash knows it, at up to 50 MHz, and here it comes at clk_sys / 4, 31 MHz. Quad
// reads would save 20 ms of boot and nothing later, as the program runs from SRAM; to test for them takes 35h, by which
// some chips (ISSI, Macronix) enter a mode without 03h. flash.c calls this code again, from SRAM, after it has used the
// flash: then lr is not 0, and it returns.
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .boot2, "ax"
    .global boot2

boot2:
    ldr r3, =0x18000000             // XIP_SSI
    movs r1, #0
    movs r2, #1
    str r1, [r3, #0x08]             // SSIENR: off while it is set up
    movs r0, #4
    str r0, [r3, #0x14]             // BAUDR
    ldr r0, =(31 << 16) | (3 << 8)  // CTRLR0: serial, 32 data bits a frame, EEPROM read
    str r0, [r3, #0x00]
    str r1, [r3, #0x04]             // CTRLR1: one frame a read
    ldr r0, =(0x03 << 24) | (2 << 8) | (6 << 2)  // SPI_CTRLR0: command 03h, 8 bits of command, 24 of address
    movs r1, #0xf4
    str r0, [r3, r1]
    str r2, [r3, #0x08]
    mov r0, lr
    cmp r0, #0
    beq start
    bx r0

// The watchdog, before anything that could go wrong: two seconds, up to seven times as long on the ring oscillator.
start:
    ldr r3, =0x40010000             // PSM
    ldr r0, =0x1fffc                // everything but the oscillators
    str r0, [r3, #0x08]             // WDSEL
    ldr r3, =0x40058000             // WATCHDOG
    ldr r0, =2 * 2000000            // RP2040-E1: it counts down twice a tick
    str r0, [r3, #0x04]             // LOAD
    ldr r0, =(1 << 9) | 12          // a tick every us of the crystal
    str r0, [r3, #0x2c]             // TICK
    ldr r0, =(1 << 30) | (7 << 24)  // on; it waits while a debugger holds a core
    str r0, [r3, #0x00]             // CTRL
    ldr r0, =0x10000100             // the vector table, right behind this block
    ldr r1, =0xe000ed08             // VTOR
    str r0, [r1]
    ldmia r0, {r0, r1}
    msr msp, r0
    bx r1
    .ltorg
