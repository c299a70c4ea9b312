// A slot of the sensors' bus without the core. One DMA channel deals a list of steps to another, one step, a
// word with a source and a target, every STEP_US (data sheet 2.5.6.2, control blocks). A step sets a chip
// select, sends a word or fetches one; most only pass the time.
//
// A DMA timer alone paces the dealer: a word is fetched when it is due, come or not. A late word shows at the
// end, when the interface is busy or has a word too many; the slot's words cannot be matched to sensors then,
// and none counts.
#include "only_board.h"

#include "dma.h"
#include "map/store.h"
#include "pins.h"
#include "selects.h"
#include "system.h"
#include "wait.h"
#include "wire/sensor_gen.h"

#include <string.h>

#define STEP_US      2 // two words of a step, one a us
#define STEPS_OF(us) (((us) + STEP_US - 1) / STEP_US)
#define WORD_STEPS   3 // 3.6 us, and the select's hold time
_Static_assert(STEP_US * 1000 >= SELECT_SETUP_NS, "the step from a select to its word is long enough");
_Static_assert((uint64_t)WORD_STEPS * STEP_US * 1000
                   >= 16u * 1000000000ull / BT_SPI_HZ * 51 / 50 + SELECT_HOLD_NS,
               "a select holds until its word is out");

// All selects fall, by the core, before step 0.
#define COMMAND_AT  1
#define RELEASE_AT  (COMMAND_AT + WORD_STEPS) // one select a step
#define DRAIN_AT    (RELEASE_AT + BT_MAX_FINGERS)
#define READS_AT    (DRAIN_AT - 1 + STEPS_OF(BT_SETTLE_US) + 1)
#define READ_STEPS  (1 + WORD_STEPS + STEPS_OF(BT_GAP_US))
#define FETCH_AT(f) (READS_AT + (f) * READ_STEPS + 1 + WORD_STEPS + 1)
#define STEPS       (FETCH_AT(BT_MAX_FINGERS - 1) + 1)
#define SLOT_US     (STEPS * STEP_US + 4)
_Static_assert(SLOT_US < 1000000 / BT_SLOT_HZ * 3 / 4, "and time is left to ask a sensor who it is");

typedef struct {
    uint32_t from, to; // addresses; both 0: a null trigger (2.5.4), which does nothing
} step;

static step steps[STEPS];
static volatile uint32_t command, listen, low, high, nowhere;
static volatile uint32_t got[BT_MAX_FINGERS];
static uint8_t read_mask;

static void set_step(int at, const volatile uint32_t *from, const volatile uint32_t *to)
{
    steps[at] = (step){dma_address(from), dma_address(to)};
}

// Sensors in mask are selected for their word; the others' words pass unheard.
static void set_reads(uint8_t mask)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        step select = {dma_address(&low), dma_address(&IO_BANK0_GPIO_CTRL(select_pin[f]))};
        steps[READS_AT + f * READ_STEPS] = mask >> f & 1 ? select : (step){0, 0};
    }
    read_mask = mask;
}

static void set_up_worker(void)
{
    DMA_CTRL(DMA_WORKER) = DMA_QUIET | DMA_UNPACED | DMA_CHAIN_TO_ITSELF(DMA_WORKER) | DMA_WORDS
                           | DMA_HIGH_PRIORITY | DMA_CHANNEL_EN;
}

void bus_start(void)
{
    spi_start();
    low = GPIO_FUNC_SIO | GPIO_OUTOVER_LOW;
    high = GPIO_FUNC_SIO | GPIO_OUTOVER_HIGH;
    listen = BT_LISTEN_WORD;
    set_step(COMMAND_AT, &command, &SPI0_SSPDR);
    set_step(DRAIN_AT, &SPI0_SSPDR, &nowhere);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        volatile uint32_t *select = &IO_BANK0_GPIO_CTRL(select_pin[f]);
        int at = READS_AT + f * READ_STEPS;
        set_step(RELEASE_AT + f, &high, select);
        set_step(at + 1, &listen, &SPI0_SSPDR);
        set_step(at + 1 + WORD_STEPS, &high, select);
        set_step(FETCH_AT(f), &SPI0_SSPDR, &got[f]);
    }
    set_reads(0);
    DMA_TIMER0 = 1u << 16 | CLK_SYS_HZ / 1000000u; // a word of a step every us
    DMA_TRANS_COUNT(DMA_WORKER) = 1;
    set_up_worker();
}

uint32_t port_spi_slot_begin(bt_port *port, uint16_t mosi, uint8_t mask)
{
    if (spi_is_slow()) {
        return 0;
    }
    command = mosi;
    spi_configure(spi_control);
    if (mask != read_mask) {
        set_reads(mask);
    }
    spi_select_at_once(mask);
    DMA_READ_ADDR(DMA_DEALER) = dma_address(steps);
    DMA_WRITE_ADDR(DMA_DEALER) = dma_address(&DMA_READ_THEN_WRITE_TRIG(DMA_WORKER));
    DMA_TRANS_COUNT(DMA_DEALER) = STEPS * (sizeof(step) / sizeof(uint32_t));
    DMA_TREQS_DUE(DMA_DEALER) = 0;   // ticks while there was nothing to do
    __asm volatile("" ::: "memory"); // write all that the DMA reads
    DMA_CTRL_TRIG(DMA_DEALER) = DMA_QUIET | DMA_BY_TIMER0 | DMA_CHAIN_TO_ITSELF(DMA_DEALER) | DMA_WRITES_WRAP
                                | DMA_WRAP_BYTES(3) | DMA_INCR_WRITE | DMA_INCR_READ | DMA_WORDS
                                | DMA_HIGH_PRIORITY | DMA_CHANNEL_EN;
    return SLOT_US;
}

bool port_spi_slot_end(bt_port *port, uint16_t *word)
{
    bool in_time = !(DMA_CTRL_TRIG(DMA_DEALER) & DMA_BUSY) && !(SPI0_SSPSR & (SSPSR_RNE | SSPSR_BSY));
    if (!in_time) {
        REG_CLR(DMA_CTRL(DMA_DEALER)) = DMA_CHANNEL_EN; // RP2350-E5: an abort may start a channel that is on
        REG_CLR(DMA_CTRL(DMA_WORKER)) = DMA_CHANNEL_EN;
        DMA_CHAN_ABORT = 1u << DMA_DEALER | 1u << DMA_WORKER;
        (void)wait_for(&DMA_CHAN_ABORT, 1u << DMA_DEALER | 1u << DMA_WORKER, 0, WAIT_SPI_TURNS);
        set_up_worker();
        spi_reset();
    }
    spi_select_at_once(0);
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        IO_BANK0_GPIO_CTRL(select_pin[f]) = GPIO_FUNC_SIO; // the core has it high by now
        word[f] = read_mask >> f & 1 ? (uint16_t)got[f] : 0;
    }
    return in_time;
}

port_abilities port_describe(bt_port *port)
{
    static _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
    return (port_abilities){
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = map_ram[0],
        .maps = flash_maps(),
    };
}
