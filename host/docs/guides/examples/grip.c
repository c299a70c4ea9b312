// The law of grip.py on a hand's own controller. example_bare.c, beside it, talks to the gateway for it;
// call grip_begin before each grasp, hand_poll often, grip_round every 10 ms, also after grip_end: it opens,
// and 0.5 s later tells the board.
#include "biotac_client.h"
#include <math.h>

void hand_send(uint8_t id, const void *msg); // example_bare.c
void close_at(float mm_s);                   // the hand's own: both fingers; negative: open
#define FINGERS         0x11u                // index and thumb, chip selects 0 and 4, which meet along z
#define RESERVE         1.25f
#define MARGIN(half_mn) ((half_mn) == 65535 ? 0 : (float)(half_mn) / 1e3f)
struct grip {
    float least_n, most_n, slip_n, slip_shear_n, power, stiffness, speed_mm_s, normal_n, shear_n, margin_n,
        way_mm, first_n, wanted_n, blind_n;
    int round, blind, blind_slips, reflex_until, pending_until, holds, settled, slips, opens;
} grip;
static struct felt {
    float normal_n, shear_n, margin_n, half_n; // sums
    float most_n;
    int frames, strong, lifted, held, unheld, slipped;
} felt; // since the last grip_round

void act_on(const bt_msg_frame *frame)
{
    const int32_t *force = frame->force_100un;
    if (!(FINGERS >> frame->finger & 1)) {
        return; // the board's other fingers touch other things
    }
    felt.held |= (frame->flags & BT_FRAME_FLAG_HELD) != 0;
    felt.unheld |= !(frame->flags & BT_FRAME_FLAG_HELD);
    if (frame->trust >= BT_TRUST_INTERVAL && bt_valid_i32(force[0]) && bt_valid_i32(force[1])
        && bt_valid_i32(force[2])) {
        felt.most_n = fmaxf(felt.most_n, (float)force[2] / 1e4f);
        felt.normal_n += (float)force[2] / 1e4f;
        felt.shear_n += hypotf((float)force[0], (float)force[1]) / 1e4f;
        felt.margin_n += frame->trust == BT_TRUST_ACT ? 0 : MARGIN(frame->normal_half_mn) / 2;
        felt.half_n += MARGIN(frame->shear_half_mn);
        felt.lifted |= !(frame->flags & BT_FRAME_FLAG_CONTACT);
        felt.strong |= frame->slip_level >= 22 && frame->slip_level < 255;
        felt.frames++;
    }
}

void act_on_event(const bt_msg_event *event)
{
    if (event->kind == BT_EVENT_KIND_SLIP && FINGERS >> event->finger & 1)
        felt.slipped = 1;
}

void grip_begin(float least_n, float most_n) // grip.py: 0.8, 12
{
    grip = (struct grip){.least_n = least_n, .most_n = most_n, .slip_n = 0.9f, .slip_shear_n = 0.6f};
    grip.power = 1, grip.stiffness = 0.8f, grip.speed_mm_s = 10, grip.wanted_n = least_n;
    felt = (struct felt){0};
}

void grip_end(void)
{
    grip.opens = 1;
    close_at(-20);
}

static void learn_from_slip(float shear_n, float half_n)
{
    grip.slip_n = fmaxf(grip.normal_n, 0.05f), grip.slip_shear_n = fmaxf(shear_n, 0.02f);
    const float doubt = 0.45f * half_n / grip.slip_shear_n;
    grip.power = 1 / (1 + doubt * doubt);
    grip.least_n = fmaxf(grip.least_n, (RESERVE + 0.65f * (1 - grip.power)) * grip.normal_n);
    grip.pending_until = 0, grip.reflex_until = grip.round + 8, grip.slips++;
}

