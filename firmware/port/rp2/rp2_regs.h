// Registers common to the RP2040 and the RP2350, by data-sheet name; only those in use here. Each chip's
// chip_regs.h has the bases of the blocks and the differences. Section numbers are those of the RP2040 data
// sheet. Every register is a 32-bit word.
#ifndef BIOTAC_RP2_REGS_H
#define BIOTAC_RP2_REGS_H

#include "chip_regs.h"
#include "cortex_m.h"

#include <stdint.h>

// 2.1.2: each peripheral's registers (not SIO, nor the core's) again, where a write sets or clears bits.
#define REG_SET(reg) (*(&(reg) + 0x2000 / 4))
#define REG_CLR(reg) (*(&(reg) + 0x3000 / 4))

// Set by clocks_start (system.c).
#define CLK_SYS_HZ 125000000u

// ---- 2.5 DMA
#define DMA_READ_ADDR(channel)   REG32(0x50000000u + 0x40u * (channel))
#define DMA_WRITE_ADDR(channel)  REG32(0x50000004u + 0x40u * (channel))
#define DMA_TRANS_COUNT(channel) REG32(0x50000008u + 0x40u * (channel))
#define DMA_CTRL_TRIG(channel)   REG32(0x5000000Cu + 0x40u * (channel))
#define DMA_CTRL(channel)        REG32(0x50000010u + 0x40u * (channel)) // alias 1: without starting it
#define DMA_READ_THEN_WRITE_TRIG(channel) REG32(0x50000028u + 0x40u * (channel)) // alias 2: of two words
#define DMA_READ_TRIG(channel)            REG32(0x5000003Cu + 0x40u * (channel)) // alias 3
#define DMA_TREQS_DUE(channel)       REG32(0x50000800u + 0x40u * (channel)) // CTDREQ; any write clears it
#define DMA_CHAIN_TO_ITSELF(channel) DMA_CHAIN_TO(channel)                  // that is, to none
#define DMA_INCR_READ                (1u << 4)
#define DMA_WORDS                    (2u << 2) // DATA_SIZE; 0: bytes
#define DMA_HIGH_PRIORITY            (1u << 1)
#define DMA_CHANNEL_EN               (1u << 0)

// ---- 2.14 resets
#define RESETS_RESET      REG32(RESETS_BASE + 0x00u)
#define RESETS_RESET_DONE REG32(RESETS_BASE + 0x08u)

// ---- 2.15 clocks
#define CLK_REF_CTRL     REG32(CLOCKS_BASE + 0x30u)
#define CLK_REF_SELECTED REG32(CLOCKS_BASE + 0x38u)
#define CLK_SYS_CTRL     REG32(CLOCKS_BASE + 0x3Cu)
#define CLK_SYS_SELECTED REG32(CLOCKS_BASE + 0x44u)
#define CLK_PERI_CTRL    REG32(CLOCKS_BASE + 0x48u)
#define CLK_REF_SRC_XOSC 2u
#define CLK_SYS_SRC_AUX  1u // from PLL_SYS, the aux source after reset
#define CLK_ENABLE       (1u << 11)

// ---- 2.16 XOSC, 2.17 ROSC, 2.18 PLL
#define XOSC_CTRL           REG32(XOSC_BASE + 0x00u)
#define XOSC_STATUS         REG32(XOSC_BASE + 0x04u)
#define XOSC_STARTUP        REG32(XOSC_BASE + 0x0Cu)
#define XOSC_CTRL_1_15MHZ   0xAA0u
#define XOSC_CTRL_ENABLE    (0xFABu << 12)
#define XOSC_STABLE         (1u << 31)
#define PLL_CS(base)        REG32((base) + 0x0u)
#define PLL_PWR(base)       REG32((base) + 0x4u)
#define PLL_FBDIV_INT(base) REG32((base) + 0x8u)
#define PLL_PRIM(base)      REG32((base) + 0xCu)
#define PLL_CS_LOCK         (1u << 31)
#define PLL_PWR_PD          (1u << 0)
#define PLL_PWR_POSTDIVPD   (1u << 3)
#define PLL_PWR_VCOPD       (1u << 5)

