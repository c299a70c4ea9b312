// The law of biotac.grip on a hand's own controller. example_bare.c, beside it, talks to the gateway for it;
// call grip_begin before each grasp, hand_poll often, grip_round every 10 ms, also after grip_end: it opens,
// and 0.5 s later tells the board.
#include "biotac_client.h"
#include <math.h>

void hand_send(uint8_t id, const void *msg); // example_bare.c
void close_at(float mm_s);                   // the hand's own: both fingers; negative: open
#define FINGERS         0x11u                // index and thumb, chip selects 0 and 4, which meet along z
#define MARGIN(half_mn) ((half_mn) == 65535 ? 0 : (float)(half_mn) / 1e3f)

// biotac/grip/constants.py explains each of them.
#define ROUND_S            0.01f
#define LAG_S              0.05f
#define CLOSING_MM_S       10.0f
#define STIFFNESS_N_PER_MM 0.8f
#define LEAST_N_PER_MM     0.2f
#define MOST_N_PER_MM      3.0f
#define FELT_MM            0.3f
#define FELT_N             0.3f
#define FRICTION           0.625f
#define RESERVE            1.3f
#define CALM_PER_S         6.0f
#define CALM_N_PER_S       5.0f
#define CALM_SHARE         0.3f
#define RELEASE_N_PER_S    0.9f
#define REFLEX_PER_S       100.0f
#define REFLEX_N_PER_S     40.0f
#define REFLEX_SHARE       1.0f
#define NEAR_SHARE         0.05f
#define SETTLED_SHARE      0.15f
#define SLIPS_FROM_COUNTS  22
#define PENDING_ROUNDS     3
#define EVENT_ROUNDS       10
#define LOAD_SHARE         0.02f
#define RELIEVED_SHARE     0.5f
#define DOUBT              0.45f
#define DOUBT_RESERVE      0.65f
#define INTERVAL_SHARE     0.5f
#define MARGIN_SHARE       0.1f
#define BLIND_ROUNDS       3
#define BLIND_SHARE        0.4f
#define BLIND_MARGINS      4
#define BLIND_SLIPS        2

struct grip {
    float least_n, most_n, slip_n, slip_shear_n, power, stiffness, speed_mm_s, moves_mm_s, normal_n, shear_n,
        margin_n, way_mm, first_n, wanted_n, unfelt_n;
    float load_n[2][2]; // of each finger, along x and y
    int round, unfelt, away, unfelt_slips, event_until, pending_until, holds, reflex, slides, settled, slips,
        opens;
} grip;
static struct felt {
    float normal_n, shear_n, margin_n, half_n, borne, load; // sums
    float most_n;
    int frames, any, strong, lifted, held, unheld, slipped, unfelt;
} felt; // since the last grip_round

void act_on(const bt_msg_frame *frame)
{
    const int32_t *force = frame->force_100un;
    if (!(FINGERS >> frame->finger & 1)) {
        return; // the board's other fingers touch other things
    }
    felt.any = 1;
    felt.unfelt |= (frame->flags & BT_FRAME_FLAG_LEAP_PENDING) != 0;
    felt.held |= (frame->flags & BT_FRAME_FLAG_HELD) != 0;
    felt.unheld |= !(frame->flags & BT_FRAME_FLAG_HELD);
    if (frame->trust >= BT_TRUST_INTERVAL && bt_valid_i32(force[0]) && bt_valid_i32(force[1])
        && bt_valid_i32(force[2])) {
        felt.most_n = fmaxf(felt.most_n, (float)force[2] / 1e4f);
        felt.normal_n += (float)force[2] / 1e4f;
        const float shear_n[2] = {(float)force[0] / 1e4f, (float)force[1] / 1e4f};
        float *load_n = grip.load_n[frame->finger != 0];
        felt.shear_n += hypotf(shear_n[0], shear_n[1]);
        for (int k = 0; k < 2; k++) {
            felt.borne += shear_n[k] * load_n[k];
            felt.load += load_n[k] * load_n[k];
            load_n[k] += LOAD_SHARE * (shear_n[k] - load_n[k]);
        }
        felt.margin_n += frame->trust == BT_TRUST_ACT ? 0 : INTERVAL_SHARE * MARGIN(frame->normal_half_mn);
        felt.half_n += MARGIN(frame->shear_half_mn);
        felt.lifted |= !(frame->flags & BT_FRAME_FLAG_CONTACT);
        felt.strong |= frame->slip_level >= SLIPS_FROM_COUNTS && frame->slip_level < 255;
        felt.frames++;
    }
}

void act_on_event(const bt_msg_event *event)
{
    if (event->kind == BT_EVENT_KIND_SLIP && FINGERS >> event->finger & 1)
        felt.slipped = 1;
}

void grip_begin(float least_n, float most_n) // biotac.grip: 0.8, 12
{
    grip = (struct grip){
        .least_n = least_n, .most_n = most_n, .slip_n = 1, .slip_shear_n = FRICTION, .power = 1};
    grip.stiffness = STIFFNESS_N_PER_MM, grip.speed_mm_s = grip.moves_mm_s = CLOSING_MM_S,
    grip.wanted_n = least_n;
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
    const float doubt = DOUBT * half_n / grip.slip_shear_n;
    grip.power = 1 / (1 + doubt * doubt);
    grip.least_n = fmaxf(grip.least_n, (RESERVE + DOUBT_RESERVE) * (1 - grip.power) * grip.normal_n);
    grip.slips++;
}

