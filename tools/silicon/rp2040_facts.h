// The RP2040 as in the data sheet, for rp2_rules.c: written from there, and from nothing of the port's.
#define CHIP_RP2040 1
#define APB_BYTES   0x70000
#define CLOCKS      0x40008000u
#define RESETS      0x4000C000u
#define IO          0x40014000u
#define PADS        0x4001C004u
#define XOSC        0x40024000u
#define PLL_SYS     0x40028000u
#define PLL_USB     0x4002C000u
#define UART        0x40034000u
#define SPI0        0x4003C000u
#define ADC         0x4004C000u
#define TIMER       0x40054000u
#define WATCHDOG    0x40058000u
#define OUT_SET     0x14
#define OUT_CLR     0x18
#define OE_SET      0x24
#define OUTOVER_LSB 8
#define ABORT       0x50000444u
#define PAD_RESET   0x56u
#define PAD_ISO     0u
// Bits of RESETS with a block, and those that the ROM has cleared: IO_QSPI, PADS_QSPI, TIMER.
#define RESET_BITS                                                                                           \
    {0x40000000u, 0x4000, 19}, {IO, 0x4000, 5}, {PADS - 4, 0x4000, 8}, {PLL_SYS, 0x4000, 12},                \
        {PLL_USB, 0x4000, 13}, {UART, 0x4000, 22}, {SPI0, 0x4000, 16}, {ADC, 0x4000, 0},                     \
        {TIMER, 0x4000, 21}, {0x50000000u, 0x4000, 2}, {0x50100000u, 0x20000, 24}
#define RESETS_LEFT   (0x01FFFFFFu & ~(1u << 6 | 1u << 9 | 1u << 21))
#define INTERRUPTS    (1ull << 0 | 1ull << 5 | 1ull << 20) // TIMER, USBCTRL, UART0
#define USBCTRL_RESET 24
#define LOADS_OF_A_US 2u
// CTRL of a DMA channel: the lowest bit of each field.
enum { BUSY_LSB = 24, QUIET_LSB = 21, TREQ_LSB = 15, CHAIN_LSB = 11, RING_LSB = 6, INCR_WRITE_LSB = 5 };
