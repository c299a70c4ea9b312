// The emulator image's replacements for the chip's bus, flash and identity: emulated sensors that
// play a tape, flash in RAM that a file outlives, and a rig's commands. All by ARM semihosting, so that it
// works on any Cortex-M that QEMU has; interrupts, alarm, clock, sleep and link stay the port's own.
// tools/qemu_gateway starts such an image, with this command line
//   TAPE BOOT_ID GO SERIALS FLASH
// with - for none. Device time stands still from the first alarm on until a file GO is there, and again once
// the tape is over. Says "ready", "go" and "end".
#include "only_board.h"
#include "spi_word_by_word.h"

#include "bus.h"
#include "keep/storage.h"
#include "pins.h"
#include "stream.h"
#include "wire/messages_gen.h"
#include "wire/sensor_gen.h"

#include "semihosting.h"

#include <string.h>

#define ROUND_BYTES  (2 * BT_SLOTS * BT_MAX_FINGERS)
#define KEPT_BYTES   32768u // two sectors of up to 16 KiB
#define LOOKS_FOR_GO 200u   // turns of the main loop between two looks
#define HANDED_OVER  5000u  // turns in which the link sends the rest
#define LATE_US      20u    // an alarm that comes later than this is late; before, it is QEMU's translating
#define TRANSFER_NS  (16u * 1000000000u / BT_SPI_HZ)

enum mode { READ = 1, UPDATE = 3 }; // "rb", "r+b"

static char line[600];
static const char *tape_name, *go_name, *serials, *flash_name;
static uint32_t boot_id, tape_file;
static bool read_line, ready, begun, held, over;
static volatile bool stands;
static volatile uint32_t stands_at_us, behind_us, alarm_us;
static uint32_t turns;
static volatile bool in_alarm;
static uint64_t slot_ns;

static bt_emu_bus bus;
static bt_emu_stream stream;
static _Alignas(uint16_t) uint8_t window[ROUND_BYTES];
static uint32_t in_window = UINT32_MAX;
static uint8_t kept[KEPT_BYTES];

// ---- semihosting ---------------------------------------------------------------------------------------

static uint32_t call(uint32_t operation, uint32_t a, uint32_t b, uint32_t c)
{
    const volatile uint32_t arguments[3] = {a, b, c};
    return semihost(operation, (uintptr_t)arguments);
}

static uint32_t open_file(const char *name, enum mode mode)
{
    return call(SYS_OPEN, (uint32_t)(uintptr_t)name, mode, (uint32_t)strlen(name));
}

static void read_at(uint32_t file, uint32_t at, uint8_t *to, uint32_t bytes)
{
    (void)call(SYS_SEEK, file, at, 0);
    (void)call(SYS_READ, file, (uint32_t)(uintptr_t)to, bytes);
}

static void stop(const char *why)
{
    semihost_write("semihosted: ");
    semihost_write(why);
    semihost_write("\n");
    (void)semihost(SYS_EXIT, EXIT_FAULT);
}

static const char *word(char **at)
{
    char *begin = *at;
    *at += strcspn(begin, " ");
    if (**at != 0) {
        *(*at)++ = 0;
    }
    return begin;
}

// Before any other call here: the first is port_init's own select of no sensor.
static void read_command_line(void)
{
    if (read_line) {
        return;
    }
    read_line = true;
    char *at = line;
    (void)call(SYS_GET_CMDLINE, (uint32_t)(uintptr_t)line, sizeof line, 0);
    (void)word(&at); // QEMU's first is the image's name
    tape_name = word(&at);
    for (const char *digit = word(&at); *digit != 0; digit++) {
        boot_id = 10 * boot_id + (uint32_t)(*digit - '0');
    }
    go_name = word(&at);
    serials = word(&at);
    flash_name = word(&at);
    held = strcmp(go_name, "-") != 0;
    memset(kept, 0xFF, sizeof kept);
    if (strcmp(flash_name, "-") != 0) {
        read_at(open_file(flash_name, READ), 0, kept, sizeof kept);
    }
    tape_file = open_file(tape_name, READ);
    read_at(tape_file, 0, window, BT_EMU_TAPE_HEADER_BYTES);
    const char *wrong = bt_emu_stream_open(&stream, window, call(SYS_FLEN, tape_file, 0, 0));
    if (wrong != NULL) {
        stop(wrong);
    }
    stream.tape = (const uint16_t *)(const void *)window; // a round at a time
    stream.slots = BT_SLOTS;
}

// ---- time: the port's, but for where it stands still ------------------------------------------------------

uint32_t __real_clock_us(void);
uint32_t __wrap_clock_us(void);
void __real_port_alarm_at(bt_port *port, uint32_t at_us);
void __wrap_port_alarm_at(bt_port *port, uint32_t at_us);
void __real_port_idle(bt_port *port);
void __wrap_port_idle(bt_port *port);
void __real_port_delay_us(bt_port *port, uint32_t us);
void __wrap_port_delay_us(bt_port *port, uint32_t us);
bool __real_bt_port_alarm(void);
bool __wrap_bt_port_alarm(void);
port_identity __wrap_port_identify(bt_port *port);

uint32_t __wrap_clock_us(void)
{
    if (in_alarm) {
        return (uint32_t)(slot_ns / 1000);
    }
    if (!begun) { // whole ms until the first alarm is set, or every run would begin some us apart
        return __real_clock_us() / 1000 * 1000;
    }
    return stands ? stands_at_us : __real_clock_us() - behind_us;
}

static uint64_t ns_of(uint32_t us)
{
    static uint64_t last_us;
    last_us += (uint64_t)(int64_t)(int32_t)(us - (uint32_t)last_us);
    return last_us * 1000;
}

