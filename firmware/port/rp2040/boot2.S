// The second-stage boot: what the chip's ROM copies from the first 252 bytes of flash to SRAM and runs, if the
// CRC-32 in the next four fits (data sheet 2.8.1.3; tools/image/boot2.py writes it). It tells the flash's serial
// interface how to answer reads of the address space, then starts the program.
//
// 03h is what every serial flash knows, at up to 50 MHz: at clk_sys / 4, 31 MHz, a word takes 256 cycles. Quad
// reads, EBh without its command, take 40 at clk_sys / 2, but need four lines that are wired and switched on. So
// status register 2 is asked whether they are (QE: always so in the Pico's W25Q16JV-IQ), and is never written; and
// the first word that comes back must be what this code has in SRAM. Otherwise it stays at 03h: the image is copied to SRAM
// once, and 20 ms later than with quad reads.
// flash.c calls this code again, from SRAM, after it has used the flash: then lr is not 0, and it returns.
    .syntax unified
    .cpu cortex-m0plus
    .thumb
    .section .boot2, "ax"
    .global boot2

.equ CTRLR0, 0x00
.equ CTRLR1, 0x04
.equ SSIENR, 0x08
.equ BAUDR, 0x14
.equ SR, 0x28
.equ DR0, 0x60
.equ RX_SAMPLE_DLY, 0xf0            // from DR0: 0x90
.equ SPI_CTRLR0, 0xf4
.equ SR_BUSY, 1
.equ SR_TFE, 4
.equ MARK_AT, 248
.equ QUAD, (2 << 21) | (31 << 16) | (3 << 8)  // CTRLR0: four lines, 32 data bits a frame, EEPROM read
.equ SERIAL, (31 << 16) | (3 << 8)
.equ ADDRESS_AND_MODE, (8 << 2) | (4 << 11)   // SPI_CTRLR0: 32 bits, then four clocks of waiting

// r3: XIP_SSI; r4: XIP_SSI + 0xf0; r5: 0; r6: 1
boot2:
    push {r4-r6, lr}
    // The pads as wanted at 62 MHz: a fast strong clock, inputs without hysteresis (data sheet 2.19.6.4).
    ldr r3, =0x40020000             // PADS_QSPI
    movs r0, #(2 << 4) | 1
    str r0, [r3, #0x04]             // SCLK: 8 mA, fast
    ldr r0, [r3, #0x08]
    movs r1, #2
    bics r0, r1
    str r0, [r3, #0x08]             // SD0 to SD3
    str r0, [r3, #0x0c]
    str r0, [r3, #0x10]
    str r0, [r3, #0x14]

    ldr r3, =0x18000000
    movs r4, #RX_SAMPLE_DLY
    adds r4, r3
    movs r5, #0
    movs r6, #1
    str r5, [r3, #SSIENR]           // off while it is set up
    movs r0, #4
    str r0, [r3, #BAUDR]
    lsls r0, r6, #19
    subs r0, r6
    lsrs r0, #16
    lsls r0, #16                    // 7 << 16: serial, 8 bits a frame, both ways
    str r0, [r3, #CTRLR0]
    str r6, [r3, #SSIENR]
    movs r0, #0x35                  // read status register 2
    str r0, [r3, #DR0]
    str r5, [r3, #DR0]
    bl idle
    ldr r0, [r3, #DR0]
    ldr r0, [r3, #DR0]
    str r5, [r3, #SSIENR]
    cmp r0, #0xff                   // nobody answers
    beq serial
    lsrs r0, #2                     // QE to carry
    bcc serial

    movs r0, #2
    str r0, [r3, #BAUDR]
    str r6, [r4]                    // RX_SAMPLE_DLY: half a bit for the way there and back
    ldr r0, =QUAD
    str r0, [r3, #CTRLR0]
    str r5, [r3, #CTRLR1]           // one frame a read
    ldr r0, =ADDRESS_AND_MODE | (2 << 8) | 1  // an 8-bit command on one line, the rest on four
    str r0, [r4, #SPI_CTRLR0 - RX_SAMPLE_DLY]
    str r6, [r3, #SSIENR]
    movs r0, #0xeb
    str r0, [r3, #DR0]
    movs r0, #0xa0                  // the mode in which the next read needs no command
    str r0, [r3, #DR0]
    bl idle
    str r5, [r3, #SSIENR]
    ldr r0, =(0xa0 << 24) | ADDRESS_AND_MODE | 2  // no command, the mode behind the address
    str r0, [r4, #SPI_CTRLR0 - RX_SAMPLE_DLY]
    str r6, [r3, #SSIENR]
    ldr r0, =0x13000000 + MARK_AT    // flash, past the cache
    ldr r0, [r0]
    ldr r1, mark
    cmp r0, r1
    beq done

    // The lines are not what they seemed. Ones on the first end the mode.
    str r5, [r3, #SSIENR]
    lsls r0, r6, #16
    subs r0, r6
    lsls r1, r6, #20
    subs r1, r6
    lsrs r1, #16
    lsls r1, #16                    // 15 << 16: serial, 16 bits
    str r1, [r3, #CTRLR0]
    str r6, [r3, #SSIENR]
    str r0, [r3, #DR0]
    bl idle
    str r5, [r3, #SSIENR]

serial:
    movs r0, #4
    str r0, [r3, #BAUDR]
    ldr r0, =SERIAL
    str r0, [r3, #CTRLR0]
    str r5, [r3, #CTRLR1]
    ldr r0, =(0x03 << 24) | (2 << 8) | (6 << 2)  // command 03h, 8 bits of command, 24 of address
    str r0, [r4, #SPI_CTRLR0 - RX_SAMPLE_DLY]
    str r6, [r3, #SSIENR]

done:
    pop {r4-r6}
    pop {r0}
    cmp r0, #0
    beq 1f
    bx r0
1:  ldr r0, =0x10000100             // the vector table, right behind this block
    ldr r1, =0xe000ed08             // VTOR
    str r0, [r1]
    ldmia r0, {r0, r1}
    msr msp, r0
    bx r1

// Until all is sent. Bounded: a word takes some hundred cycles.
idle:
    movs r2, #0xff
2:  ldr r0, [r3, #SR]
    lsrs r1, r0, #1                 // BUSY to carry
    bcs 3f
    lsrs r0, #3                     // TFE to carry
    bcs 4f
3:  subs r2, r6
    bne 2b
4:  bx lr
    .ltorg
    .org MARK_AT                    // the last word before the CRC
mark:
    .word 0x5aa53cc3                // every line high and low
