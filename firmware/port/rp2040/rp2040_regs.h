// Registers of the RP2040 and its Cortex-M0+ core, by their data-sheet names; only those this port uses.
// Section numbers are those of the RP2040 data sheet. Every register is a 32-bit word.
#ifndef BIOTAC_RP2040_REGS_H
#define BIOTAC_RP2040_REGS_H

#include "cortex_m.h"

#include <stdint.h>

// 2.1.2: each peripheral's registers (not SIO, nor the core's) again, where a write sets or clears bits.
#define REG_SET(reg) (*(&(reg) + 0x2000 / 4))
#define REG_CLR(reg) (*(&(reg) + 0x3000 / 4))

// What clocks_start (system.c) makes of the crystal.
#define CLK_SYS_HZ 125000000u

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
#define DMA_READ_ADDR(channel)   REG32(0x50000000u + 0x40u * (channel))
#define DMA_WRITE_ADDR(channel)  REG32(0x50000004u + 0x40u * (channel))
#define DMA_TRANS_COUNT(channel) REG32(0x50000008u + 0x40u * (channel))
#define DMA_CTRL_TRIG(channel)   REG32(0x5000000Cu + 0x40u * (channel))
#define DMA_CTRL(channel)        REG32(0x50000010u + 0x40u * (channel)) // alias 1: without starting it
#define DMA_READ_THEN_WRITE_TRIG(channel) REG32(0x50000028u + 0x40u * (channel)) // alias 2: of two words
#define DMA_READ_TRIG(channel)            REG32(0x5000003Cu + 0x40u * (channel)) // alias 3
#define DMA_TREQS_DUE(channel)            REG32(0x50000800u + 0x40u * (channel)) // CTDREQ; any write: none
#define DMA_BUSY                          (1u << 24)
#define DMA_QUIET                         (1u << 21) // no interrupt
#define DMA_UNPACED                       (0x3Fu << 15)
#define DMA_BY_TIMER0                     (0x3Bu << 15)
#define DMA_BY_PIO0_RX(sm)                ((4u + (sm)) << 15)
#define DMA_BY_UART0_TX                   (20u << 15)
#define DMA_CHAIN_TO(channel)             ((uint32_t)(channel) << 11)
#define DMA_CHAIN_TO_ITSELF(channel)      DMA_CHAIN_TO(channel) // that is, to none
#define DMA_WRITES_WRAP                   (1u << 10)
#define DMA_WRAP_BYTES(bits)              ((uint32_t)(bits) << 6)
#define DMA_INCR_WRITE                    (1u << 5)
#define DMA_INCR_READ                     (1u << 4)
#define DMA_WORDS                         (2u << 2) // DATA_SIZE; 0: bytes
#define DMA_HIGH_PRIORITY                 (1u << 1)
#define DMA_CHANNEL_EN                    (1u << 0)
#define DMA_TIMER0                        REG32(0x50000420u) // ticks: clk_sys times upper over lower half
#define DMA_START                         REG32(0x50000430u) // bit channel
#define DMA_CHAN_ABORT                    REG32(0x50000444u)

// ---- 2.14 resets
#define RESETS_RESET      REG32(0x4000C000u)
#define RESETS_RESET_DONE REG32(0x4000C008u)
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

// ---- 2.15 clocks
#define CLK_REF_CTRL       REG32(0x40008030u)
#define CLK_REF_SELECTED   REG32(0x40008038u)
#define CLK_SYS_CTRL       REG32(0x4000803Cu)
#define CLK_SYS_SELECTED   REG32(0x40008044u)
#define CLK_PERI_CTRL      REG32(0x40008048u)
#define CLK_USB_CTRL       REG32(0x40008054u)
#define CLK_ADC_CTRL       REG32(0x40008060u)
#define CLK_SYS_RESUS_CTRL REG32(0x40008078u)
#define CLK_REF_SRC_XOSC   2u
#define CLK_SYS_SRC_AUX    1u // from PLL_SYS, the aux source after reset
#define CLK_ENABLE         (1u << 11)

// ---- 2.16 XOSC, 2.17 ROSC, 2.18 PLL
#define XOSC_CTRL           REG32(0x40024000u)
#define XOSC_STATUS         REG32(0x40024004u)
#define XOSC_STARTUP        REG32(0x4002400Cu)
#define XOSC_CTRL_1_15MHZ   0xAA0u
#define XOSC_CTRL_ENABLE    (0xFABu << 12)
#define XOSC_STABLE         (1u << 31)
#define ROSC_RANDOMBIT      REG32(0x4006001Cu)
#define PLL_SYS_BASE        0x40028000u
#define PLL_USB_BASE        0x4002C000u
#define PLL_CS(base)        REG32((base) + 0x0u)
#define PLL_PWR(base)       REG32((base) + 0x4u)
#define PLL_FBDIV_INT(base) REG32((base) + 0x8u)
#define PLL_PRIM(base)      REG32((base) + 0xCu)
#define PLL_CS_LOCK         (1u << 31)
#define PLL_PWR_PD          (1u << 0)
#define PLL_PWR_POSTDIVPD   (1u << 3)
#define PLL_PWR_VCOPD       (1u << 5)

