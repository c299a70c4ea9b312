// The whole firmware over the fake port, with sensors that give every place a different count, and a host
// that keeps all it receives. Include once per executable: the header holds the state.
#ifndef BIOTAC_TEST_RIG_H
#define BIOTAC_TEST_RIG_H

#include "support.h"

#include "fake_port.h"
#include "gateway.h"
#include "port.h"
#include "wire/framing.h"

#define ROUND_NS   10000000ull
#define MAX_ROUNDS 600
#define START_NS   1234567ull

static bt_gateway gateway;

bool bt_port_alarm(void)
{
    return bt_gateway_alarm(&gateway);
}

// ---- sensors -------------------------------------------------------------------------------------

static struct {
    uint8_t finger;
    uint16_t fault; // kind of the finger's samples
    bool absent;
    uint32_t period; // in samples; 0: never
} trouble;

static uint64_t first_command_ns;

static inline uint16_t source(void *context, uint8_t finger, uint8_t channel, uint64_t t_ns)
{
    (void)context;
    if (channel == BT_EMU_LINE) {
        return finger == trouble.finger && trouble.period == 1 ? trouble.fault : 0;
    }
    if (first_command_ns == 0) {
        first_command_ns = t_ns;
    }
    // Rounded to slots: some ns of latency must not change the data.
    uint64_t slot = ((t_ns - first_command_ns) * BT_SLOT_HZ + 500000000ull) / 1000000000ull;
    uint64_t mixed = (slot / BT_SLOTS * 64 + channel + 1u) * 0x9E3779B97F4A7C15ull;
    mixed += (uint64_t)finger * 0xC2B2AE3D27D4EB4Full;
    if (finger == trouble.finger && trouble.period != 0 && (mixed >> 20) % trouble.period == 0) {
        return trouble.fault;
    }
    return (uint16_t)(1500u + 300u * finger + 10u * channel + (mixed >> 40) % 8);
}

// ---- data received by the host --------------------------------------------------------------------

static struct {
    bt_msg_frame frame[BT_MAX_FINGERS][MAX_ROUNDS];
    int frames[BT_MAX_FINGERS];
    bt_msg_pac pac[BT_MAX_FINGERS][MAX_ROUNDS];
    uint8_t id;    // of the latest message
    uint8_t error; // that the latest REPLY tells
    bt_deframer deframer;
} host;

static inline bool host_accept(const uint8_t *data, size_t bytes)
{
    for (size_t k = 0; k < bytes; k++) {
        enum bt_deframed outcome = bt_deframer_push(&host.deframer, data[k]);
        assert_true(outcome == BT_DEFRAMED_NOTHING || outcome == BT_DEFRAMED_GOOD);
        if (outcome != BT_DEFRAMED_GOOD) {
            continue;
        }
        const uint8_t *payload = host.deframer.buffer + 1;
        uint8_t finger = payload[6];
        host.id = host.deframer.id;
        if (host.id == BT_REPLY_ID) {
            host.error = payload[2];
        } else if (host.id == BT_FRAME_ID) {
            assert_true(host.frames[finger] < MAX_ROUNDS);
            bt_msg_frame_unpack(&host.frame[finger][host.frames[finger]++], payload);
        } else if (host.id == BT_PAC_ID) {
            bt_msg_pac_unpack(&host.pac[finger][host.frames[finger] - 1], payload);
        }
    }
    return true;
}

#define NO_REPLY 0xFF

// Returns how many bytes that are.
static inline size_t send(uint8_t id, const void *payload)
{
    uint8_t encoded[BT_ENCODED_MAX_BYTES];
    size_t bytes = bt_frame_encode(id, payload, (size_t)bt_wire_payload_bytes(id), encoded);
    fake_host_sends(encoded, bytes);
    host.error = NO_REPLY;
    return bytes;
}

// The error that REPLY tells, while no time passes.
static inline uint8_t ask(uint8_t id, const void *payload)
{
    size_t bytes = send(id, payload);
    for (size_t polled = 0; polled < bytes; polled += 64) { // the gateway takes so many in a turn
        bt_gateway_poll(&gateway);
    }
    return host.error;
}

// Flash stays as it is, all else is lost.
static inline void power_cycle(void)
{
    memset(&gateway, 0, sizeof gateway);
    bt_gateway_init(&gateway, ONLY_BOARD);
}

static uint64_t t0_ns; // of the first sample command

static inline void boot(uint64_t start_ns)
{
    uint8_t payload[BT_START_BYTES];
    bt_msg_start msg = {1, BT_STREAM_FLAG_FRAMES | BT_STREAM_FLAG_PAC, 0x1F, 0};
    memset(&host, 0, sizeof host);
    first_command_ns = 0;
    fake_reset(source, start_ns);
    fake_host_accepts = host_accept;
    fake.bus.sensor[trouble.finger].present = !trouble.absent;
    power_cycle();
    t0_ns = (uint64_t)gateway.sampler.slot_start_us * 1000;
    bt_msg_start_pack(&msg, payload);
    (void)ask(BT_START_ID, payload);
}

static inline void run_until(uint64_t end_ns)
{
    while (fake.now_ns < end_ns) {
        assert_true(fake_next_interrupt());
        bt_gateway_poll(&gateway);
    }
}

static inline void run_rounds(uint64_t n)
{
    run_until(fake.now_ns + n * ROUND_NS);
}

BEFORE_EACH(no_trouble)
{
    memset(&trouble, 0, sizeof trouble);
}

#endif
