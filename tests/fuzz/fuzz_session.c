// The byte-facing surface under hostile input: deframer, commands, rounds and ticks in any order.
// Input: steps of one byte that says what happens, then what that needs. Commands are framed here, with
// their CRC, because no fuzzer guesses one.
//
// What must hold: the session writes only whole frames that decode to a message of its own; a good
// command is answered exactly once; settings and calibrations stay in their ranges. The rest is the
// sanitizers'.
#include "input.h"

#include "session.h"

#include <string.h>

enum step { RAW, COMMAND, DAMAGED, ROUND, TICK, UNPLUG, LINK_ROOM, STEPS };

static struct {
    bt_deframer deframer;
    bool full; // the link takes nothing
    int messages;
} host;

static bool host_write(const uint8_t *data, size_t bytes)
{
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
    fuzz_message message = take_message(in, damage, encoded);
    uint8_t nothing = 0;
    bt_session_receive(session, &nothing, 1, now_us); // whatever came before ends here
    int before = host.messages;
    uint32_t dropped = session->messages_dropped;
    bt_session_receive(session, encoded, message.wire_bytes, now_us);
    int answers = host.messages - before + (int)(session->messages_dropped - dropped);
    if (!damage && answers != (message.id >= 0x80)) {
        FAIL("command %02x with %zu bytes is answered %d times", message.id, message.payload_bytes, answers);
    }
}

static void give_raw(bt_session *session, fuzz_input *in, uint32_t now_us)
{
    size_t bytes = take_u8(in);
    bytes = bytes < in->left ? bytes : in->left;
    bt_session_receive(session, in->data, bytes, now_us);
    in->data += bytes;
    in->left -= bytes;
}

static void give_round(bt_session *session, fuzz_input *in, uint32_t now_us)
{
    uint8_t mask = take_u8(in);
    uint16_t base = (uint16_t)(take_u32(in) & 0xFFFF);
    uint8_t spread = take_u8(in);
    uint8_t missed = take_u8(in); // every so many slots never come; 0: all come
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
    bt_session_round(session);
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

// What is in force was found good, and is what the finger works by.
static void check_calibrations(const bt_session *session)
{
    for (int f = 0; f < BT_MAX_FINGERS; f++) {
        bt_settings own = session->settings;
        const bt_calibration *its = &session->calibration[f];
        if (session->calibration_state[f] == BT_CALIBRATION_STATE_IN_FORCE
            && (!its->present || bt_calibration_apply(its, &own) != BT_ERROR_OK)) {
            FAIL("finger %d works by a calibration that cannot be", f);
        }
        if (session->kernel[f].poc_weights != bt_settings_get(&own, BT_SETTING_POC_WEIGHTS)
            || session->tare[f].contact_energy_count2
                   != (uint32_t)bt_settings_get(&own, BT_SETTING_CONTACT_ENERGY_COUNT2)) {
            FAIL("finger %d works by other values than are told", f);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t bytes)
{
    static bt_session session;
    static const bt_identity identity = {.board = BT_BOARD_PICO, .firmware_version = {1, 2, 3}};
    fuzz_input in = {data, bytes};
    uint32_t now_us = take_u32(&in);
    memset(&host, 0, sizeof host);
    bt_session_init(&session, &identity, host_write, now_us);
    while (in.left > 0) {
        uint8_t what = take_u8(&in);
        switch (what % STEPS) {
        case RAW:
            give_raw(&session, &in, now_us);
            break;
        case COMMAND:
        case DAMAGED:
            give_frame(&session, &in, what % STEPS == DAMAGED, now_us);
            break;
        case ROUND:
            give_round(&session, &in, now_us);
            break;
        case TICK:
            now_us += take_u32(&in);
            bt_session_tick(&session, now_us);
            break;
        case UNPLUG:
            bt_session_link_down(&session);
            break;
        default:
            host.full = take_u8(&in) & 1;
            break;
        }
        check_settings(&session);
        check_calibrations(&session);
    }
    return 0;
}