static float squeeze(void)
{
    const float needed_n = grip.slip_n * powf(grip.shear_n / grip.slip_shear_n, grip.power);
    const float wanted_n = fminf(fmaxf(grip.least_n, RESERVE * needed_n), grip.most_n);
    grip.wanted_n = wanted_n;
    const float before = grip.speed_mm_s * grip.stiffness; // N/s
    const float missing_n = wanted_n - grip.normal_n - LAG_S * grip.moves_mm_s * grip.stiffness;
    grip.settled = fabsf(missing_n) < SETTLED_SHARE * wanted_n ? grip.settled + 1 : 0;
    const int reflex = grip.reflex, near = fabsf(missing_n) <= NEAR_SHARE * wanted_n;
    grip.reflex &=
        grip.slides || missing_n > NEAR_SHARE * wanted_n; // from the next round on: it ends at once
    const float gain = reflex ? REFLEX_PER_S : CALM_PER_S, most = reflex ? REFLEX_N_PER_S : CALM_N_PER_S;
    const float wanted = near ? 0 : fminf(fmaxf(gain * missing_n, -RELEASE_N_PER_S), most);
    return (before + (reflex ? REFLEX_SHARE : CALM_SHARE) * (wanted - before)) / grip.stiffness;
}

static float step(float shear_n)
{
    if (!grip.holds)
        grip.holds = 1, grip.first_n = grip.normal_n;
    if (grip.way_mm > FELT_MM && grip.normal_n - grip.first_n > FELT_N)
        grip.stiffness =
            fminf(fmaxf((grip.normal_n - grip.first_n) / grip.way_mm, LEAST_N_PER_MM), MOST_N_PER_MM);
    grip.shear_n +=
        (grip.reflex ? REFLEX_SHARE : CALM_SHARE) * ((felt.borne >= 0 ? shear_n : 0) - grip.shear_n);
    if (felt.slipped)
        grip.pending_until = grip.round + PENDING_ROUNDS;
    const int told = felt.strong && grip.round < grip.pending_until, fresh = grip.round >= grip.event_until;
    if (told && felt.borne >= RELIEVED_SHARE * felt.load) {
        if (fresh)
            learn_from_slip(shear_n, felt.half_n / (float)felt.frames);
        grip.reflex = 1;
    }
    grip.slides = told || (felt.strong && !fresh);
    if (grip.slides)
        grip.event_until = grip.round + EVENT_ROUNDS;
    return squeeze();
}

static float press_unfelt(void) // in N/s
{
    grip.unfelt++, grip.away = felt.any ? 0 : grip.away + 1;
    const int away = grip.away >= BLIND_ROUNDS;
    const float pressed_n = fminf(grip.normal_n, grip.wanted_n);
    grip.unfelt_slips += felt.slipped && grip.unfelt_slips < BLIND_SLIPS;
    float enough_n = pressed_n * powf(1 + BLIND_SHARE, (float)(away + grip.unfelt_slips));
    enough_n += away ? fminf(BLIND_MARGINS * grip.margin_n, pressed_n) : 0;
    const float rate = grip.unfelt_slips ? REFLEX_N_PER_S : CALM_N_PER_S;
    if (grip.unfelt < BLIND_ROUNDS || grip.normal_n + grip.unfelt_n >= fminf(enough_n, grip.most_n))
        return 0;
    grip.unfelt_n += rate * ROUND_S;
    return rate;
}

void grip_round(void)
{
    // A side that does not feel what its pressure does, and the other feels nothing either.
    felt.frames = felt.unfelt && felt.most_n < FELT_N ? 0 : felt.frames;
    const float frames = (float)felt.frames;
    grip.round++;
    grip.moves_mm_s += (grip.speed_mm_s - grip.moves_mm_s) * ROUND_S / LAG_S;
    grip.way_mm += grip.holds ? grip.moves_mm_s * ROUND_S : 0;
    if (grip.opens) { // by 10 mm before RELEASE: a signal left then is residue. Until then all is CONTACT
        grip.speed_mm_s = -20;
        if (grip.opens++ > 50 && felt.held) // again if it was lost
            hand_send(BT_RELEASE_ID, &(bt_msg_release){4, FINGERS});
    } else if (felt.frames) {
        if (grip.unfelt) {
            grip.speed_mm_s = 0, grip.reflex = 0, grip.unfelt_n = 0;
            felt.slipped |= grip.unfelt_slips > 0; // it may slip still
            grip.unfelt = grip.away = grip.unfelt_slips = 0;
        }
        if (!grip.holds && felt.lifted) {
            grip.speed_mm_s = felt.most_n < grip.most_n ? CLOSING_MM_S : 0;
        } else {
            grip.margin_n += MARGIN_SHARE * (felt.margin_n / frames - grip.margin_n);
            grip.normal_n = felt.normal_n / frames + grip.margin_n;
            grip.speed_mm_s = step(felt.shear_n / frames);
        }
    } else {
        grip.speed_mm_s = grip.holds ? press_unfelt() / grip.stiffness : 0;
    }
    if (grip.holds && !grip.opens && felt.unheld) // again if it was lost, or lapsed with a restart
        hand_send(BT_HOLD_ID, &(bt_msg_hold){3, FINGERS});
    felt = (struct felt){0};
    close_at(grip.speed_mm_s);
}
