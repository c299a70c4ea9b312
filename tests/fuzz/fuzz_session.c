// The byte-facing surface under hostile input: deframer, commands, rounds and ticks in any order.
// Input: steps of one byte that names the step, then the step's data. Commands are framed here, with
// their CRC, because no fuzzer guesses one; and so are whole uploads of maps, in an order from the input.
//
// Invariants: the session writes only whole frames that decode to a message of the board; a good
// command is answered exactly once; settings and calibrations stay in their ranges; a map that a finger has
// is one that the firmware takes, byte for byte as it was sent, and no command erases two sectors. The rest
// is the sanitizers'.
#include "input.h"

#include "fake_board.h"
#include "talk/host_link.h"
#include "talk/rounds.h"
#include "wire/crc32.h"

#include <string.h>

enum step { RAW, COMMAND, DAMAGED, ROUND, TICK, UNPLUG, LINK_ROOM, UPLOAD, STEPS };

static struct {
    bt_deframer deframer;
    bool full; // the link takes nothing
    int messages;
} host;

static bool host_write(void *context, unsigned link, const uint8_t *data, size_t bytes)
{
    (void)link;
    (void)context;
    if (host.full) {
        return false;
    }
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&host.deframer, data[k]);
        bool last = k + 1 == bytes;
        if (outcome != (last ? BT_DEFRAMED_GOOD : BT_DEFRAMED_NOTHING)) {
            FAIL("byte %zu of %zu written gives %d", k, bytes, (int)outcome);
        }
    }
    if (host.deframer.id >= 0x80 || bt_wire_payload_bytes(host.deframer.id) != host.deframer.payload_bytes) {
        FAIL("the board sends id %d with %d bytes", host.deframer.id, host.deframer.payload_bytes);
    }
    host.messages++;
    return true;
}

static void give_frame(bt_session *session, fuzz_input *in, bool damage, uint32_t now_us)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    fuzz_message message = next_message(in, damage, encoded);
    uint8_t nothing = 0;
    bt_session_receive(session, 0, &nothing, 1, now_us); // whatever came before ends here
    int before = host.messages, erases_before = erases;
    uint32_t dropped = session->status.messages_dropped;
    bt_session_receive(session, 0, encoded, message.wire_bytes, now_us);
    int answers = host.messages - before + (int)(session->status.messages_dropped - dropped);
    if (!damage && answers != (message.id >= 0x80)) {
        FAIL("command %02x with %zu bytes is answered %d times", message.id, message.payload_bytes, answers);
    }
    if (erases - erases_before > 1) {
        FAIL("command %02x erases %d sectors", message.id, erases - erases_before);
    }
}

static void give(bt_session *session, uint8_t id, const uint8_t *payload, uint32_t now_us)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    size_t bytes = bt_frame_encode(id, payload, (size_t)bt_wire_payload_bytes(id), encoded);
    bt_session_receive(session, 0, encoded, bytes, now_us);
}

// A map of a few blocks with coefficients of the input's, calibration parts in any order, some of them not at
// all. The input may spoil a byte of calibration own map too.
static void give_upload(bt_session *session, fuzz_input *in, uint32_t now_us)
{
    static const uint8_t coefficients[BT_MAP_KINDS] = BT_MAP_KIND_COEFFICIENTS;
    static uint8_t blob[BT_MAP_MAX_BYTES];
    uint8_t payload[BT_FRAME_MAX_BYTES];
    uint8_t finger = (uint8_t)(next_u8(in) % (BT_MAX_FINGERS + 1));
    size_t blocks = 1 + next_u8(in) % 3, at = BT_MAP_HEADER_BYTES, count = 0;
    memset(blob, 0, sizeof blob);
    blob[0] = BT_MAP_VERSION;
    blob[1] = next_u8(in) & 1 ? 3 : 6;
    blob[2] = (uint8_t)blocks;
    blob[4] = next_u8(in) & 1; // a serial number that no sensor has, or none
    for (size_t k = 0; k < blocks; k++, at += BT_MAP_BLOCK_BYTES) {
        blob[at] = (uint8_t)(next_u8(in) % BT_MAP_KINDS);
        blob[at + 1] = (uint8_t)k;
        for (size_t a = 0; a < blob[1]; a++) {
            blob[at + 2 + a] = (uint8_t)(1 + next_u8(in) % BT_MAP_EXPONENT_MAX);
        }
        count += (size_t)coefficients[blob[at]] * blob[1];
    }
    for (size_t k = 0; k < count && at + 2 <= sizeof blob; k++, at += 2) {
        blob[at] = next_u8(in);
    }
    if (next_u8(in) & 1) {
        blob[next_u32(in) % at] ^= next_u8(in);
    }
    bt_msg_begin_map begin = {1, finger, (uint16_t)at, bt_crc32(blob, at)};
    bt_msg_begin_map_pack(&begin, payload);
    give(session, BT_BEGIN_MAP_ID, payload, now_us);
    size_t parts = (at + BT_MAP_PART_BYTES - 1) / BT_MAP_PART_BYTES;
    size_t step = 1 + next_u8(in) % 7, written = parts + next_u8(in) % 4;
    for (size_t k = 0; k + 1 < written; k++) {
        size_t offset = k * step % parts * BT_MAP_PART_BYTES;
        bt_msg_write_map write = {.req_id = 2, .finger = finger, .offset = (uint16_t)offset};
        size_t left = at - offset;
        memcpy(write.data, blob + offset, left < BT_MAP_PART_BYTES ? left : BT_MAP_PART_BYTES);
        bt_msg_write_map_pack(&write, payload);
        give(session, BT_WRITE_MAP_ID, payload, now_us);
    }
    bt_msg_end_map end = {3, finger, begin.crc32};
    bt_msg_end_map_pack(&end, payload);
    give(session, BT_END_MAP_ID, payload, now_us);
}

