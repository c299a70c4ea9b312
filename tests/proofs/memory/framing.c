// Any byte to a deframer in any possible state, which leaves it in a possible one; any payload into a
// frame.
#include "wire/framing.h"

#include <__fc_builtin.h>

static bt_deframer deframer;
static uint8_t payload[BT_FRAME_MAX_BYTES - 1 - BT_CRC_BYTES];
static uint8_t out[BT_ENCODED_MAX_BYTES];

void main(void)
{
    Frama_C_make_unknown((char *)&deframer, sizeof deframer);
    deframer.filled = (uint16_t)Frama_C_interval(0, BT_FRAME_MAX_BYTES + 2);
    (void)bt_deframer_push(&deframer, (uint8_t)Frama_C_interval(0, UINT8_MAX));
    //@ check deframer.filled <= BT_FRAME_MAX_BYTES + 2;

    Frama_C_make_unknown((char *)payload, sizeof payload);
    size_t bytes = (size_t)Frama_C_interval(0, sizeof payload);
    size_t encoded = bt_frame_encode((uint8_t)Frama_C_interval(0, UINT8_MAX), payload, bytes, out);
    //@ check encoded <= BT_ENCODED_MAX_BYTES;
}
