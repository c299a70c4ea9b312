#include "sim_board.h"

#include "bus.h"
#include "byte_queue.h"
#include "in_process.h"
#include "stream.h"
#include "wakeup.h"
#include "wire/sensor_gen.h"

#include <stdlib.h>
#include <string.h>

#define TRANSFER_NS    (16u * 1000000000u / BT_SPI_HZ)
// How often the link is served, in device time: a USB board does so every millisecond.
#define LINK_PERIOD_NS 1000000u
#define LIVE_ROUNDS    64u // how far ahead a program may be
#define INBOX_BYTES    65536u
#define ROOM_BYTES     32768u // for the output of one turn of the main loop
// A paced board drops bytes that the host does not fetch, as one on USB does: so many wait, in the board's
// own ring and in the operating system of a host.
#define PACED_BYTES    20480u
// Of an unpaced board: so much is enough to return with, and the longest time without output.
#define READ_BYTES     16384u
#define SLICE_NS       400000000u
#define PARTS_PUT_OFF  250u // of a board that never catches up

struct bt_sim {
    bt_port port;
    bt_sim_facts facts;
    bt_emu_stream stream;
    bt_emu_bus bus;
    bt_wait wait; // the lock guards all other members
    uint64_t now_ns, link_ns;
    uint64_t base_ns,
        base_wall_ns; // device time and this computer's, where pacing began; unpaced: as it last computed
    uint32_t restarts, turns;
    bool held, up, link_due, restart_due, ending;
    bool woken; // the next wait returns at once
    bool deaf;  // it is late, and hears the host only once it has caught up
    bt_byte_queue in, out;
    uint16_t ring[LIVE_ROUNDS * BT_SLOTS * BT_MAX_FINGERS];
    _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
    uint8_t inbox[INBOX_BYTES], outbox[BT_SIM_OUTBOX_BYTES];
};

static bt_sim *of(bt_port *port)
{
    return (bt_sim *)port;
}

// ---- the port -----------------------------------------------------------------------------------

static uint32_t now_us(bt_port *port)
{
    return (uint32_t)(of(port)->now_ns / 1000) + of(port)->facts.clock_us * (of(port)->restarts == 0);
}

static void delay_us(bt_port *port, uint32_t us)
{
    of(port)->now_ns += (uint64_t)us * 1000;
}

static void select_sensors(bt_port *port, uint8_t mask)
{
    bt_emu_bus_select(&of(port)->bus, mask, of(port)->now_ns);
}

static uint16_t transfer16(bt_port *port, uint16_t mosi)
{
    const uint16_t miso = bt_emu_bus_transfer16(&of(port)->bus, mosi, of(port)->now_ns);
    of(port)->now_ns += TRANSFER_NS;
    return miso;
}

static uint8_t transfer8(bt_port *port, uint8_t mosi)
{
    const uint8_t miso = bt_emu_bus_transfer8(&of(port)->bus, mosi, of(port)->now_ns);
    of(port)->now_ns += TRANSFER_NS / 2;
    return miso;
}

static bool write_link(bt_port *port, const uint8_t *data, size_t bytes)
{
    bt_sim *sim = of(port);
    if (!sim->up) {
        return true; // into an unplugged cable
    }
    if (sim->facts.pace > 0 && sim->out.filled + bytes > PACED_BYTES) {
        return false;
    }
    return bt_bytes_put(&sim->out, data, bytes) == bytes;
}

static size_t read_link(bt_port *port, uint8_t *data, size_t bytes)
{
    bt_sim *sim = of(port);
    const size_t n = sim->link_due ? bt_bytes_get(&sim->in, data, bytes) : 0;
    sim->link_due = n > 0;
    return n;
}

static uint32_t turns(bt_port *port)
{
    return of(port)->turns;
}

// As NOR flash does: erasing sets whole sectors to 0xFF, programming only clears bits.
static bool erase(bt_port *port, uint32_t sector_offset)
{
    memset(of(port)->facts.flash + sector_offset, 0xFF, BT_FLASH_SECTOR_BYTES);
    return true;
}

static bool program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    for (uint32_t k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        of(port)->facts.flash[page_offset + k] &= page[k];
    }
    return true;
}

