// Fingers in the middle of their lives, untouched or pressed half a second ago. Each scene has fingers of
// its own: the runs are consecutive rounds, with every turn of a sweep among them.
#include "scenes.h"

#include "finger.h"
#include "map/population.h"
#include "maps.h"
#include "signal/signals.h"
#include "wire/framing.h"

#define LANES BT_LANES // a round's words that the front end looks at: electrodes, then pressure

static uint16_t rest_count[BT_SLOTS], press_count[BT_SLOTS], light_count[BT_SLOTS];
static uint16_t rest_lane[LANES], press_lane[LANES], light_lane[LANES];
static bt_tare_settings tare_settings;
static bt_finger rest_front, press_front, rest_whole, press_whole, press_lin, press_light;
static bt_finger rest_words, rest_events, press_events, shaken_events, slip_events;
static bench_map pooled, pooled_6, pooled_7, affine, sign_split, gated, conductance, joined;
static bt_msg_frame message;
static bt_msg_frame sent;
static _Alignas(4) uint16_t encoded[(BT_ENCODED_MAX_BYTES + 1) / 2];

// A sink, so that the compiler drops no result.
static volatile uint32_t sink;

#define SCENE(name) static void name(__attribute__((unused)) const bt_solve_settings *settings)

static void words(bt_finger *finger, const uint16_t count[BT_SLOTS])
{
    bool touched = false;
    bt_finger_begin(finger, 0, &tare_settings);
    for (uint8_t slot = 0; slot < BT_SLOTS; slot++) {
        touched |= bt_finger_put(finger, slot, count[slot]);
    }
    sink = touched;
}

static void front_end(bt_finger *finger, const uint16_t count[LANES])
{
    bool touched = false;
    bt_tare_begin(&finger->tare, &tare_settings);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        touched |= bt_tare_electrode(&finger->tare, i, count[i]);
    }
    touched |= bt_tare_pressure(&finger->tare, count[BT_LANE_PDC]);
    bt_tare_end(&finger->tare, 0, &tare_settings);
    sink = touched;
}

static void untouched(bt_finger *finger)
{
    front_end(finger, rest_lane);
    sink = bt_finger_idle(finger);
}

static void pressed(bt_finger *finger, const uint16_t count[LANES], const bt_solve_settings *settings)
{
    front_end(finger, count);
    bt_results(&finger->round, &finger->tare, settings, BT_WANT_ALL, &message);
}

SCENE(front_at_rest)
{
    front_end(&rest_front, rest_lane);
}

SCENE(front_in_contact)
{
    front_end(&press_front, press_lane);
}

SCENE(whole_at_rest)
{
    untouched(&rest_whole);
}

SCENE(whole_in_contact)
{
    pressed(&press_whole, press_lane, settings);
}

// So lightly that the population map has no share in the force.
SCENE(whole_in_light_contact)
{
    pressed(&press_light, light_lane, settings);
}

SCENE(whole_by_lin)
{
    bt_solve_settings lins = *settings;
    lins.population = false;
    pressed(&press_lin, press_lane, &lins);
}

SCENE(all_words)
{
    words(&rest_words, rest_count);
    sink = bt_finger_end(&rest_words, &tare_settings);
}

// The cost of EVENTs, for PAC that swings by so much.
static void swing(bt_finger *finger, int counts)
{
    for (int k = 0; k < BT_PAC_PER_FRAME; k++) {
        finger->round.pac[k] = (uint16_t)(2038 + counts * ((k & 15) - 8) / 8);
    }
}

static void events(bt_finger *finger)
{
    static const uint8_t pac_slot[] = BT_FINGER_EVENT_SLOTS;
    uint32_t raised = 0;
    for (size_t k = 0; k < sizeof pac_slot; k++) {
        raised |= bt_finger_events(finger, pac_slot[k], false);
    }
    if (finger->events.strongest_slot != BT_EVENTS_NO_SLOT) {
        raised |= bt_finger_events(finger, finger->events.strongest_slot, false);
    }
    sink = raised;
}

SCENE(events_at_rest)
{
    events(&rest_events);
}

SCENE(events_in_contact)
{
    events(&press_events);
}

// The dearest: a held finger is shaken, and no event has been told of it so far.
SCENE(events_shaken)
{
    shaken_events.events.risen_count2 = shaken_events.events.fallen_count2 = 0;
    events(&shaken_events);
}

SCENE(events_slipping)
{
    events(&slip_events);
}

// A FRAME to bytes for the link, with the table's CRC: on an RP2040 the DMA makes it, in 1100 cycles less.
SCENE(framed)
{
    bt_msg_frame_pack_even(&sent, encoded + BT_PAYLOAD_AT / 2);
    sink = (uint32_t)bt_frame_seal(BT_FRAME_ID, BT_FRAME_BYTES, (uint8_t *)encoded);
}

static void mapped(const bt_map *map)
{
    int32_t force_100un[3], torque_mnmm[3], torsion_mnmm;
    bt_map_wrench(map, press_whole.round.electrode, press_whole.tare.electrode_q4, 400, force_100un,
                  torque_mnmm, &torsion_mnmm);
    sink = (uint32_t)force_100un[0];
}

