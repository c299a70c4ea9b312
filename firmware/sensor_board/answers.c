// A sensor's answer does not depend on the master's bits meanwhile (firmware/emu/device.h). So after an
// exchange the model gives the next answer in advance: for before the end of the 50 us, and for after. The
// first is offered at once, the other when it is time. The model is given the next exchange at that
// exchange's end; where the model's answer differs from the offer, the word was late.
#include "answers.h"

#include "in_order.h"
#include "keep/storage.h"
#include "loop.h"
#include "only_board.h"
#include "rp2_regs.h"
#include "shifter.h"
#include "system.h"

#include <string.h>

#define SAMPLE_RAM 76800 // 3.5 s of five sensors, 17 s of one; whole pages of flash (loop.c)
_Static_assert(2 * SAMPLE_RAM % BT_FLASH_PAGE_BYTES == 0, "the last page that is kept must lie in it");

// The alarm offers the settled answer so long before the 50 us are over: an interrupt under way delays it by
// less.
#define AHEAD_US 2

// The main loop must reach the watchdog, however quiet bus and host are.
#define HEARTBEAT_US 100000

static bt_emu_device sensor[BT_MAX_FINGERS];
static uint16_t samples[SAMPLE_RAM];
static bt_emu_stream *source;
static bt_answer_counts counts;

// ---- delayed offers: for the alarm, and code that holds it off -----------------------------------------

static struct {
    bool waits;
    uint32_t at_us;
    uint32_t offer, after_byte;
} settling[BT_MAX_FINGERS];

static void set_alarm(void)
{
    int next = -1;
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        if (settling[f].waits && (next < 0 || (int32_t)(settling[f].at_us - settling[next].at_us) < 0)) {
            next = f;
        }
    }
    port_alarm_at(ONLY_BOARD, next >= 0 ? settling[next].at_us : port_now_us(ONLY_BOARD) + HEARTBEAT_US);
}

bool bt_port_alarm(void)
{
    uint32_t now_us = port_now_us(ONLY_BOARD);
    bool heartbeat = true;
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        if (settling[f].waits && (int32_t)(settling[f].at_us - now_us) <= 0) {
            settling[f].waits = heartbeat = false;
            (void)shifter_offer(f, settling[f].offer, settling[f].after_byte);
        }
    }
    set_alarm();
    return heartbeat;
}

// ---- a sensor's next answer ----------------------------------------------------------------------------

static uint32_t offer_at(const bt_emu_device *device, unsigned bytes, bool settled)
{
    uint64_t t_ns = device->released_ns + (settled ? BT_SETTLE_US * 1000 : 0);
    bool connected = device->present && !device->unplugged;
    return OFFER_WORD(bt_emu_word_ahead(device, bytes, settled, t_ns)) | (connected ? OFFER_DRIVE : 0)
           | (settled ? OFFER_SETTLED : 0);
}

static void offer(uint8_t finger)
{
    const bt_emu_device *device = &sensor[finger];
    uint32_t settled = offer_at(device, 0, true);
    uint32_t after_byte = offer_at(device, 1, true);
    uint32_t early = device->settled ? settled : offer_at(device, 0, false);
    uint32_t primask = interrupts_disable();
    bool newest = shifter_offer(finger, early, device->settled ? after_byte : 0);
    settling[finger].waits = newest && !device->settled;
    if (settling[finger].waits) {
        settling[finger].offer = settled;
        settling[finger].after_byte = after_byte;
        settling[finger].at_us = shifter_released_us(finger) + BT_SETTLE_US - AHEAD_US;
        set_alarm();
    }
    interrupts_restore(primask);
}

// ---- exchanges of a sensor -----------------------------------------------------------------------------

static void apply_exchange(uint8_t finger, const exchange *done, bool alone)
{
    bt_emu_device *device = &sensor[finger];
    uint64_t end_ns = done->t_us * 1000ull;
    bool settled = alone && done->offer & OFFER_SETTLED;
    // The offer shows the side of the 50 us.
    bt_emu_select(device, true, settled ? device->released_ns + BT_SETTLE_US * 1000 : device->released_ns);
    uint16_t answer = 0;
    for (int k = 0; k < done->bytes; k++) {
        uint8_t mosi = k == 0 ? (uint8_t)(done->mosi >> 8) : k == 1 ? (uint8_t)done->mosi : 0;
        uint8_t miso = bt_emu_transfer8(device, mosi, end_ns);
        answer = (uint16_t)(k > 1 ? answer : answer | miso << (k == 0 ? 8 : 0));
    }
    bt_emu_select(device, false, end_ns);
    if (alone && done->mosi <= BT_READ_MOSI_MAX) {
        uint16_t mask = done->bytes == 1 ? 0xFF00 : 0xFFFF;
        uint16_t offered = done->offer & OFFER_DRIVE ? OFFERED_WORD(done->offer) : 0;
        counts.words++;
        counts.late += ((answer ^ offered) & mask) != 0 || done->bytes > 2; // an offer has no third byte
    }
}

static void exchanged(void)
{
    exchange done;
    while (shifter_read(&done)) {
        bool alone = (done.selected & (done.selected - 1)) == 0;
        bool started = source->started;
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            if (done.selected >> f & 1) {
                apply_exchange(f, &done, alone);
                offer(f);
            }
        }
        if (source->started && done.mosi > BT_READ_MOSI_MAX) {
            counts.first_us = started ? counts.first_us : done.t_us;
            counts.latest_us = done.t_us;
        }
        uint32_t elapsed_us = port_now_us(ONLY_BOARD) - done.t_us;
        counts.slowest_us = elapsed_us > counts.slowest_us ? elapsed_us : counts.slowest_us;
    }
}

// ---- for the main loop: with only the model's interrupt held off -----------------------------------------

void answers_renew(void)
{
    interrupt_hold_off(PIO0_IRQ_1);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        offer(f);
    }
    interrupt_enable(PIO0_IRQ_1);
}

void answers_plug(uint8_t finger, bool present, const char *serial)
{
    interrupt_hold_off(PIO0_IRQ_1);
    bt_emu_init(&sensor[finger], finger, present, serial, bt_emu_stream_in_order, source);
    offer(finger);
    interrupt_enable(PIO0_IRQ_1);
}

void answers_forget(void)
{
    interrupt_hold_off(PIO0_IRQ_1);
    bt_emu_stream_init(source, samples, SAMPLE_RAM);
    memset(&counts, 0, sizeof counts);
    interrupt_enable(PIO0_IRQ_1);
}

void answers_start(bt_emu_stream *stream)
{
    source = stream;
    answers_forget();
    loop_play(stream);
    for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
        bt_emu_init(&sensor[f], f, true, "", bt_emu_stream_in_order, source);
    }
    shifter_start(exchanged);
    answers_renew();
}

bt_answer_counts answers_counts(void)
{
    interrupt_hold_off(PIO0_IRQ_1);
    bt_answer_counts now = counts;
    interrupt_enable(PIO0_IRQ_1);
    now.late += shifter_lost();
    return now;
}
