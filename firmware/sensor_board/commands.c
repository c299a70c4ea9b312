#include "commands.h"

#include "answers.h"
#include "feed.h"
#include "loop.h"
#include "only_board.h"
#include "pins.h"
#include "version.h"
#include "wire/framing.h"

#include <string.h>

static bt_emu_stream *stream;
static bt_deframer deframer;
static uint8_t plugged;

void commands_start(bt_emu_stream *its)
{
    stream = its;
    plugged = (1u << BT_MAX_FINGERS) - 1;
    bt_deframer_reset(&deframer);
}

// A frame that there is no room for is lost, as with the gateway: the host asks again.
static void send(uint8_t id, const uint8_t *payload)
{
    uint8_t frame[BT_ENCODED_MAX_BYTES];
    (void)port_link_write(ONLY_BOARD, 0, frame,
                          bt_frame_encode(id, payload, (size_t)bt_wire_payload_bytes(id), frame));
}

static void reply(uint8_t req_id, uint8_t command, uint8_t error)
{
    uint8_t payload[BT_REPLY_BYTES];
    bt_msg_reply_pack(&(bt_msg_reply){req_id, command, error}, payload);
    send(BT_REPLY_ID, payload);
}

static void send_status(uint8_t req_id)
{
    bt_answer_counts counts = answers_counts();
    bt_msg_emu_status status = bt_emu_status_of(stream);
    status.req_id = req_id;
    status.fingers = plugged;
    status.elapsed_us = counts.latest_us - counts.first_us;
    status.words = counts.words;
    status.words_late = counts.late;
    status.slowest_us = (uint16_t)counts.slowest_us;
    status.loop_slots = loop_slots();
    uint8_t payload[BT_EMU_STATUS_BYTES];
    bt_msg_emu_status_pack(&status, payload);
    send(BT_EMU_STATUS_ID, payload);
}

static void send_hello(const bt_msg_hello_request *request)
{
    const port_identity identity = port_identify(ONLY_BOARD);
    bt_msg_hello hello = {
        .req_id = request->req_id,
        .nonce = request->nonce,
        .wire_major = BT_WIRE_MAJOR,
        .wire_minor = BT_WIRE_MINOR,
        .schema_hash = BT_SCHEMA_HASH,
        .firmware_major = BT_VERSION_MAJOR,
        .firmware_minor = BT_VERSION_MINOR,
        .firmware_patch = BT_VERSION_PATCH,
        .board = identity.board,
        .fingers = BT_MAX_FINGERS,
        .board_name = IMAGE_BOARD_NAME,
        .boot_id = identity.boot_id,
        .slot_hz = BT_SLOT_HZ,
        .fingers_present = plugged,
        .image_crc32 = identity.image_crc32,
    };
    _Static_assert(sizeof hello.board_serial == PORT_SERIAL_BYTES, "the board's serial number is sent whole");
    memcpy(hello.board_serial, identity.serial, sizeof hello.board_serial);
    uint8_t payload[BT_HELLO_BYTES];
    bt_msg_hello_pack(&hello, payload);
    send(BT_HELLO_ID, payload);
}

static uint8_t plug(const bt_msg_emu_plug *command)
{
    if (command->finger >= BT_MAX_FINGERS) {
        return BT_ERROR_NO_SUCH_FINGER;
    }
    char serial[sizeof command->serial + 1] = "";
    memcpy(serial, command->serial, sizeof command->serial);
    if (command->finger == 0) {
        answers_forget();
    }
    uint8_t bit = (uint8_t)(1u << command->finger);
    plugged = (uint8_t)(command->present ? plugged | bit : plugged & ~bit);
    answers_plug(command->finger, command->present, serial);
    return BT_ERROR_OK;
}

static union {
    bt_msg_emu_plug plug;
    bt_msg_emu_keep keep;
    bt_msg_hello_request hello;
    bt_msg_reboot_bootloader reboot;
} got;

static void obey(uint8_t id, const uint8_t *payload)
{
    uint8_t req_id = payload[0]; // every command begins with it
    uint8_t error = BT_ERROR_OK;
    switch (id) {
    case BT_HELLO_REQUEST_ID:
        bt_msg_hello_request_unpack(&got.hello, payload);
        send_hello(&got.hello);
        return;
    case BT_REBOOT_BOOTLOADER_ID:
        bt_msg_reboot_bootloader_unpack(&got.reboot, payload);
        error = got.reboot.magic != BT_BOOTLOADER_MAGIC ? BT_ERROR_OUT_OF_RANGE
                : port_reboot(ONLY_BOARD, true)         ? BT_ERROR_OK
                                                        : BT_ERROR_NOT_HERE;
        reply(req_id, id, error);
        return;
    case BT_EMU_PLUG_ID:
        bt_msg_emu_plug_unpack(&got.plug, payload);
        error = plug(&got.plug);
        break;
    case BT_EMU_KEEP_ID:
        bt_msg_emu_keep_unpack(&got.keep, payload);
        error = loop_keep(stream, got.keep.slots, got.keep.crc32);
        break;
    default:
        error = bt_emu_obey(stream, id, payload);
        break;
    }
    if (id == BT_EMU_SET_FAULT_ID) {
        answers_renew();
    }
    if (error == BT_ERROR_OK) {
        send_status(req_id);
    } else {
        reply(req_id, id, error);
    }
}

void commands_poll(void)
{
    uint8_t bytes[64];
    size_t n;
    if (port_link_touched(ONLY_BOARD)) {
        (void)port_reboot(ONLY_BOARD, true);
    }
    while ((n = port_link_read(ONLY_BOARD, 0, bytes, sizeof bytes)) > 0) {
        for (size_t k = 0; k < n; k++) {
            if (bt_deframer_push(&deframer, bytes[k]) == BT_DEFRAMED_GOOD && deframer.payload_bytes > 0) {
                obey(deframer.id, deframer.buffer + 1);
            }
        }
    }
}
