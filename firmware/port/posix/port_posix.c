// The board that is a process: emulated sensors on an emulated bus, the link on a pty or a loopback socket,
// device time that passes only as the firmware spends it.
//
//   biotac-sim --tape FILE | --live FINGERS
//              [--socket] [--pace X] [--hold] [--boot-id N] [--clock-us N] [--serials A,B,...] [--flash FILE]
//
// Writes "pty PATH" or "socket PORT" to stdout, and "end" once the tape is played and all of it handed over.
// --live: a program feeds the sensors round by round (control.h), and device time stands still until it has
// sent
//   the next round. Writes "control PORT" before that.
// --socket: a TCP port in place of a pty. Who connects there, or to the control port, says the token of
// door.h first.
// --pace: device seconds per second, 0 for as fast as the host reads (nothing is then dropped).
// --clock-us: what its clock shows at first, as of a board that has been on for so long.
// --flash: where saved settings and maps are kept; without it they are gone with the process.
// --hold: device time stands still until "run" comes on stdin. "restart" on stdin resets the board, as a
// host's command does; then it writes "restarted". End of stdin ends the process.
#define _DEFAULT_SOURCE
#include "only_board.h"
#include "spi_word_by_word.h"

#include "bus.h"
#include "clock.h"
#include "control.h"
#include "flash.h"
#include "link.h"
#include "map/store.h"
#include "os.h"
#include "restart.h"
#include "stream.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define TRANSFER_NS    (16u * 1000000000u / BT_SPI_HZ)
// How often the link is served, in device time: a USB board does so every millisecond.
#define LINK_PERIOD_NS 1000000u
#define SLOTS_PUT_OFF  1000u
#define LIVE_ROUNDS    64u // that a program may be ahead

static bt_emu_stream stream;
static uint16_t live_ring[LIVE_ROUNDS * BT_SLOTS * BT_MAX_FINGERS];
static bool live;
static bt_emu_bus bus;
static uint32_t alarm_us;
static bool armed;
static bool held;
static bool ended;
static bool restart_due;
static bool link_due = true;
static uint64_t link_ns;
static uint32_t boot_id;
static uint32_t clock_us; // what it shows as the process begins; 0 after a reset, as on any board
static bool paced;
static int tape = -1; // kept open for the board after a reset: its name may be gone by then

static void die(const char *subject, const char *reason)
{
    fprintf(stderr, "biotac-sim: %s: %s\n", subject, reason);
    exit(2);
}

static void load_tape(const char *path)
{
    struct stat s;
    tape = restarted() != NULL ? os_inherited(restarted()->tape) : open(path, O_RDONLY | O_BINARY);
    if (tape < 0 || fstat(tape, &s) != 0 || s.st_size == 0) {
        die(path, tape < 0 ? strerror(errno) : "empty; expected a tape");
    }
    const size_t size = (size_t)s.st_size;
    uint8_t *bytes = malloc(size);
    size_t got = 0;
    long n = lseek(tape, 0, SEEK_SET) == 0 && bytes != NULL ? 1 : -1;
    while (n > 0 && got < size) {
        n = (long)read(tape, bytes + got, (unsigned)(size - got < 1u << 30 ? size - got : 1u << 30));
        got += n > 0 ? (size_t)n : 0;
    }
    const char *wrong = got == size ? bt_emu_stream_open(&stream, bytes, size) : strerror(errno);
    if (wrong != NULL) {
        die(path, wrong);
    }
}

static void feed_live(const char *fingers)
{
    const int count = atoi(fingers);
    if (count < 1 || count > BT_MAX_FINGERS) {
        die("--live", "expected 1 to 5 fingers");
    }
    live = true;
    bt_emu_stream_init(&stream, live_ring, LIVE_ROUNDS * BT_SLOTS * (unsigned)count);
    (void)bt_emu_stream_put(&stream, (uint8_t)count, NULL, 0); // so many fingers
    if (restarted() != NULL) {
        control_resume(&stream, restarted()->control);
        return;
    }
    const unsigned port = control_open(&stream);
    if (port == 0) {
        die("cannot listen on the loopback interface", strerror(errno));
    }
    printf("control %u\n", port);
}

