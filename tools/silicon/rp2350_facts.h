// The RP2350 as in the data sheet and the vendor's headers, for rp2_rules.c: written from there, and
// from nothing of the port's.
#define CHIP_RP2350 1
#define APB_BYTES   0x120000
#define CLOCKS      0x40010000u
#define PSM         0x40018000u
#define RESETS      0x40020000u
#define IO          0x40028000u
#define PADS        0x40038004u
#define XOSC        0x40048000u
#define PLL_SYS     0x40050000u
#define PLL_USB     0x40058000u
#define UART        0x40070000u
#define SPI0        0x40080000u
#define ADC         0x400A0000u
#define TIMER       0x400B0000u
#define QMI         0x400D0000u
#define WATCHDOG    0x400D8000u
#define ROSC        0x400E8000u
#define TICKS       0x40108000u
#define OUT_SET     0x18
#define OUT_CLR     0x20
#define OE_SET      0x38
#define OUTOVER_LSB 12
#define ABORT       0x50000464u
#define PAD_RESET   0x116u
#define PAD_ISO     0x100u
#define RESET_BITS                                                                                           \
    {0x40000000u, 0x4000, 21}, {IO, 0x4000, 6}, {PADS - 4, 0x4000, 9}, {PLL_SYS, 0x4000, 14},                \
        {PLL_USB, 0x4000, 15}, {UART, 0x4000, 26}, {SPI0, 0x4000, 18}, {ADC, 0x4000, 0},                     \
        {TIMER, 0x4000, 23}, {0x50000000u, 0x4000, 2}, {0x50100000u, 0x20000, 28}
#define RESETS_LEFT   (0x1FFFFFFFu & ~(1u << 7 | 1u << 10))
#define INTERRUPTS    (1ull << 0 | 1ull << 14 | 1ull << 33) // TIMER, USBCTRL, UART0
#define USBCTRL_RESET 28
#define LOADS_OF_A_US 1u
enum { BUSY_LSB = 26, QUIET_LSB = 23, TREQ_LSB = 17, CHAIN_LSB = 13, RING_LSB = 8, INCR_WRITE_LSB = 6 };