static void give_raw(bt_session *session, fuzz_input *in, uint32_t now_us)
{
    size_t bytes = next_u8(in);
    bytes = bytes < in->left ? bytes : in->left;
    bt_session_receive(session, 0, in->data, bytes, now_us);
    in->data += bytes;
    in->left -= bytes;
}

static void give_round(bt_session *session, fuzz_input *in, uint32_t now_us)
{
    uint8_t mask = next_u8(in);
    uint16_t base = (uint16_t)(next_u32(in) & 0xFFFF);
    uint8_t spread = next_u8(in);
    uint8_t missed = next_u8(in); // every so many slots never come; 0: all come
    bt_session_begin(session, now_us);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        uint16_t counts[BT_MAX_FINGERS];
        for (uint8_t f = 0; f < BT_MAX_FINGERS; f++) {
            uint16_t count = (uint16_t)((base + spread * slot) % (BT_FULL_SCALE_COUNT + 1));
            counts[f] = mask >> f & 1 ? count : BT_INVALID_COUNT;
        }
        if (missed == 0 || slot % missed != 0) {
            bt_session_slot(session, slot, counts, now_us);
        }
    }
    bt_session_end_round(session);
}

static void check_settings(const bt_session *session)
{
    for (int k = 0; k < BT_SETTINGS; k++) {
        const bt_setting_spec *spec = &bt_setting_specs[k];
        int32_t value = bt_settings_get(&session->settings, spec->id);
        if (value < spec->min || value > spec->max) {
            FAIL("setting %d is %d", spec->id, value);
        }
    }
}

// The map in force was found good, and the finger works by it.
static void check_calibrations(const bt_session *session)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_settings own = session->settings;
        const bt_calibration *calibration = &session->calibration[f];
        if (session->calibration_state[f] == BT_CALIBRATION_STATE_IN_FORCE
            && (!calibration->present || bt_calibration_apply(calibration, &own) != BT_ERROR_OK)) {
            FAIL("finger %d uses an invalid calibration", f);
        }
        if (session->solve[f].poc_weights != bt_settings_get(&own, BT_SETTING_POC_WEIGHTS)
            || session->tare[f].contact_energy_count2
                   != (uint32_t)bt_settings_get(&own, BT_SETTING_CONTACT_ENERGY_COUNT2)) {
            FAIL("finger %d uses other values than it reports", f);
        }
    }
}

static void check_maps(const bt_session *session)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        const bt_finger_map *finger_map = &session->map[f];
        const uint8_t *blob = SLOTS + finger_map->place.slot * (size_t)BT_MAP_SLOT_BYTES;
        bt_map map;
        if (finger_map->place.bytes == 0) {
            if (session->map_state[f] != BT_CALIBRATION_STATE_NONE) {
                FAIL("finger %d is reported to have a map it does not have", f);
            }
        } else if (bt_crc32(blob, finger_map->place.bytes) != finger_map->place.crc32
                   || bt_map_open(&map, blob, finger_map->place.bytes) != BT_ERROR_OK) {
            FAIL("finger %d has an invalid map", f);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static bt_session session;
    static const bt_msg_hello hello = {
        .board = BT_BOARD_PICO, .fingers = BT_MAX_FINGERS, .slot_hz = BT_SLOT_HZ};
    fuzz_input in = {data, bytes};
    uint32_t now_us = next_u32(&in);
    memset(&host, 0, sizeof host);
    bt_session_init(&session, &hello, host_write, NULL, now_us);
    session.board = keeps;
    while (in.left > 0) {
        uint8_t step = next_u8(&in);
        switch (step % STEPS) {
        case RAW:
            give_raw(&session, &in, now_us);
            break;
        case COMMAND:
        case DAMAGED:
            give_frame(&session, &in, step % STEPS == DAMAGED, now_us);
            break;
        case ROUND:
            give_round(&session, &in, now_us);
            break;
        case TICK:
            now_us += next_u32(&in);
            bt_session_tick(&session, now_us);
            break;
        case UNPLUG:
            bt_session_link_down(&session, 0);
            break;
        case UPLOAD:
            give_upload(&session, &in, now_us);
            break;
        default:
            host.full = next_u8(&in) & 1;
            break;
        }
        check_settings(&session);
        check_calibrations(&session);
        check_maps(&session);
    }
    return 0;
}