static void read_flash(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, of(port)->facts.flash + offset, bytes);
}

static bool reboot(bt_port *port)
{
    of(port)->restart_due = true;
    return true;
}

static port_identity identify(bt_port *port)
{
    const bt_sim *sim = of(port);
    return (port_identity){
        .hello = {.board = sim->facts.tape == NULL ? BT_BOARD_POSIX_LIVE : BT_BOARD_POSIX_SIM,
                  .board_serial = "posix-sim",
                  .board_name = "simulator",
                  .boot_id = sim->facts.boot_id + sim->restarts,
                  .image_crc32 = UINT32_MAX},
        .started_by = BT_FAULT_FLAG_STARTED,
    };
}

static port_abilities describe(bt_port *port)
{
    bt_sim *sim = of(port);
    return (port_abilities){
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = sim->map_ram[0],
        .maps = sim->facts.flash + BT_STORAGE_BYTES,
    };
}

static const bt_port_kind kind = {
    .now_us = now_us,
    .delay_us = delay_us,
    .select = select_sensors,
    .transfer16 = transfer16,
    .transfer8 = transfer8,
    .write = write_link,
    .read = read_link,
    .turns = turns,
    .erase = erase,
    .program = program,
    .read_flash = read_flash,
    .reboot = reboot,
    .identify = identify,
    .describe = describe,
};

// ---- device time ---------------------------------------------------------------------------------

static void boot(bt_sim *sim)
{
    memset(&sim->port, 0, sizeof sim->port);
    memset(sim->map_ram, 0, sizeof sim->map_ram);
    sim->port.kind = &kind;
    sim->now_ns = sim->link_ns = 0;
    sim->link_due = true;
    sim->restart_due = false;
    bt_emu_bus_init(&sim->bus, sim->stream.fingers, sim->facts.serials, bt_emu_stream_by_clock, &sim->stream);
    bt_gateway_init(&sim->port.gateway, &sim->port);
}

static void pace_from_here(bt_sim *sim)
{
    sim->base_ns = sim->now_ns;
    sim->base_wall_ns = bt_wall_ns();
}

// The sensors' world goes on where it was, on the axis of the new board's clock.
static void restart(bt_sim *sim)
{
    bt_emu_stream *stream = &sim->stream;
    if (sim->facts.tape == NULL) { // a round that was not computed is the first that the board reads
        stream->at = stream->begins_at = stream->written;
        stream->started = false;
        stream->start_ns = 0;
    } else {
        stream->start_ns -= sim->now_ns; // modulo 2^64, as now_ns is
    }
    sim->restarts++;
    sim->held = false;
    boot(sim);
    pace_from_here(sim);
}

static uint64_t alarm_ns(const bt_sim *sim)
{
    const int32_t ahead_us = (int32_t)(sim->port.alarm_us - now_us((bt_port *)(uintptr_t)sim));
    return ahead_us <= 0 ? sim->now_ns : (sim->now_ns / 1000 + (uint64_t)ahead_us) * 1000;
}

// firmware/app/main.c's loop, until device time would pass until_ns, `enough` bytes wait for the host, or
// time stands still: returns whether it does.
static bool run(bt_sim *sim, uint64_t until_ns, size_t enough)
{
    sim->link_due = !sim->deaf;
    for (;;) {
        bt_gateway_poll(&sim->port.gateway);
        if (sim->restart_due) {
            restart(sim);
            return false;
        }
        if (sim->out.filled >= enough) {
            return false;
        }
        const uint64_t next_ns = alarm_ns(sim);
        if (sim->held || bt_emu_stream_lacks(&sim->stream, next_ns)) {
            if (sim->in.filled == 0 || sim->deaf) {
                return true;
            }
            sim->link_due = true;
            continue;
        }
        if (next_ns > until_ns) {
            return false;
        }
        if (sim->now_ns - sim->link_ns >= LINK_PERIOD_NS) {
            sim->link_ns = sim->now_ns;
            sim->link_due = !sim->deaf;
        }
        sim->now_ns = next_ns > sim->now_ns ? next_ns : sim->now_ns;
        (void)bt_gateway_alarm(&sim->port.gateway);
    }
}

static uint64_t due_ns(const bt_sim *sim)
{
    return sim->base_ns + (uint64_t)((double)(bt_wall_ns() - sim->base_wall_ns) * sim->facts.pace);
}

