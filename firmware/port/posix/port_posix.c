// The board that is a process: emulated sensors on an emulated bus, the link on a pty, device time
// that passes only as the firmware spends it.
//
//   biotac-sim --tape FILE [--pace X] [--hold] [--boot-id N] [--serials A,B,...] [--flash FILE]
//
// Writes "pty PATH" to stdout, and "end" once the tape is played and all of it handed over.
// --pace: device seconds per second, 0 for as fast as the host reads (nothing is then dropped).
// --flash: where saved settings and maps are kept; without it they are gone with the process.
// --hold: device time stands still until "run" comes on stdin. End of stdin ends the process.
#define _DEFAULT_SOURCE
#include "only_board.h"
#include "spi_word_by_word.h"

#include "bus.h"
#include "clock.h"
#include "flash.h"
#include "map/store.h"
#include "pty.h"
#include "tape.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#define TRANSFER_NS    (16u * 1000000000u / BT_SPI_HZ)
// How often the link is served, in device time: a USB board does so every millisecond.
#define LINK_PERIOD_NS 1000000u
#define SLOTS_PUT_OFF  1000u

static bt_tape tape;
static bt_emu_bus bus;
static uint32_t alarm_us;
static bool armed;
static bool held;
static bool ended;
static bool link_due = true;
static uint64_t link_ns;
static uint32_t boot_id;
static bool paced;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "biotac-sim: %s: %s\n", what, why);
    exit(2);
}

static void load_tape(const char *path)
{
    struct stat s;
    int fd = open(path, O_RDONLY);
    if (fd < 0 || fstat(fd, &s) != 0 || s.st_size == 0) {
        die(path, fd < 0 ? strerror(errno) : "empty; expected a tape");
    }
    void *bytes = mmap(NULL, (size_t)s.st_size, PROT_READ, MAP_PRIVATE, fd, 0);
    if (bytes == MAP_FAILED) {
        die(path, strerror(errno));
    }
    const char *wrong = bt_tape_open(&tape, bytes, (size_t)s.st_size);
    if (wrong != NULL) {
        die(path, wrong);
    }
    (void)close(fd);
}

bt_port *port_init(int argc, char **argv)
{
    const char *tape_path = NULL;
    double pace = 1.0;
    const char *serials = "";
    const char *flash_path = NULL;
    boot_id = (uint32_t)getpid();
    for (int k = 1; k < argc; k++) {
        if (strcmp(argv[k], "--hold") == 0) {
            held = true;
        } else if (k + 1 == argc) {
            die(argv[k], "unknown option, or its value is missing");
        } else if (strcmp(argv[k], "--tape") == 0) {
            tape_path = argv[++k];
        } else if (strcmp(argv[k], "--pace") == 0) {
            pace = atof(argv[++k]);
        } else if (strcmp(argv[k], "--boot-id") == 0) {
            boot_id = (uint32_t)strtoul(argv[++k], NULL, 0);
        } else if (strcmp(argv[k], "--serials") == 0) {
            serials = argv[++k];
        } else if (strcmp(argv[k], "--flash") == 0) {
            flash_path = argv[++k];
        } else {
            die(argv[k], "unknown option");
        }
    }
    if (tape_path == NULL) {
        die("--tape", "missing; expected a tape, which `biotac sim` makes and passes");
    }
    load_tape(tape_path);
    const char *wrong = flash_open(flash_path);
    if (wrong != NULL) {
        die(flash_path, wrong);
    }
    bt_emu_bus_init(&bus, tape.fingers, serials, bt_tape_count, &tape);
    (void)fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    paced = pace > 0;
    clock_init(pace);
    const char *path = pty_open(!paced);
    if (path == NULL) {
        die("cannot open a pty", strerror(errno));
    }
    printf("pty %s\n", path);
    (void)fflush(stdout);
    return ONLY_BOARD;
}

// ---- time -------------------------------------------------------------------------------------

uint32_t port_now_us(bt_port *port)
{
    return (uint32_t)(clock_now_ns() / 1000);
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
    int32_t ahead_us = (int32_t)(alarm_us - (uint32_t)(now_ns / 1000));
    return ahead_us <= 0 ? now_ns : (now_ns / 1000 + (uint64_t)ahead_us) * 1000;
}

static void read_control(void)
{
    char text[64];
    ssize_t n = read(STDIN_FILENO, text, sizeof text);
    if (n == 0) {
        exit(0); // whoever started us is gone
    }
    if (n > 0 && memchr(text, 'r', (size_t)n) != NULL && held) { // "run"
        held = false;
        clock_rebase();
    }
}

static void stand_still(void)
{
    static bool reported;
    link_due = true;
    pty_flush();
    if (ended && !reported) {
        reported = true;
        printf("end\n");
        (void)fflush(stdout);
    }
    pty_wait(STDIN_FILENO, -1);
    read_control();
}

void port_idle(bt_port *port)
{
    if (!armed) {
        return;
    }
    uint64_t next_ns = alarm_ns();
    ended = ended || bt_tape_over(&tape, next_ns);
    if (held || ended) {
        stand_still();
        return;
    }
    if (clock_now_ns() - link_ns >= LINK_PERIOD_NS) {
        clock_catch_up(); // it says nothing ahead of its time, or the host would take its clock for another's
        link_ns = clock_now_ns();
        link_due = true;
        pty_flush();
        read_control();
    }
    int64_t wait_us = clock_wait_us(next_ns);
    if (wait_us > 1000) { // shorter waits are caught up with: device time is exact either way
        pty_wait(-1, wait_us);
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
    return link == 0 && pty_write(data, bytes);
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
    size_t n = pty_read(data, bytes);
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
    if (link_due && pty_up() != (turns & 1)) {
        turns++;
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
    return false; // a process has no loader
}

port_facts port_measure(bt_port *port)
{
    return PORT_NO_FACTS;
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}

// ---- identity ---------------------------------------------------------------------------------

port_identity port_identify(bt_port *port)
{
    return (port_identity){
        .board = BT_BOARD_POSIX_SIM,
        .serial = "posix-sim",
        .boot_id = boot_id,
        .started_by = BT_FAULT_FLAG_STARTED,
        .image_crc32 = UINT32_MAX,
    };
}

port_abilities port_describe(bt_port *port)
{
    static _Alignas(4) uint8_t map_ram[BT_MAX_FINGERS][BT_MAP_MAX_BYTES];
    return (port_abilities){
        .name = "simulator",
        .fingers = BT_MAX_FINGERS,
        .erase_bytes = BT_FLASH_SECTOR_BYTES,
        .map_bytes = BT_MAP_MAX_BYTES,
        .map_ram = map_ram[0],
        .maps = flash_maps(),
    };
}
