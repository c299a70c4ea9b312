// Two state machines of PIO0 and a look-up by DMA, so that no answer waits for the core:
//
//   the watcher sees a change of the five selects and sends the address of the answer in `offers`;
//   the DMA uses the address, fetches the word from there, and hands it to
//   the shifter, which shifts it out and MOSI in, until the next word comes.
//
// From a select's fall to MISO these need some 25 cycles, 0.2 us.
#include "shifter.h"

#include "dma.h"
#include "pins.h"
#include "system.h"
#include "wait.h"
#include "wire/sensor_gen.h"

#include "only_board.h"

_Static_assert(PIN_SELECT_4 == PIN_SELECT_0 + BT_MAX_FINGERS - 1, "taken in at once");

// ---- instructions, data sheet 3.4 ------------------------------------------------------------------------

enum condition { ALWAYS = 0, X_IS_ZERO = 1, X_AND_COUNT_DOWN = 2, X_IS_NOT_Y = 5, PIN_IS_HIGH = 6 };
enum place { PINS = 0, X = 1, Y = 2, NONE = 3, PINDIRS = 4, STATUS = 5, ISR = 6, OSR = 7 };
#define JMP(condition, to) (0x0000u | (condition) << 5 | (to))
#define WAIT_LOW_GPIO(pin) (0x2000u | (pin))
#define IN(from, bits)     (0x4000u | (from) << 5 | (bits))
#define OUT(to, bits)      (0x6000u | (to) << 5 | (bits))
#define PUSH_OR_WAIT       0x8020u
#define PULL_OR_WAIT       0x80A0u
#define MOV(to, from)      (0xA000u | (to) << 5 | (from))

enum { SHIFTER = 0, WATCHER = 1 }; // state machines

// Start addresses of the programs, and jump targets.
enum { OFFERED = 0, NEXT_BIT = 5, CLOCK_LOW = 6, CLOCK_HIGH = 12, SHIFTER_END = 13 };
enum { LOOK = 14, CHANGED = 20, WATCHER_END = 21 };

static const uint16_t program[] = {
    // OFFERED: the first bit of an offer is "drive MISO", the second "a sensor is selected".
    PULL_OR_WAIT,
    MOV(Y, OSR),
    OUT(PINDIRS, 1),
    OUT(X, 1),
    JMP(X_IS_ZERO, OFFERED), // deaf, and without an end
    // NEXT_BIT, out while the clock is low
    OUT(PINS, 1),
    // CLOCK_LOW: until the clock rises, or there is another offer
    JMP(PIN_IS_HIGH, CLOCK_HIGH),
    MOV(X, STATUS),
    JMP(X_AND_COUNT_DOWN, CLOCK_LOW),
    MOV(ISR, Y), // the offer ends the received bytes; bits that are no whole byte are dropped
    PUSH_OR_WAIT,
    JMP(ALWAYS, OFFERED),
    // CLOCK_HIGH
    IN(PINS, 1), // pushes each byte
    WAIT_LOW_GPIO(PIN_SCK),
    // and on with NEXT_BIT

    // LOOK: OSR holds the address of `offers` without the lower seven bits, Y the last one sent.
    MOV(ISR, OSR),
    IN(PINS, BT_MAX_FINGERS),
    IN(NONE, 2),
    MOV(X, ISR),
    JMP(X_IS_NOT_Y, CHANGED),
    JMP(ALWAYS, LOOK),
    // CHANGED
    MOV(Y, X),
    PUSH_OR_WAIT,
    // and on with LOOK
};
_Static_assert(sizeof program / sizeof *program == WATCHER_END + 1 && WATCHER_END < 32, "it fits");

// ---- offers ----------------------------------------------------------------------------------------------

#define SELECTS        (1u << BT_MAX_FINGERS)
#define NOBODY         (SELECTS - 1) // all selects are high
#define OFFER_SELECTED (1u << 30)
#define OFFER_MARK     (1u << 8) // distinguishes an offer that comes back from a byte