// After a reset the world of the sensors goes on where it was, and whoever has the link open still has it.
static void resume(void)
{
    if (live) { // a round that was not computed is the first that the board reads
        stream.written = stream.at = stream.begins_at = restarted()->written;
    } else {
        stream.started = restarted()->started;
        stream.start_ns = restarted()->start_ns;
    }
    boot_id += restarted()->times;
    held = false;
    link_resume(restarted()->link, !paced);
    printf("restarted\n");
    (void)fflush(stdout);
}

static void restart(void)
{
    restart_state state = {
        .flash = flash_inherit(),
        .tape = tape >= 0 ? os_inherit(tape) : -1,
        .started = stream.started,
        .start_ns = stream.start_ns - clock_now_ns(), // a board's clock begins at 0
        .written = stream.written,
    };
    link_fds(state.link);
    control_fds(state.control);
    restart_process(&state);
    die("cannot restart", strerror(errno));
}

bt_port *port_init(int argc, char **argv)
{
    const char *tape_path = NULL;
    const char *live_fingers = NULL;
    double pace = 1.0;
    const char *serials = "";
    const char *flash_path = NULL;
    bool by_socket = false;
    os_begin();
    boot_id = (uint32_t)getpid();
    restart_init(argv);
    for (int k = 1; k < argc; k++) {
        if (strcmp(argv[k], "--hold") == 0) {
            held = true;
        } else if (strcmp(argv[k], "--socket") == 0) {
            by_socket = true;
        } else if (k + 1 == argc) {
            die(argv[k], "unknown option, or its value is missing");
        } else if (strcmp(argv[k], "--tape") == 0) {
            tape_path = argv[++k];
        } else if (strcmp(argv[k], "--live") == 0) {
            live_fingers = argv[++k];
        } else if (strcmp(argv[k], "--pace") == 0) {
            pace = atof(argv[++k]);
        } else if (strcmp(argv[k], "--boot-id") == 0) {
            boot_id = (uint32_t)strtoul(argv[++k], NULL, 0);
        } else if (strcmp(argv[k], "--clock-us") == 0) {
            clock_us = (uint32_t)strtoul(argv[++k], NULL, 0) * (restarted() == NULL);
        } else if (strcmp(argv[k], "--serials") == 0) {
            serials = argv[++k];
        } else if (strcmp(argv[k], "--flash") == 0) {
            flash_path = argv[++k];
        } else {
            die(argv[k], "unknown option");
        }
    }
    if ((tape_path == NULL) == (live_fingers == NULL)) {
        die("--tape", "expected either a tape, which `biotac sim` makes and passes, or --live");
    }
    if (tape_path != NULL) {
        load_tape(tape_path);
    } else {
        feed_live(live_fingers);
    }
    const char *wrong = restarted() != NULL ? flash_resume(restarted()->flash) : flash_open(flash_path);
    if (wrong != NULL) {
        die(flash_path, wrong);
    }
    bt_emu_bus_init(&bus, stream.fingers, serials, bt_emu_stream_by_clock, &stream);
    paced = pace > 0;
    clock_init(pace);
    if (restarted() != NULL) {
        resume();
        return ONLY_BOARD;
    }
    if (!link_open(by_socket, !paced)) {
        die(by_socket ? "cannot listen on the loopback interface" : "cannot open a pty", strerror(errno));
    }
    (void)fflush(stdout);
    return ONLY_BOARD;
}

// ---- time -------------------------------------------------------------------------------------

uint32_t port_now_us(bt_port *port)
{
    return (uint32_t)(clock_now_ns() / 1000) + clock_us;
}

void port_delay_us(bt_port *port, uint32_t us)
{
    clock_advance_ns((uint64_t)us * 1000);
}

void port_alarm_at(bt_port *port, uint32_t at_us)
{
    alarm_us = at_us;
    armed = true;
}

static uint64_t alarm_ns(void)
{
    uint64_t now_ns = clock_now_ns();
    int32_t ahead_us = (int32_t)(alarm_us - clock_us - (uint32_t)(now_ns / 1000));
    return ahead_us <= 0 ? now_ns : (now_ns / 1000 + (uint64_t)ahead_us) * 1000;
}

static void read_control(void)
{
    char text[64];
    const int n = os_read_stdin(text, sizeof text - 1);
    if (n < 0) {
        exit(0); // whoever started us is gone
    }
    text[n > 0 ? n : 0] = 0;
    if (strstr(text, "run") != NULL && held) {
        held = false;
        clock_rebase();
    }
    restart_due = restart_due || strstr(text, "restart") != NULL;
}