// ---- 2.19 pins
#define IO_BANK0_GPIO_CTRL(n) REG32(IO_BANK0_BASE + 0x04u + 8u * (n))
#define GPIO_FUNC_SPI         1u
#define GPIO_FUNC_UART        2u
#define GPIO_FUNC_SIO         5u
#define GPIO_FUNC_PIO0        6u
#define PADS_BANK0_GPIO(n)    REG32(PADS_BANK0_BASE + 0x04u + 4u * (n))
#define PADS_OD               (1u << 7)
#define PADS_IE               (1u << 6)
#define PADS_DRIVE_4MA        (1u << 4)
#define PADS_PUE              (1u << 3)
#define PADS_PDE              (1u << 2)
#define PADS_SCHMITT          (1u << 1)

// ---- 2.20 system information
#define SYSINFO_CHIP_ID REG32(0x40000000u) // revision, part, manufacturer from the highest bit down

// ---- 4.9 ADC
#define ADC_CS            REG32(ADC_BASE + 0x00u)
#define ADC_RESULT        REG32(ADC_BASE + 0x04u)
#define ADC_INPUT(n)      ((uint32_t)(n) << 12)
#define ADC_INPUT_OF(pin) ADC_INPUT((pin) - 26)
#define ADC_INPUT_DIE     ADC_INPUT(4)
#define ADC_READY         (1u << 8)
#define ADC_START_ONCE    (1u << 2)
#define ADC_DIE_ON        (1u << 1)
#define ADC_EN            (1u << 0)

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
#define UART_DR           REG32(UART0_BASE + 0x00u)
#define UART_FR           REG32(UART0_BASE + 0x18u)
#define UART_IBRD         REG32(UART0_BASE + 0x24u)
#define UART_FBRD         REG32(UART0_BASE + 0x28u)
#define UART_LCR_H        REG32(UART0_BASE + 0x2Cu) // a write puts IBRD and FBRD in force
#define UART_CR           REG32(UART0_BASE + 0x30u)
#define UART_IMSC         REG32(UART0_BASE + 0x38u)
#define UART_ICR          REG32(UART0_BASE + 0x44u)
#define UART_DMACR        REG32(UART0_BASE + 0x48u)
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
#define SPI0_SSPCR0    REG32(SPI0_BASE + 0x00u)
#define SPI0_SSPCR1    REG32(SPI0_BASE + 0x04u)
#define SPI0_SSPDR     REG32(SPI0_BASE + 0x08u)
#define SPI0_SSPSR     REG32(SPI0_BASE + 0x0Cu)
#define SPI0_SSPCPSR   REG32(SPI0_BASE + 0x10u)
#define SSPCR0_DSS_8   7u
#define SSPCR0_DSS_16  15u // data size less one; FRF, SPO and SPH are 0: Motorola, mode 0
#define SSPCR0_SCR_LSB 8
#define SSPCR1_SSE     (1u << 1)
#define SSPSR_RNE      (1u << 2)
#define SPI_FIFO_WORDS 8
#define SSPSR_BSY      (1u << 4)

// ---- 4.6 timer
#define TIMER_ALARM0     REG32(TIMER0_BASE + 0x10u)
#define TIMER_ARMED      REG32(TIMER0_BASE + 0x20u)
#define TIMER_TIMERAWL   REG32(TIMER0_BASE + 0x28u)
#define TIMER_DBGPAUSE   REG32(TIMER0_BASE + 0x2Cu)
#define TIMER_ALARM0_BIT 1u

// ---- 4.7 watchdog
#define WATCHDOG_CTRL   REG32(WATCHDOG_BASE + 0x00u)
#define WATCHDOG_LOAD   REG32(WATCHDOG_BASE + 0x04u)
#define WATCHDOG_REASON REG32(WATCHDOG_BASE + 0x08u)
#define WATCHDOG_SCRATCH0                                                                                    \
    REG32(WATCHDOG_BASE + 0x0Cu) // these keep their values over every reset but power-on
#define WATCHDOG_SCRATCH1  REG32(WATCHDOG_BASE + 0x10u)
#define WATCHDOG_SCRATCH2  REG32(WATCHDOG_BASE + 0x14u)
#define WATCHDOG_TIMED_OUT (1u << 0)
#define WATCHDOG_TRIGGER   (1u << 31)

// ---- 2.6 flash as memory
#define XIP_BASE 0x10000000u

#endif
