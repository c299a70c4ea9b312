// The RP2350's bases for rp2_regs.h, and registers of this chip only. Section numbers are those of the RP2350
// data sheet; tools/silicon/rp2350_registers.txt checks every number against the vendor's headers.
#ifndef BIOTAC_RP2350_CHIP_REGS_H
#define BIOTAC_RP2350_CHIP_REGS_H

// ---- 2.2.4 blocks
#define CLOCKS_BASE     0x40010000u
#define PSM_BASE        0x40018000u
#define RESETS_BASE     0x40020000u
#define IO_BANK0_BASE   0x40028000u
#define PADS_BANK0_BASE 0x40038000u
#define XOSC_BASE       0x40048000u
#define PLL_SYS_BASE    0x40050000u
#define PLL_USB_BASE    0x40058000u
#define UART0_BASE      0x40070000u
#define SPI0_BASE       0x40080000u
#define ADC_BASE        0x400A0000u
#define TIMER0_BASE     0x400B0000u
#define QMI_BASE        0x400D0000u
#define WATCHDOG_BASE   0x400D8000u
#define ROSC_BASE       0x400E8000u
#define TICKS_BASE      0x40108000u

// ---- 3.1 SIO: single-cycle IO
#define SIO_GPIO_IN      REG32(0xD0000004u)
#define SIO_GPIO_OUT_SET REG32(0xD0000018u)
#define SIO_GPIO_OUT_CLR REG32(0xD0000020u)
#define SIO_GPIO_OE_SET  REG32(0xD0000038u)

// ---- 3.2 interrupts
#define TIMER_IRQ_0 0
#define USBCTRL_IRQ 14
#define UART0_IRQ   33

// ---- 12.6 DMA
#define DMA_BUSY              (1u << 26)
#define DMA_QUIET             (1u << 23) // no interrupt
#define DMA_UNPACED           (0x3Fu << 17)
#define DMA_BY_TIMER0         (0x3Bu << 17)
#define DMA_BY_UART0_TX       (28u << 17)
#define DMA_CHAIN_TO(channel) ((uint32_t)(channel) << 13)
#define DMA_WRITES_WRAP       (1u << 12)
#define DMA_WRAP_BYTES(bits)  ((uint32_t)(bits) << 8)
#define DMA_INCR_WRITE        (1u << 6)
#define DMA_TIMER0            REG32(0x50000440u) // ticks: clk_sys times upper over lower half
#define DMA_CHAN_ABORT        REG32(0x50000464u)

// ---- 7.5 resets
#define RESETS_ADC        (1u << 0)
#define RESETS_DMA        (1u << 2)
#define RESETS_IO_BANK0   (1u << 6)
#define RESETS_PADS_BANK0 (1u << 9)
#define RESETS_PLL_SYS    (1u << 14)
#define RESETS_PLL_USB    (1u << 15)
#define RESETS_SPI0       (1u << 18)
#define RESETS_SYSINFO    (1u << 21)
#define RESETS_TIMER      (1u << 23)
#define RESETS_UART0      (1u << 26)
#define RESETS_USBCTRL    (1u << 28)

// ---- 8.1 clocks, 8.3 ROSC, 8.5 ticks
#define CLK_REF_DIV           REG32(CLOCKS_BASE + 0x34u)
#define CLK_SYS_DIV           REG32(CLOCKS_BASE + 0x40u)
#define CLK_PERI_DIV          REG32(CLOCKS_BASE + 0x4Cu)
#define CLK_USB_CTRL          REG32(CLOCKS_BASE + 0x60u)
#define CLK_USB_DIV           REG32(CLOCKS_BASE + 0x64u)
#define CLK_ADC_CTRL          REG32(CLOCKS_BASE + 0x6Cu)
#define CLK_ADC_DIV           REG32(CLOCKS_BASE + 0x70u)
#define CLK_SYS_RESUS_CTRL    REG32(CLOCKS_BASE + 0x84u)
#define CLK_DIV_ONE           (1u << 16)
#define ROSC_RANDOMBIT        REG32(ROSC_BASE + 0x20u)
#define TICKS_TIMER0_CTRL     REG32(TICKS_BASE + 0x18u)
#define TICKS_TIMER0_CYCLES   REG32(TICKS_BASE + 0x1Cu)
#define TICKS_WATCHDOG_CTRL   REG32(TICKS_BASE + 0x30u)
#define TICKS_WATCHDOG_CYCLES REG32(TICKS_BASE + 0x34u)
#define TICKS_ENABLE          (1u << 0)

// ---- 9.11 pins
#define GPIO_OUTOVER_LOW  (2u << 12) // overrides the function
#define GPIO_OUTOVER_HIGH (3u << 12)

// ---- 12.8 timer, 12.9 watchdog, 7.4 PSM
#define TIMER_INTR             REG32(TIMER0_BASE + 0x3Cu)
#define TIMER_INTE             REG32(TIMER0_BASE + 0x40u)
#define TIMER_INTF             REG32(TIMER0_BASE + 0x44u)
#define WATCHDOG_LOADS_OF_A_US 1u
#define WATCHDOG_ENABLE        (1u << 30)
#define WATCHDOG_PAUSE_DEBUG   (7u << 24)
#define PSM_WDSEL              REG32(PSM_BASE + 0x08u)
#define PSM_ALL_BUT_XOSC_ROSC  0x01FFFFF3u

// ---- 12.14 QMI: the flash's serial interface
#define QMI_DIRECT_CSR           REG32(QMI_BASE + 0x00u)
#define QMI_DIRECT_TX            REG32(QMI_BASE + 0x04u)
#define QMI_DIRECT_RX            REG32(QMI_BASE + 0x08u)
#define QMI_DIRECT_CSR_RXEMPTY   (1u << 16)
#define QMI_DIRECT_CSR_TXFULL    (1u << 10)
#define QMI_DIRECT_CSR_ASSERT_CS (1u << 2) // CS0N
#define QMI_DIRECT_CSR_EN        (1u << 0)

#endif
