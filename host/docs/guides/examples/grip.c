// The law of grip.py on a hand's own controller. firmware/client/example_bare.c talks to the gateway for it;
// call grip_begin before each grasp, hand_poll often, grip_round every 10 ms, grip_end to let go.
#include "biotac_client.h"
#include <math.h>

void hand_send(uint8_t id, const void *msg); // example_bare.c
void close_at(float mm_s);                   // the hand's own: both fingers; negative: open
#define FINGERS 0x11u                        // index and thumb, chip selects 0 and 4, which meet along z
#define RESERVE 1.25f
static const uint32_t WIDE = BT_FRAME_FLAG_ELECTRODE_OUT | BT_FRAME_FLAG_ELECTRODE_MISSING
                             | BT_FRAME_FLAG_RAIL | BT_FRAME_FLAG_ELECTRODE_ALONE | BT_FRAME_FLAG_OUTSIDE;
static const uint32_t COARSE = BT_FRAME_FLAG_TEMP | BT_FRAME_FLAG_BASE_OLD;
struct grip {
    float least_n, most_n, friction, stiffness, speed_mm_s, normal_n, shear_n, way_mm, first_n;
    int round, reflex_until, pending_until, holds, settled, slips;
} grip;
static struct felt {
    float normal_n, shear_n; // sums
    uint32_t flags, lifted;
    int frames, slips, level;
} felt; // since the last grip_round

void act_on(const bt_msg_frame *frame)
{
    const int32_t *force = frame->force_100un;
    if (frame->trust >= BT_TRUST_INTERVAL && bt_valid_i32(force[2])) {
        felt.normal_n += (float)force[2] / 1e4f;
        felt.shear_n += hypotf((float)force[0], (float)force[1]) / 1e4f;
        felt.flags |= frame->flags;
        felt.lifted |= ~frame->flags & BT_FRAME_FLAG_CONTACT;
        felt.level =
            frame->slip_level != 255 && frame->slip_level > felt.level ? frame->slip_level : felt.level;
        felt.frames++;
    }
}

void act_on_event(const bt_msg_event *event)
{
    felt.slips += event->kind == BT_EVENT_KIND_SLIP;
}

void grip_begin(float least_n, float most_n) // grip.py: 0.8, 12
{
    grip = (struct grip){
        .least_n = least_n, .most_n = most_n, .friction = 0.6f, .stiffness = 0.8f, .speed_mm_s = 10};
}

void grip_end(void)
{
    hand_send(BT_RELEASE_ID, &(bt_msg_release){4, FINGERS});
    close_at(-20);
}

static float squeeze(float reserve, int coarse)
{
    const float wanted_n = fminf(fmaxf(grip.least_n, reserve * grip.shear_n / grip.friction), grip.most_n);
    const float missing_n = wanted_n - grip.normal_n - grip.speed_mm_s * grip.stiffness * 0.03f;
    const int reflex = grip.round < grip.reflex_until;
    const int near = (coarse && !reflex) || fabsf(missing_n) <= 0.05f * wanted_n;
    const float wanted = near ? 0 : fminf(fmaxf((reflex ? 40 : 6) * missing_n, -0.9f), reflex ? 20 : 5);
    const float before = grip.speed_mm_s * grip.stiffness, change = 0.3f * (wanted - before); // N/s, smoothly
    grip.settled = fabsf(missing_n) < 0.15f * wanted_n ? grip.settled + 1 : 0;
    return (before + change) / grip.stiffness;
}

static void learn_from_slip(float ratio)
{
    grip.friction = fmaxf(0.9f * ratio, 0.03f);
    grip.least_n = fminf(fmaxf(grip.least_n, RESERVE * grip.normal_n), grip.most_n);
    grip.pending_until = 0;
    grip.reflex_until = grip.round + 8;
    grip.slips++;
}

void grip_round(void)
{
    const int blind = felt.frames == 0;
    grip.round++;
    grip.speed_mm_s = blind ? 0 : grip.speed_mm_s; // nothing is known: stay
    grip.normal_n = blind ? grip.normal_n : felt.normal_n / (float)felt.frames;
    if (!blind && !grip.holds && !felt.lifted) {
        hand_send(BT_HOLD_ID, &(bt_msg_hold){3, FINGERS});
        grip.holds = 1;
        grip.first_n = grip.normal_n;
    }
    if (!blind && grip.holds) {
        const float shear_n = felt.shear_n / (float)felt.frames,
                    ratio = shear_n / fmaxf(grip.normal_n, 0.05f);
        grip.shear_n += 0.3f * (shear_n - grip.shear_n);
        grip.way_mm += grip.speed_mm_s * 0.01f;
        if (grip.way_mm > 0.3f && grip.normal_n - grip.first_n > 0.3f)
            grip.stiffness = fminf(fmaxf((grip.normal_n - grip.first_n) / grip.way_mm, 0.2f), 3);
        grip.pending_until = felt.slips ? grip.round + 3 : grip.pending_until;
        if (grip.round >= grip.reflex_until && grip.round < grip.pending_until && felt.level >= 22
            && (grip.slips == 0 || shear_n < 0.1f || ratio > 0.8f * grip.friction))
            learn_from_slip(ratio);
        grip.speed_mm_s = squeeze(felt.flags & WIDE ? 1.2f * RESERVE : RESERVE, (felt.flags & COARSE) != 0);
    }
    felt = (struct felt){0};
    close_at(grip.speed_mm_s);
}
