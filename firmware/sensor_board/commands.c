#include "commands.h"

#include "answers.h"
#include "feed.h"
#include "loop.h"
#include "only_board.h"
#include "version.h"

#include <string.h>

static bt_msg_hello hello;
static bt_emu_feed feed;
static uint8_t plugged;

// A frame without room is lost, as with the gateway: the host asks again.
static void send_frame(const uint8_t *frame, size_t bytes)
{
    (void)port_link_write(ONLY_BOARD, 0, frame, bytes);
}

static void fill_status(bt_msg_emu_status *status)
{
    bt_answer_counts counts = answers_counts();
    status->fingers = plugged;
    status->elapsed_us = counts.latest_us - counts.first_us;
    status->words = counts.words;
    status->words_late = counts.late;
    status->slowest_us = (uint16_t)counts.slowest_us;
    status->loop_slots = loop_slots();
    if (feed.spoilt) {
        feed.spoilt = false;
        answers_renew();
    }
}

static uint8_t plug(const uint8_t *payload)
{
    static bt_msg_emu_plug command;
    bt_msg_emu_plug_unpack(&command, payload);
    if (command.finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    char serial[sizeof command.serial + 1] = "";
    memcpy(serial, command.serial, sizeof command.serial);
    if (command.finger == 0) {
        answers_forget();
    }
    uint8_t bit = (uint8_t)(1u << command.finger);
    plugged = (uint8_t)(command.present ? plugged | bit : plugged & ~bit);
    hello.fingers_present = plugged;
    answers_plug(command.finger, command.present, serial);
    return BT_ERROR_OK;
}

static uint8_t command_besides(uint8_t id, const uint8_t *payload)
{
    bt_msg_reboot_bootloader reboot;
    bt_msg_emu_keep keep;
    switch (id) {
    case BT_REBOOT_BOOTLOADER_ID:
        bt_msg_reboot_bootloader_unpack(&reboot, payload);
        return reboot.magic != BT_BOOTLOADER_MAGIC ? BT_ERROR_OUT_OF_RANGE
               : port_reboot(ONLY_BOARD, true)     ? BT_ERROR_OK
                                                   : BT_ERROR_NOT_HERE;
    case BT_EMU_PLUG_ID:
        return plug(payload);
    case BT_EMU_KEEP_ID:
        bt_msg_emu_keep_unpack(&keep, payload);
        return loop_store(feed.stream, keep.slots, keep.crc32);
    default:
        return BT_ERROR_UNKNOWN_COMMAND;
    }
}

void commands_start(bt_emu_stream *stream)
{
    plugged = (1u << BT_MAX_FINGERS) - 1;
    hello = port_identify(ONLY_BOARD).hello;
    hello.firmware_major = BT_VERSION_MAJOR;
    hello.firmware_minor = BT_VERSION_MINOR;
    hello.firmware_patch = BT_VERSION_PATCH;
    hello.fingers = BT_MAX_FINGERS;
    hello.slot_hz = BT_SLOT_HZ;
    hello.fingers_present = plugged;
    feed = (bt_emu_feed){
        .stream = stream, .hello = &hello, .send = send_frame, .obey = command_besides, .fill = fill_status};
    bt_emu_feed_begin(&feed);
}

void commands_poll(void)
{
    uint8_t bytes[64];
    size_t n;
    if (port_link_touched(ONLY_BOARD)) {
        (void)port_reboot(ONLY_BOARD, true);
    }
    while ((n = port_link_read(ONLY_BOARD, 0, bytes, sizeof bytes)) > 0) {
        bt_emu_feed_receive(&feed, bytes, n);
    }
}