// ---- 2.19 pins
#define IO_BANK0_GPIO_CTRL(n) REG32(0x40014004u + 8u * (n))
#define GPIO_FUNC_SPI         1u
#define GPIO_FUNC_UART        2u
#define GPIO_FUNC_SIO         5u
#define GPIO_FUNC_PIO0        6u
#define GPIO_OUTOVER_LOW      (2u << 8) // whatever the function says
#define GPIO_OUTOVER_HIGH     (3u << 8)
#define PADS_BANK0_GPIO(n)    REG32(0x4001C004u + 4u * (n))
#define PADS_OD               (1u << 7)
#define PADS_IE               (1u << 6)
#define PADS_DRIVE_4MA        (1u << 4)
#define PADS_PUE              (1u << 3)
#define PADS_PDE              (1u << 2)
#define PADS_SCHMITT          (1u << 1)
#define IO_QSPI_SS_CTRL       REG32(0x4001800Cu)
#define IO_QSPI_OUTOVER_LOW   (2u << 8)
#define IO_QSPI_OUTOVER_HIGH  (3u << 8)
#define IO_QSPI_OUTOVER_BITS  (3u << 8)

// ---- 2.20 system information
#define SYSINFO_CHIP_ID REG32(0x40000000u) // revision, part, manufacturer from the highest bit down

// ---- 4.9 ADC
#define ADC_CS            REG32(0x4004C000u)
#define ADC_RESULT        REG32(0x4004C004u)
#define ADC_INPUT(n)      ((uint32_t)(n) << 12)
#define ADC_INPUT_OF(pin) ADC_INPUT((pin) - 26)
#define ADC_INPUT_DIE     ADC_INPUT(4)
#define ADC_READY         (1u << 8)
#define ADC_START_ONCE    (1u << 2)
#define ADC_DIE_ON        (1u << 1)
#define ADC_EN            (1u << 0)

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

// ---- 4.1 USB device controller
#define USB_DPRAM_BASE         0x50100000u
#define USB_EP_IN_CONTROL(ep)  REG32(USB_DPRAM_BASE + 8u * (ep))      // ep > 0
#define USB_EP_OUT_CONTROL(ep) REG32(USB_DPRAM_BASE + 8u * (ep) + 4u) // ep > 0
#define USB_BUFFER_IN(ep)      REG32(USB_DPRAM_BASE + 0x80u + 8u * (ep))
#define USB_BUFFER_OUT(ep)     REG32(USB_DPRAM_BASE + 0x84u + 8u * (ep))
#define USB_EP0_BUFFER         0x100u // offset of endpoint 0's data, both ways
#define USB_EP_ENABLE          (1u << 31)
#define USB_EP_INT_PER_BUFFER  (1u << 29)
#define USB_EP_TYPE_BULK       (2u << 26)
#define USB_EP_TYPE_INTERRUPT  (3u << 26)
#define USB_BUFFER_FULL        (1u << 15)
#define USB_BUFFER_DATA1       (1u << 13)
#define USB_BUFFER_STALL       (1u << 11)
#define USB_BUFFER_AVAILABLE   (1u << 10)
#define USB_BUFFER_LENGTH      0x3FFu
#define USB_ADDR_ENDP          REG32(0x50110000u)
#define USB_MAIN_CTRL          REG32(0x50110040u)
#define USB_SIE_CTRL           REG32(0x5011004Cu)
#define USB_SOF_RD             REG32(0x50110048u) // number of the frame
#define USB_SIE_STATUS         REG32(0x50110050u)
#define USB_BUFF_STATUS        REG32(0x50110058u) // bit 2 ep: IN, bit 2 ep + 1: OUT
#define USB_EP0_BUFFERS        3u
#define USB_EP_STALL_ARM       REG32(0x50110068u)
#define USB_USB_MUXING         REG32(0x50110074u)
#define USB_USB_PWR            REG32(0x50110078u)
#define USB_INTE               REG32(0x50110090u)
#define USB_INTS               REG32(0x50110098u)
#define USB_CONTROLLER_EN      (1u << 0)
#define USB_SIE_EP0_INT_1BUF   (1u << 29)
#define USB_SIE_PULLUP_EN      (1u << 16)
#define USB_SIE_BUS_RESET      (1u << 19)
#define USB_SIE_SETUP_REC      (1u << 17)
#define USB_SIE_RESUME         (1u << 11)
#define USB_SIE_SUSPENDED      (1u << 4)
#define USB_SIE_LINE_STATE     (3u << 2)
#define USB_SIE_LINE_J         (1u << 2)
#define USB_STALL_EP0_IN       (1u << 0)
#define USB_STALL_EP0_OUT      (1u << 1)
#define USB_MUXING_TO_PHY      (1u << 0)
#define USB_MUXING_SOFTCON     (1u << 3)
#define USB_PWR_VBUS_DETECT    (1u << 3)
#define USB_PWR_VBUS_OVERRIDE  (1u << 2)
#define USB_INT_SOF            (1u << 17) // until SOF_RD is read
#define USB_INT_SETUP_REQ      (1u << 16)
#define USB_INT_RESUME         (1u << 15)
#define USB_INT_SUSPEND        (1u << 14)
#define USB_INT_BUS_RESET      (1u << 12)
#define USB_INT_BUFF_STATUS    (1u << 4)