// Indexed by the five selects, low for selected.
static volatile uint32_t offers[SELECTS] __attribute__((aligned(SELECTS * 4)));

#define EXCHANGES 32 // a slot has ten at most
static exchange done[EXCHANGES];
static volatile uint8_t done_head; // this file's interrupt
static volatile uint8_t done_tail; // the reader
static volatile uint32_t lost;
static exchange current;

static struct {
    volatile uint8_t waiting;      // exchanges not read yet
    volatile uint32_t after_byte;  // offer for after one byte of the present one
    volatile uint32_t released_us; // when the select last rose
} finger_state[BT_MAX_FINGERS];

static uint32_t silence(uint32_t selects)
{
    return OFFER_MARK | selects | (selects != NOBODY ? OFFER_SELECTED : 0);
}

static uint32_t alone(uint8_t finger)
{
    return NOBODY & ~(1u << finger);
}

bool shifter_offer(uint8_t finger, uint32_t offer, uint32_t after_byte)
{
    if (finger_state[finger].waiting != 0) {
        return false;
    }
    finger_state[finger].after_byte = after_byte;
    offers[alone(finger)] = offer | silence(alone(finger));
    return true;
}

uint32_t shifter_released_us(uint8_t finger)
{
    return finger_state[finger].released_us;
}

static void put_exchange(uint32_t offer, uint8_t selected, uint32_t now_us)
{
    uint8_t head = done_head;
    if ((uint8_t)(head - done_tail) == EXCHANGES) {
        lost = lost + 1;
        return;
    }
    current.offer = offer;
    current.selected = selected;
    current.t_us = now_us;
    done[head % EXCHANGES] = current;
    done_head = (uint8_t)(head + 1);
    REG_SET(PIO0_IRQ1_INTF) = PIO_INT_FLAG0;
}

static void end_exchange(uint32_t offer)
{
    uint32_t now_us = port_now_us(ONLY_BOARD);
    uint8_t selected = (uint8_t)(NOBODY & ~offer);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (!(selected >> f & 1)) {
            continue;
        }
        finger_state[f].released_us = now_us;
        if (current.bytes > 0) {
            bool byte_read = current.bytes == 1 && current.mosi <= BT_READ_MOSI_MAX;
            offers[alone(f)] = silence(alone(f)) | (byte_read ? finger_state[f].after_byte : 0);
            finger_state[f].after_byte = 0;
            finger_state[f].waiting = (uint8_t)(finger_state[f].waiting + 1);
        }
    }
    if (current.bytes > 0) {
        put_exchange(offer, selected, now_us);
    }
    current.mosi = 0;
    current.bytes = 0;
}

static void rx_interrupt(void)
{
    for (int k = 0; k < SPI_FIFO_WORDS && !(PIO0_FSTAT & PIO_RX_EMPTY(SHIFTER)); k++) {
        uint32_t word = PIO0_RXF(SHIFTER);
        if (word & OFFER_MARK) {
            end_exchange(word);
            continue;
        }
        if (current.bytes < 2) {
            current.mosi = (uint16_t)(current.mosi | word << (current.bytes == 0 ? 8 : 0));
        }
        current.bytes = (uint8_t)(current.bytes + (current.bytes < UINT8_MAX));
    }
}

bool shifter_read(exchange *out)
{
    REG_CLR(PIO0_IRQ1_INTF) = PIO_INT_FLAG0; // one that ends now sets it again
    uint8_t tail = done_tail;
    if (tail == done_head) {
        return false;
    }
    *out = done[tail % EXCHANGES];
    uint32_t primask = interrupts_disable();
    done_tail = (uint8_t)(tail + 1);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        finger_state[f].waiting = (uint8_t)(finger_state[f].waiting - (out->selected >> f & 1));
    }
    interrupts_restore(primask);
    return true;
}

uint32_t shifter_lost(void)
{
    return lost;
}

// ---- start -----------------------------------------------------------------------------------------------

// DMA channels: two pass addresses on, each after the end of the other, and one fetches.
enum { ASKER = DMA_DEALER, FETCHER = DMA_WORKER, ASKER_TOO = DMA_UART_TX + 1 };