static void stand_still(void)
{
    static bool reported;
    link_due = true;
    link_flush();
    if (live && !held) {
        control_report();
    }
    if (ended && !reported) {
        reported = true;
        printf("end\n");
        (void)fflush(stdout);
    }
    int control[2];
    control_fds(control);
    link_wait(control[0], live && control[0] < 0 ? 2000 : -1); // who comes may not have said its token yet
    read_control();
    if (!restart_due) { // what comes now is for the board after it
        control_poll();
    }
}

void port_idle(bt_port *port)
{
    if (!armed) {
        return;
    }
    if (restart_due) {
        link_drain(); // with the reply to the command
        restart();
    }
    uint64_t next_ns = alarm_ns();
    const bool lacks = bt_emu_stream_lacks(&stream, next_ns);
    ended = ended || (lacks && !live);
    if (held || lacks) {
        stand_still();
        return;
    }
    if (clock_now_ns() - link_ns >= LINK_PERIOD_NS) {
        clock_catch_up(); // it says nothing ahead of its time, or the host would take its clock for another's
        link_ns = clock_now_ns();
        link_due = true;
        link_flush();
        read_control();
    }
    int64_t wait_us = clock_wait_us(next_ns);
    if (wait_us > 1000) { // shorter waits are caught up with: device time is exact either way
        link_wait(-1, wait_us);
    }
    if (next_ns > clock_now_ns()) {
        clock_advance_ns(next_ns - clock_now_ns());
    }
    armed = false;
    (void)bt_port_alarm();
}

// ---- SPI --------------------------------------------------------------------------------------

void port_spi_select(bt_port *port, uint8_t mask)
{
    bt_emu_bus_select(&bus, mask, clock_now_ns());
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    uint16_t miso = bt_emu_bus_transfer16(&bus, mosi, clock_now_ns());
    clock_advance_ns(TRANSFER_NS);
    return miso;
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    uint8_t miso = bt_emu_bus_transfer8(&bus, mosi, clock_now_ns());
    clock_advance_ns(TRANSFER_NS / 2);
    return miso;
}

// ---- link -------------------------------------------------------------------------------------

bool port_link_write(bt_port *port, unsigned link, const uint8_t *data, size_t bytes)
{
    return link == 0 && link_write(data, bytes);
}

size_t port_link_read(bt_port *port, unsigned link, uint8_t *data, size_t bytes)
{
    if (link != 0 || !link_due) {
        return 0; // a system call per half slot would cost more than all else
    }
    // What is read now was sent before now: a board that is late catches up first, unless it never does.
    static unsigned put_off;
    bool runs = paced && armed && !held && !ended;
    if (runs && clock_wait_us(alarm_ns()) == 0 && put_off < SLOTS_PUT_OFF) {
        put_off++;
        return 0;
    }
    put_off = 0;
    size_t n = link_read(data, bytes);
    if (runs && n > 0) {
        clock_follow(alarm_ns());
    }
    link_due = n > 0;
    return n;
}

uint32_t port_link_turns(bt_port *port, unsigned link)
{
    static uint32_t turns;
    if (link != 0) {
        return 0;
    }
    if (link_due && link_up() != (turns & 1)) {
        turns++;
    } else if (link_due && (turns & 1) == 0) {
        link_admit();
    }
    return turns;
}

void port_link_uart(bt_port *port, uint32_t bits_per_s)
{
}

bool port_link_touched(bt_port *port)
{
    return false;
}

bool port_reboot(bt_port *port, bool into_bootloader)
{
    restart_due = restart_due || !into_bootloader;
    return !into_bootloader; // a process has no loader
}

void port_measure(bt_port *port, bt_msg_board_facts *facts)
{
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}

// ---- identity ---------------------------------------------------------------------------------

port_identity port_identify(bt_port *port)
{
    return (port_identity){
        .hello = {.board = live ? BT_BOARD_POSIX_LIVE : BT_BOARD_POSIX_SIM,
                  .board_serial = "posix-sim",
                  .board_name = "simulator",
                  .boot_id = boot_id,
                  .image_crc32 = UINT32_MAX},
        .started_by = BT_FAULT_FLAG_STARTED,
    };
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