// ---- 4.2 UART: an ARM PL011
#define UART_DR           REG32(0x40034000u)
#define UART_FR           REG32(0x40034018u)
#define UART_IBRD         REG32(0x40034024u)
#define UART_FBRD         REG32(0x40034028u)
#define UART_LCR_H        REG32(0x4003402Cu) // a write puts IBRD and FBRD in force
#define UART_CR           REG32(0x40034030u)
#define UART_IMSC         REG32(0x40034038u)
#define UART_ICR          REG32(0x40034044u)
#define UART_DMACR        REG32(0x40034048u)
#define UART_FIFO_BYTES   32
#define UART_FR_RXFE      (1u << 4)
#define UART_FR_BUSY      (1u << 3)
#define UART_LCR_H_8_BITS (3u << 5)
#define UART_LCR_H_FEN    (1u << 4)
#define UART_CR_RXE       (1u << 9)
#define UART_CR_TXE       (1u << 8)
#define UART_CR_UARTEN    (1u << 0)
#define UART_INT_RT       (1u << 6) // some came, and for 32 bits nothing more
#define UART_INT_RX       (1u << 4) // half of the FIFO came
#define UART_DMACR_TXDMAE (1u << 1)

// ---- 4.4 SPI: an ARM PL022
#define SPI0_SSPCR0    REG32(0x4003C000u)
#define SPI0_SSPCR1    REG32(0x4003C004u)
#define SPI0_SSPDR     REG32(0x4003C008u)
#define SPI0_SSPSR     REG32(0x4003C00Cu)
#define SPI0_SSPCPSR   REG32(0x4003C010u)
#define SSPCR0_DSS_8   7u
#define SSPCR0_DSS_16  15u // data size less one; FRF, SPO and SPH are 0: Motorola, mode 0
#define SSPCR0_SCR_LSB 8
#define SSPCR1_SSE     (1u << 1)
#define SSPSR_RNE      (1u << 2)
#define SPI_FIFO_WORDS 8
#define SSPSR_BSY      (1u << 4)

// ---- 4.6 timer
#define TIMER_ALARM0     REG32(0x40054010u)
#define TIMER_ARMED      REG32(0x40054020u)
#define TIMER_TIMERAWL   REG32(0x40054028u)
#define TIMER_DBGPAUSE   REG32(0x4005402Cu)
#define TIMER_INTR       REG32(0x40054034u)
#define TIMER_INTE       REG32(0x40054038u)
#define TIMER_INTF       REG32(0x4005403Cu)
#define TIMER_ALARM0_BIT 1u

// ---- 4.7 watchdog
#define WATCHDOG_CTRL      REG32(0x40058000u)
#define WATCHDOG_LOAD      REG32(0x40058004u)
#define WATCHDOG_REASON    REG32(0x40058008u)
#define WATCHDOG_SCRATCH0  REG32(0x4005800Cu) // these keep their values over every reset but power-on
#define WATCHDOG_SCRATCH1  REG32(0x40058010u)
#define WATCHDOG_SCRATCH2  REG32(0x40058014u)
#define WATCHDOG_TIMED_OUT (1u << 0)
#define WATCHDOG_TRIGGER   (1u << 31)

// ---- 4.10 SSI: the flash's serial interface
#define SSI_SR      REG32(0x18000028u)
#define SSI_DR0     REG32(0x18000060u)
#define SSI_SR_TFNF (1u << 1)
#define SSI_SR_RFNE (1u << 3)
#define XIP_BASE    0x10000000u

#endif