#define MAP_SCENE(name)                                                                                      \
    SCENE(map_##name)                                                                                        \
    {                                                                                                        \
        mapped(&name.map);                                                                                   \
    }

MAP_SCENE(affine)
MAP_SCENE(sign_split)
MAP_SCENE(gated)
MAP_SCENE(conductance)
MAP_SCENE(joined)
MAP_SCENE(pooled)
MAP_SCENE(pooled_6)
MAP_SCENE(pooled_7)

SCENE(population)
{
    int32_t force_100un[3], e_q4[BT_ELECTRODES];
    bt_signals_q4(press_whole.round.electrode, press_whole.tare.electrode_q4, e_q4);
    bt_population_force(&bt_population, e_q4, force_100un);
    sink = (uint32_t)force_100un[0];
}

SCENE(map_opened)
{
    bt_map map;
    sink = bt_map_open(&map, (const uint8_t *)pooled.blob, pooled.bytes);
}

const bench_scene bench_scenes[] = {

    {"front end", "at rest", front_at_rest},
    {"front end", "in contact", front_in_contact},
    {"whole frame", "at rest", whole_at_rest},
    {"whole frame", "in contact", whole_in_contact},
    {"whole frame", "in light contact", whole_in_light_contact},
    {"whole frame", "in contact, Lin's scales", whole_by_lin},

    {"wrench map", "signals and offset, 3 axes", map_affine},
    {"wrench map", "sign-split, 3 axes", map_sign_split},
    {"wrench map", "gated sign-split, 3 axes", map_gated},
    {"wrench map", "quadratic in conductance, 3 axes", map_conductance},
    {"wrench map", "joined, 3 axes", map_joined},
    {"wrench map", "pooled, 3 axes", map_pooled},
    {"wrench map", "pooled, 6 axes", map_pooled_6},
    {"wrench map", "pooled, 7 axes", map_pooled_7},
    {"wrench map", "pooled, 3 axes, judged", map_opened},
    {"population map", "and along normals, mixed", population},
    {"events", "at rest", events_at_rest},
    {"events", "in contact", events_in_contact},
    {"events", "shaken, nothing told", events_shaken},

    {"events", "slipping", events_slipping},
    {"link", "44 words taken in, at rest", all_words},
    {"link", "FRAME packed, with CRC and COBS", framed},
    {NULL, NULL, NULL},
};

static void run(bt_finger *finger, const uint16_t count[BT_SLOTS], int rounds)
{
    for (int k = 0; k < rounds; k++) {
        words(finger, count);
        sink = bt_finger_end(finger, &tare_settings);
    }
}

void bench_scenes_init(void)
{
    bt_settings all;
    (void)(BENCH_MAP_MAKE(&affine, bench_map_affine, 3)
           && BENCH_MAP_MAKE(&pooled, bench_map_pooled, 3)
           // Parts of it: models of `biotac calibrate wrench`, less a few cycles for the offset; a
           // population map as a finger's own.
           && bench_map_make(&sign_split, bench_map_pooled + 4, 2, 3)
           && bench_map_make(&gated, bench_map_pooled + 4, 6, 3)
           && bench_map_make(&conductance, bench_map_pooled + 2, 2, 3)
           && bench_map_make(&joined, bench_map_pooled + 2, 8, 3)
           && BENCH_MAP_MAKE(&pooled_6, bench_map_pooled, 6)
           && BENCH_MAP_MAKE(&pooled_7, bench_map_pooled, 7));
    bt_settings_reset(&all);
    tare_settings = bt_tare_settings_from(&all);
    for (int s = 0; s < BT_SLOTS; s++) {
        rest_count[s] = (uint16_t)(2900 + 7 * s);
        press_count[s] = light_count[s] = rest_count[s];
        int channel = bt_slot_channel[s];
        int lane = channel == BT_CHANNEL_PDC ? BT_LANE_PDC : channel - BT_CHANNEL_E1;
        if (lane >= 0 && lane < LANES) {
            press_count[s] = (uint16_t)(rest_count[s] - (lane < BT_ELECTRODES ? 20 * (s % 13) + 40 : -100));
            rest_lane[lane] = rest_count[s];
            press_lane[lane] = press_count[s];
            light_count[s] = (uint16_t)(rest_count[s] - (rest_count[s] - press_count[s]) / 4);
            light_lane[lane] = light_count[s];
        }
    }
    bt_finger_reset(&rest_front, 0);
    run(&rest_front, rest_count, 400);
    rest_whole = rest_words = press_front = press_light = rest_front;
    run(&press_front, press_count, 50);
    run(&press_light, light_count, 50);
    press_front.tare.noise.count2 = press_light.tare.noise.count2 = 400; // exact counts have none
    press_whole = press_lin = press_front;
    rest_events = rest_front;
    press_events = slip_events = press_front;
    sink = bt_finger_events(&press_events, 0, true);
    sink = bt_finger_events(&slip_events, 0, true);
    swing(&rest_events, 5);
    swing(&press_events, 5);
    shaken_events = press_events;
    shaken_events.events.landing = false;
    shaken_events.events.jolt_raised = true;
    shaken_events.events.level_count2 = 40000; // so that a round of this is not enough for any
    swing(&shaken_events, 70);

    swing(&slip_events, 200);
    for (int k = 0; k < 110; k++) { // until it has landed
        events(&slip_events);
    }
    bt_finger finger = press_front;
    const bt_solve_settings settings = bt_solve_settings_from(&all);
    bt_finger_frame(&finger, &settings, finger.quantities, 0, &sent);
}
