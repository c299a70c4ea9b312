// The second-stage boot: what the chip's ROM copies from the first 252 bytes of flash to SRAM and runs, if the
// CRC-32 in the next four fits (data sheet 2.8.1.3; tools/uf2.py writes it). It tells the flash's serial
// interface to answer reads of the address space with the flash's plain read command, then starts the program.
//
// 03h is what every serial flash knows, at up to 50 MHz; clk_sys / 4 is 31 MHz. Reads are thus slow, which is
// why the sampling interrupt runs from SRAM. Quad reads would need a status bit of the particular flash.
// flash.c calls this code again, from SRAM, after it has used the flash: then lr is not 0, and it returns.
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .boot2, "ax"
    .global boot2
boot2:
    push {lr}
    ldr r3, =0x18000000         // XIP_SSI
    movs r1, #0
    str r1, [r3, #0x08]         // SSIENR: off while it is set up
    movs r1, #4
    str r1, [r3, #0x14]         // BAUDR: clk_sys / 4
    ldr r1, =(31 << 16) | (3 << 8)
    str r1, [r3, #0x00]         // CTRLR0: standard SPI, 32 data bits a frame, EEPROM read
    ldr r1, =(0x03 << 24) | (2 << 8) | (6 << 2)
    ldr r0, =0x180000f4
    str r1, [r0]                // SPI_CTRLR0: command 03h, 8 bits of command, 24 of address
    movs r1, #0
    str r1, [r3, #0x04]         // CTRLR1: one frame a read
    movs r1, #1
    str r1, [r3, #0x08]         // SSIENR: on
    pop {r0}
    cmp r0, #0
    beq 1f
    bx r0
1:  ldr r0, =0x10000100         // the vector table, right behind this block
    ldr r1, =0xe000ed08         // VTOR
    str r0, [r1]
    ldmia r0, {r0, r1}
    msr msp, r0
    bx r1
    .ltorg