static float step(float shear_n)
{
    if (!grip.holds)
        grip.holds = 1, grip.first_n = grip.normal_n;
    grip.way_mm += grip.speed_mm_s * 0.01f;
    if (grip.way_mm > 0.3f && grip.normal_n - grip.first_n > 0.3f)
        grip.stiffness = fminf(fmaxf((grip.normal_n - grip.first_n) / grip.way_mm, 0.2f), 3);
    grip.shear_n += 0.3f * (shear_n - grip.shear_n);
    if (grip.round >= grip.reflex_until && grip.round < grip.pending_until && felt.strong)
        learn_from_slip(shear_n, felt.half_n / (float)felt.frames);
    const float needed_n = grip.slip_n / 0.9f * powf(grip.shear_n / grip.slip_shear_n, grip.power);
    const float wanted_n = fminf(fmaxf(grip.least_n, RESERVE * needed_n), grip.most_n);
    grip.wanted_n = wanted_n;
    const float before = grip.speed_mm_s * grip.stiffness; // N/s
    const float missing_n = wanted_n - grip.normal_n - 0.03f * before;
    const int reflex = grip.round < grip.reflex_until, near = fabsf(missing_n) <= 0.05f * wanted_n;
    const float wanted = near ? 0 : fminf(fmaxf((reflex ? 40 : 6) * missing_n, -0.9f), reflex ? 40 : 5);
    grip.settled = fabsf(missing_n) < 0.15f * wanted_n ? grip.settled + 1 : 0;
    return (before + (reflex ? 1 : 0.3f) * (wanted - before)) / grip.stiffness;
}

// In N/s: from three rounds on harder by two fifths, as it may get heavier, by the interval's width, and at
// once by two fifths more for each of two slips.
static float press_blindly(void)
{
    const float pressed_n = fminf(grip.normal_n, grip.wanted_n);
    grip.blind_slips += felt.slipped && grip.blind_slips < 2;
    const float enough_n =
        pressed_n * powf(1.4f, 1.0f + (float)grip.blind_slips) + fminf(4 * grip.margin_n, pressed_n);
    const float rate = grip.blind_slips ? 40 : 5;
    if (grip.blind < 3 || grip.normal_n + grip.blind_n >= fminf(enough_n, grip.most_n))
        return 0;
    grip.blind_n += rate * 0.01f;
    return rate;
}

void grip_round(void)
{
    const float frames = (float)felt.frames;
    grip.round++;
    if (grip.holds && (!felt.frames || grip.blind)) // also what it does blindly makes the force
        grip.way_mm += grip.speed_mm_s * 0.01f;
    if (grip.opens) { // by 10 mm before RELEASE: what is left over then is residue. Until then all is CONTACT
        grip.speed_mm_s = -20;
        if (grip.opens++ > 50 && felt.held) // again if it was lost
            hand_send(BT_RELEASE_ID, &(bt_msg_release){4, FINGERS});
    } else if (felt.frames) {
        grip.speed_mm_s = grip.blind ? 0 : grip.speed_mm_s; // what it did blindly is no rate to go on from
        if (felt.slipped || grip.blind_slips)               // it may slip still
            grip.pending_until = grip.round + 3;
        grip.blind = grip.blind_slips = 0, grip.blind_n = 0;
        grip.margin_n += 0.1f * (felt.margin_n / frames - grip.margin_n);
        grip.normal_n = felt.normal_n / frames + grip.margin_n;
        const float closing_mm_s = felt.most_n < grip.most_n ? 10 : 0;
        grip.speed_mm_s = grip.holds || !felt.lifted ? step(felt.shear_n / frames) : closing_mm_s;
    } else {
        grip.blind++;
        grip.speed_mm_s = grip.holds ? press_blindly() / grip.stiffness : 0;
    }
    if (grip.holds && !grip.opens && felt.unheld) // again if it was lost, or lapsed with a restart
        hand_send(BT_HOLD_ID, &(bt_msg_hold){3, FINGERS});
    felt = (struct felt){0};
    close_at(grip.speed_mm_s);
}