void bt_sim_serve(bt_sim *sim)
{
    unsigned put_off = 0;
    bt_wait_lock(&sim->wait);
    while (!sim->ending) {
        // Late time is computed in parts, between which the host may read. Input from now is not heard at an
        // earlier time, or the host would take the board's clock for a slow one.
        const uint64_t due = due_ns(sim), part = sim->now_ns + LINK_PERIOD_NS;
        const bool late = !sim->held && due > part;
        const size_t before = sim->out.filled;
        put_off = late && put_off < PARTS_PUT_OFF ? put_off + 1 : 0;
        sim->deaf = !late || put_off > 0;
        const bool still = run(sim, late ? part : due, SIZE_MAX);
        sim->deaf = false;
        if ((still || !late) && sim->in.filled > 0) { // input that comes now is answered at the present time
            const uint64_t now = due_ns(sim), next = alarm_ns(sim);
            if (!still) {
                sim->now_ns = now < next ? (now > sim->now_ns ? now : sim->now_ns) : next;
            }
            (void)run(sim, sim->now_ns, SIZE_MAX);
        }
        if (sim->out.filled > before || still) {
            bt_wait_notify(&sim->wait);
        }
        if (still || !late) {
            bt_wait_for(&sim->wait, still ? 1000000000u : LINK_PERIOD_NS);
        } else {
            bt_wait_unlock(&sim->wait);
            bt_wait_lock(&sim->wait);
        }
    }
    bt_wait_unlock(&sim->wait);
}

// ---- for Python ---------------------------------------------------------------------------------

bt_sim *bt_sim_new(const bt_sim_facts *facts)
{
    bt_sim *sim = calloc(1, sizeof *sim);
    if (sim == NULL) {
        return NULL;
    }
    bt_emu_stream *stream = &sim->stream;
    sim->facts = *facts;
    sim->in = (bt_byte_queue){.bytes = sim->inbox, .size = sizeof sim->inbox};
    sim->out = (bt_byte_queue){.bytes = sim->outbox, .size = sizeof sim->outbox};
    sim->held = sim->up = true;
    sim->turns = 1;
    bt_wait_init(&sim->wait);
    if (facts->tape == NULL) {
        bt_emu_stream_init(stream, sim->ring, LIVE_ROUNDS * BT_SLOTS * facts->fingers);
        (void)bt_emu_stream_put(stream, facts->fingers, NULL, 0); // so many fingers
    } else {
        bt_emu_stream_init(stream, NULL, facts->rounds * BT_SLOTS);
        stream->tape = facts->tape;
        stream->fingers = facts->fingers;
        stream->written = stream->slots;
    }
    boot(sim);
    return sim;
}

void bt_sim_free(bt_sim *sim)
{
    bt_wait_free(&sim->wait);
    free(sim);
}

void bt_sim_release(bt_sim *sim)
{
    bt_wait_lock(&sim->wait);
    if (sim->held) {
        sim->held = false;
        pace_from_here(sim);
    }
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
}

void bt_sim_restart(bt_sim *sim)
{
    bt_wait_lock(&sim->wait);
    restart(sim);
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
}

void bt_sim_plug(bt_sim *sim, bool up)
{
    bt_wait_lock(&sim->wait);
    sim->turns += up != sim->up;
    sim->up = up;
    sim->in.filled = sim->out.filled = 0;
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
}

size_t bt_sim_write(bt_sim *sim, const uint8_t *data, size_t bytes)
{
    bt_wait_lock(&sim->wait);
    const size_t heard = sim->up ? bt_bytes_put(&sim->in, data, bytes) : bytes;
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
    return heard;
}

static uint64_t ns_of(double timeout_s)
{
    return timeout_s > 0 ? (uint64_t)((timeout_s < 1e6 ? timeout_s : 1e6) * 1e9) : 0;
}

