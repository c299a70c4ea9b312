// The RP2040's bases for rp2_regs.h, and registers of this chip only (data sheet's sections).
#ifndef BIOTAC_RP2040_CHIP_REGS_H
#define BIOTAC_RP2040_CHIP_REGS_H

// ---- 2.2.2 blocks
#define CLOCKS_BASE     0x40008000u
#define RESETS_BASE     0x4000C000u
#define IO_BANK0_BASE   0x40014000u
#define PADS_BANK0_BASE 0x4001C000u
#define XOSC_BASE       0x40024000u
#define PLL_SYS_BASE    0x40028000u
#define PLL_USB_BASE    0x4002C000u
#define UART0_BASE      0x40034000u
#define SPI0_BASE       0x4003C000u
#define ADC_BASE        0x4004C000u
#define TIMER0_BASE     0x40054000u
#define WATCHDOG_BASE   0x40058000u

// ---- 2.3.1 SIO: single-cycle IO
#define SIO_GPIO_IN      REG32(0xD0000004u)
#define SIO_GPIO_OUT_SET REG32(0xD0000014u)
#define SIO_GPIO_OUT_CLR REG32(0xD0000018u)
#define SIO_GPIO_OE_SET  REG32(0xD0000024u)

// ---- 2.3.2 interrupts
#define TIMER_IRQ_0 0
#define USBCTRL_IRQ 5
#define PIO0_IRQ_0  7
#define PIO0_IRQ_1  8
#define UART0_IRQ   20

// ---- 2.5 DMA
#define DMA_BUSY              (1u << 24)
#define DMA_QUIET             (1u << 21) // no interrupt
#define DMA_UNPACED           (0x3Fu << 15)
#define DMA_BY_TIMER0         (0x3Bu << 15)
#define DMA_BY_PIO0_RX(sm)    ((4u + (sm)) << 15)
#define DMA_BY_UART0_TX       (20u << 15)
#define DMA_CHAIN_TO(channel) ((uint32_t)(channel) << 11)
#define DMA_WRITES_WRAP       (1u << 10)
#define DMA_WRAP_BYTES(bits)  ((uint32_t)(bits) << 6)
#define DMA_INCR_WRITE        (1u << 5)
#define DMA_TIMER0            REG32(0x50000420u) // ticks: clk_sys times upper over lower half
#define DMA_START             REG32(0x50000430u) // bit channel
#define DMA_CHAN_ABORT        REG32(0x50000444u)

// ---- 2.14 resets
#define RESETS_ADC        (1u << 0)
#define RESETS_DMA        (1u << 2)
#define RESETS_IO_BANK0   (1u << 5)
#define RESETS_PADS_BANK0 (1u << 8)
#define RESETS_PIO0       (1u << 10)
#define RESETS_PLL_SYS    (1u << 12)
#define RESETS_PLL_USB    (1u << 13)
#define RESETS_SPI0       (1u << 16)
#define RESETS_SYSINFO    (1u << 19)
#define RESETS_TIMER      (1u << 21)
#define RESETS_UART0      (1u << 22)
#define RESETS_USBCTRL    (1u << 24)

// ---- 2.15 clocks, 2.17 ROSC
#define CLK_USB_CTRL       REG32(CLOCKS_BASE + 0x54u)
#define CLK_ADC_CTRL       REG32(CLOCKS_BASE + 0x60u)
#define CLK_SYS_RESUS_CTRL REG32(CLOCKS_BASE + 0x78u)
#define ROSC_RANDOMBIT     REG32(0x4006001Cu)

// ---- 2.19 pins
#define GPIO_OUTOVER_LOW     (2u << 8) // overrides the function
#define GPIO_OUTOVER_HIGH    (3u << 8)
#define IO_QSPI_SS_CTRL      REG32(0x4001800Cu)
#define IO_QSPI_OUTOVER_LOW  (2u << 8)
#define IO_QSPI_OUTOVER_HIGH (3u << 8)
#define IO_QSPI_OUTOVER_BITS (3u << 8)

// ---- 3.7 PIO
#define PIO0_CTRL          REG32(0x50200000u) // bit sm: runs
#define PIO0_FSTAT         REG32(0x50200004u)
#define PIO_RX_EMPTY(sm)   (1u << (8 + (sm)))
#define PIO0_TXF(sm)       REG32(0x50200010u + 4u * (sm))
#define PIO0_RXF(sm)       REG32(0x50200020u + 4u * (sm))
#define PIO0_PROGRAM(at)   REG32(0x50200048u + 4u * (at))
#define PIO0_CLKDIV(sm)    REG32(0x502000C8u + 0x18u * (sm))
#define PIO_CLKDIV_NONE    (1u << 16)
#define PIO0_EXECCTRL(sm)  REG32(0x502000CCu + 0x18u * (sm))
#define PIO_JMP_PIN(pin)   ((uint32_t)(pin) << 24)
#define PIO_WRAP(from, to) ((uint32_t)(from) << 12 | (uint32_t)(to) << 7)
#define PIO_STATUS_TX(n)   (n) // STATUS is all ones while fewer than n words wait in TX
#define PIO0_SHIFTCTRL(sm)                                                                                   \
    REG32(0x502000D0u + 0x18u * (sm)) // 0: both to the left, 32 bits, nothing by itself
#define PIO_AUTOPUSH(bits) ((uint32_t)(bits) << 20 | 1u << 16)
#define PIO0_EXEC(sm)      REG32(0x502000D8u + 0x18u * (sm)) // executed at once
#define PIO0_PINCTRL(sm)   REG32(0x502000DCu + 0x18u * (sm))
#define PIO_IN_BASE(pin)   ((uint32_t)(pin) << 15)
#define PIO_OUT_ONE(pin)   (1u << 20 | (uint32_t)(pin))
#define PIO0_IRQ0_INTE     REG32(0x5020012Cu)
#define PIO_INT_RX(sm)     (1u << (sm)) // not empty
#define PIO0_IRQ1_INTF     REG32(0x5020013Cu)
#define PIO_INT_FLAG0      (1u << 8)

// ---- 4.6 timer, 4.7 watchdog
#define TIMER_INTR             REG32(TIMER0_BASE + 0x34u)
#define TIMER_INTE             REG32(TIMER0_BASE + 0x38u)
#define TIMER_INTF             REG32(TIMER0_BASE + 0x3Cu)
#define WATCHDOG_LOADS_OF_A_US 2u // RP2040-E1: it counts down twice a tick

// ---- 4.10 SSI: the flash's serial interface
#define SSI_SR      REG32(0x18000028u)
#define SSI_DR0     REG32(0x18000060u)
#define SSI_SR_TFNF (1u << 1)
#define SSI_SR_RFNE (1u << 3)

#endif