static void start_asker(uint32_t channel, uint32_t next)
{
    DMA_READ_ADDR(channel) = dma_address(&PIO0_RXF(WATCHER));
    DMA_WRITE_ADDR(channel) = dma_address(&DMA_READ_TRIG(FETCHER));
    DMA_TRANS_COUNT(channel) = UINT32_MAX; // 17 hours
    DMA_CTRL(channel) = DMA_QUIET | DMA_BY_PIO0_RX(WATCHER) | DMA_CHAIN_TO(next) | DMA_WORDS
                        | DMA_HIGH_PRIORITY | DMA_CHANNEL_EN;
}

static void start_lookup(void)
{
    DMA_WRITE_ADDR(FETCHER) = dma_address(&PIO0_TXF(SHIFTER));
    DMA_TRANS_COUNT(FETCHER) = 1;
    DMA_CTRL(FETCHER) = DMA_QUIET | DMA_UNPACED | DMA_CHAIN_TO_ITSELF(FETCHER) | DMA_WORDS | DMA_HIGH_PRIORITY
                        | DMA_CHANNEL_EN;
    start_asker(ASKER_TOO, ASKER);
    start_asker(ASKER, ASKER_TOO);
    DMA_START = 1u << ASKER;
}

static void start_machine(uint32_t sm, uint32_t from, uint32_t to, uint32_t in_base)
{
    PIO0_CLKDIV(sm) = PIO_CLKDIV_NONE;
    PIO0_EXECCTRL(sm) = PIO_JMP_PIN(PIN_SCK) | PIO_WRAP(from, to) | PIO_STATUS_TX(1);
    PIO0_SHIFTCTRL(sm) = sm == SHIFTER ? PIO_AUTOPUSH(8) : 0;
    PIO0_PINCTRL(sm) = PIO_IN_BASE(in_base) | PIO_OUT_ONE(PIN_MISO);
    PIO0_EXEC(sm) = JMP(ALWAYS, sm == SHIFTER ? OFFERED : LOOK);
}

void shifter_start(void (*exchanged)(void))
{
    (void)reset_blocks(RESETS_PIO0);
    for (uint32_t selects = 0; selects < SELECTS; selects++) {
        offers[selects] = silence(selects);
    }
    for (uint32_t k = 0; k < sizeof program / sizeof *program; k++) {
        PIO0_PROGRAM(k) = program[k];
    }
    start_machine(SHIFTER, SHIFTER_END, NEXT_BIT, PIN_MOSI);
    start_machine(WATCHER, WATCHER_END, LOOK, PIN_SELECT_0);
    PIO0_TXF(WATCHER) = dma_address(offers) >> (BT_MAX_FINGERS + 2);
    PIO0_EXEC(WATCHER) = PULL_OR_WAIT; // into OSR
    start_lookup();

    for (uint32_t pin = PIN_SELECT_0; pin <= PIN_SELECT_4; pin++) {
        PADS_BANK0_GPIO(pin) = PADS_IE | PADS_SCHMITT | PADS_PUE; // an open lead selects no sensor
    }
    PADS_BANK0_GPIO(PIN_SCK) = PADS_IE | PADS_SCHMITT | PADS_PDE;
    PADS_BANK0_GPIO(PIN_MOSI) = PADS_IE | PADS_SCHMITT | PADS_PDE;
    PADS_BANK0_GPIO(PIN_MISO) = PADS_DRIVE_4MA | PADS_SCHMITT | PADS_IE | PADS_PDE;
    IO_BANK0_GPIO_CTRL(PIN_MISO) = GPIO_FUNC_PIO0;

    PIO0_IRQ0_INTE = PIO_INT_RX(SHIFTER);
    use_interrupt(PIO0_IRQ_0, 0, rx_interrupt);
    use_interrupt(PIO0_IRQ_1, 1, exchanged); // behind it and the timer's, before the USB's
    PIO0_CTRL = 1u << SHIFTER | 1u << WATCHER;
}