// Compute an unpaced board until something can be read; returns how long nothing more will come by itself.
// Without a stream nobody reads the rows that measure its time: no more of it passes then than of ours, or a
// program that stops its stream would find the tape over.
static uint64_t compute(bt_sim *sim)
{
    if (sim->facts.pace > 0) {
        return UINT64_MAX;
    }
    const uint64_t wall_ns = bt_wall_ns(), passed_ns = wall_ns - sim->base_wall_ns;
    const bool streams = sim->facts.tape == NULL || sim->port.gateway.session.status.streams != 0;
    sim->base_wall_ns = wall_ns;
    const bool still =
        run(sim, sim->now_ns + (streams || passed_ns > SLICE_NS ? SLICE_NS : passed_ns), READ_BYTES);
    return still ? UINT64_MAX : streams ? 0 : LINK_PERIOD_NS;
}

static bool is_over(const bt_sim *sim)
{
    return sim->facts.tape != NULL && !sim->held && bt_emu_stream_lacks(&sim->stream, alarm_ns(sim));
}

size_t bt_sim_read(bt_sim *sim, uint8_t *data, size_t bytes, double timeout_s, bool *ended)
{
    const uint64_t until_ns = bt_wall_ns() + ns_of(timeout_s);
    bt_wait_lock(&sim->wait);
    for (;;) {
        const uint64_t still_ns = compute(sim);
        const bool over = is_over(sim) && sim->out.filled == 0;
        const uint64_t now_ns = bt_wall_ns();
        const bool news = over && !*ended;
        *ended = over;
        if (sim->out.filled > 0 || sim->ending || sim->woken || news || now_ns >= until_ns) {
            break;
        }
        if (still_ns > 0) {
            bt_wait_for(&sim->wait, still_ns < until_ns - now_ns ? still_ns : until_ns - now_ns);
        }
    }
    sim->woken = false;
    const size_t n = bt_bytes_get(&sim->out, data, bytes);
    if (n > 0) {
        bt_wait_notify(&sim->wait); // there is room again
    }
    bt_wait_unlock(&sim->wait);
    return n;
}

bool bt_sim_over(bt_sim *sim)
{
    bt_wait_lock(&sim->wait);
    const bool over = is_over(sim);
    bt_wait_unlock(&sim->wait);
    return over;
}

void bt_sim_await(bt_sim *sim, double timeout_s)
{
    bt_wait_lock(&sim->wait);
    if (sim->in.filled == 0 && sim->out.filled == 0 && !sim->ending && !sim->woken) {
        bt_wait_for(&sim->wait, ns_of(timeout_s));
    }
    sim->woken = false;
    bt_wait_unlock(&sim->wait);
}

// Returns whether all words are computed: if not, the board's output has to be read first.
static bool feed(bt_sim *sim, const uint8_t *words, uint32_t rounds)
{
    (void)bt_emu_stream_put(&sim->stream, sim->facts.fingers, words, rounds * BT_SLOTS);
    return run(sim, UINT64_MAX, BT_SIM_OUTBOX_BYTES - ROOM_BYTES);
}

size_t bt_sim_step(bt_sim *sim, const uint8_t *words, uint32_t rounds, uint8_t *data, size_t bytes)
{
    bt_wait_lock(&sim->wait);
    (void)feed(sim, words, rounds);
    const size_t n = bt_bytes_get(&sim->out, data, bytes);
    bt_wait_unlock(&sim->wait);
    return n;
}

bool bt_sim_put(bt_sim *sim, const uint8_t *words, uint32_t rounds, double timeout_s)
{
    const uint64_t until_ns = bt_wall_ns() + ns_of(timeout_s);
    bt_wait_lock(&sim->wait);
    bool done = feed(sim, words, rounds);
    bt_wait_notify(&sim->wait); // a server of the board to another program has something to read
    for (uint64_t now_ns = bt_wall_ns(); !done && now_ns < until_ns; now_ns = bt_wall_ns()) {
        bt_wait_for(&sim->wait, until_ns - now_ns);
        done = feed(sim, words, 0);
        bt_wait_notify(&sim->wait);
    }
    bt_wait_unlock(&sim->wait);
    return done;
}

void bt_sim_wake(bt_sim *sim)
{
    bt_wait_lock(&sim->wait);
    sim->woken = true;
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
}

void bt_sim_end(bt_sim *sim)
{
    bt_wait_lock(&sim->wait);
    sim->ending = true;
    bt_wait_notify(&sim->wait);
    bt_wait_unlock(&sim->wait);
}