static uint64_t now_ns(void)
{
    return in_alarm ? slot_ns : ns_of(__wrap_clock_us());
}

// QEMU counts instructions, which is no clock: in the alarm's interrupt time is the alarm's own, and
// passes with words and waits, as on the simulated board. One that really is late stays late.
bool __wrap_bt_port_alarm(void)
{
    const uint32_t now_us = __wrap_clock_us();
    slot_ns = ns_of(now_us - alarm_us < LATE_US ? alarm_us : now_us);
    in_alarm = true;
    const bool work = __real_bt_port_alarm();
    in_alarm = false;
    return work;
}

void __wrap_port_delay_us(bt_port *port, uint32_t us)
{
    if (in_alarm) {
        slot_ns += (uint64_t)us * 1000;
    } else {
        __real_port_delay_us(port, us);
    }
}

// While time stands still no alarm is set.
void __wrap_port_alarm_at(bt_port *port, uint32_t at_us)
{
    const uint32_t now_us = __wrap_clock_us();
    const int32_t ahead_us = (int32_t)(at_us - now_us);
    if (!begun) {
        behind_us = __real_clock_us() - now_us;
        begun = true;
    }
    over = over || bt_emu_stream_lacks(&stream, now_ns() + (uint64_t)(ahead_us > 0 ? ahead_us : 0) * 1000);
    if ((held || over) && !stands) {
        stands_at_us = now_us;
        stands = true;
    }
    alarm_us = at_us;
    if (!stands) {
        const bool was_in_alarm = in_alarm;
        in_alarm = false; // the chip's timer counts on
        __real_port_alarm_at(port, at_us);
        in_alarm = was_in_alarm;
    }
}

void __wrap_port_idle(bt_port *port)
{
    if (!ready) { // the link hears by now
        ready = true;
        semihost_write("ready\n");
    }
    turns++;
    if (held && turns % LOOKS_FOR_GO == 0 && open_file(go_name, READ) != UINT32_MAX) {
        held = false;
        behind_us = __real_clock_us() - stands_at_us;
        stands = false;
        __real_port_alarm_at(port, alarm_us);
        semihost_write("go\n");
    }
    if (!over) {
        turns = held ? turns : 0;
    } else if (turns == HANDED_OVER) {
        semihost_write("end\n");
    }
    __real_port_idle(port);
}

// ---- the sensors ------------------------------------------------------------------------------------------

static uint16_t count(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    const uint32_t round = bt_emu_stream_round(&stream, t_ns);
    if (round != in_window) {
        const uint32_t bytes = stream.fingers * BT_SLOTS * 2;
        read_at(tape_file, BT_EMU_TAPE_HEADER_BYTES + round * bytes, window, bytes);
        in_window = round;
    }
    return bt_emu_stream_by_clock(context, finger, channel, t_ns);
}

void port_spi_select(bt_port *port, uint8_t mask)
{
    bt_emu_bus_select(&bus, mask, now_ns());
}

uint16_t port_spi_transfer16(bt_port *port, uint16_t mosi)
{
    const uint16_t miso = bt_emu_bus_transfer16(&bus, mosi, now_ns());
    slot_ns += TRANSFER_NS;
    return miso;
}

uint8_t port_spi_transfer8(bt_port *port, uint8_t mosi)
{
    const uint8_t miso = bt_emu_bus_transfer8(&bus, mosi, now_ns());
    slot_ns += TRANSFER_NS / 2;
    return miso;
}

void port_spi_rate(bt_port *port, uint32_t khz)
{
}

uint32_t spi_khz(void);
uint32_t spi_khz(void)
{
    return BT_SPI_HZ / 1000;
}

void spi_start(void);
void spi_start(void)
{
    read_command_line();
    bt_emu_bus_init(&bus, stream.fingers, serials[0] == '-' ? "" : serials, count, &stream);
}

// ---- flash, as NOR flash is -------------------------------------------------------------------------------

uint32_t flash_erase_us;

static void outlive(uint32_t at, uint32_t bytes)
{
    if (strcmp(flash_name, "-") == 0) {
        return;
    }
    const uint32_t file = open_file(flash_name, UPDATE);
    (void)call(SYS_SEEK, file, at, 0);
    (void)call(SYS_WRITE, file, (uint32_t)(uintptr_t)(kept + at), bytes);
    (void)call(SYS_CLOSE, file, 0, 0);
}

bool port_flash_erase(bt_port *port, uint32_t sector_offset)
{
    const uint32_t bytes = port_describe(port).erase_bytes;
    memset(kept + sector_offset, 0xFF, bytes);
    outlive(sector_offset, bytes);
    return true;
}

bool port_flash_program(bt_port *port, uint32_t page_offset, const uint8_t *page)
{
    for (uint32_t k = 0; k < BT_FLASH_PAGE_BYTES; k++) {
        kept[page_offset + k] &= page[k];
    }
    outlive(page_offset, BT_FLASH_PAGE_BYTES);
    return true;
}

void port_flash_read(bt_port *port, uint32_t offset, uint8_t *data, size_t bytes)
{
    memcpy(data, kept + offset, bytes);
}

// ---- identity: an emulator has no chip number, and no image where the note expects it ---------------------

port_identity __wrap_port_identify(bt_port *port)
{
    return (port_identity){
        .hello = {.board = IMAGE_BOARD,
                  .board_serial = "emulated",
                  .board_name = IMAGE_BOARD_NAME,
                  .boot_id = boot_id,
                  .image_crc32 = UINT32_MAX},
        .started_by = BT_FAULT_FLAG_STARTED,
    };
}
