#include "signal/health.h"

#include "fixed_point.h"

#include <string.h>

#define CLEAN_WINDOWS 2 // windows after an electrode's first word until one holds nothing else

#define ALONE_TIMES 5
#define SURE        2 // times that limit: an electrode is broken
#define BLIND       2 // times both limits, until static pressure has moved
#define ALONE_Q4    (12u * 16)
#define MOVED_Q4    (16u * 16) // sum over the other electrodes from which the anchors move
#define PRESSURE_Q4 (4u * 16)  // static pressure that moves less is quiet
#define PRESSED_Q4  (12u * 16) // static pressure that moves more works

#define ALIVE_WINDOWS 16
#define DEAD_WINDOWS  250 // ten seconds, for a sensor that has never changed a word
#define STUCK_WINDOWS 3  // the window before counts too: a live electrode hardly ever repeats a word 16 times
#define NOISY         32 // count^2 of all electrodes: a quieter finger repeats words
#define TRAVEL_Q4     (100 * 16) // sum of the other electrodes' moves while one is stuck
#define CALM_WINDOWS  50         // two seconds
#define CALM_Q4       (5 * 16)
#define CALM_ROUNDS   12 // since a touch
#define CALM_LOST     4  // calm rounds that a touched round costs

#define SHAKEN_ROUNDS 8
#define FLIP_WINDOWS  8 // no live electrode jumps back and forth three times in so many

static void condemn(bt_health *health, uint32_t electrodes, uint8_t fault)
{
    health->out |= electrodes;
    health->electrode_fault = fault;
    health->calm_windows = 0;
    health->suspect = 0;
    health->alone &= ~electrodes;
}

// ---- words that jump back and forth --------------------------------------------------------------

// Shaken skin makes electrodes jump back and forth too. Pressure then moves: electrodes are only suspected.
static BT_NOINLINE void judge_flips(bt_health *health, uint32_t flips, bool shaken)
{
    health->flips[2] |= health->flips[1] & flips;
    health->flips[1] |= health->flips[0] & flips;
    health->flips[0] |= flips;
    uint32_t noisy = flips & health->flips[2] & BT_ALL_ELECTRODES & ~health->out;
    if (shaken) {
        health->alone |= noisy;
    } else if (noisy != 0) {
        condemn(health, noisy, BT_SENSOR_FAULT_NOISY);
        if (!bt_usable_without(health->out)) {
            health->sensor_fault = BT_SENSOR_FAULT_NOISY;
        }
    }
}

// ---- words that repeat ---------------------------------------------------------------------------

static void judge_repeats(bt_health *health, uint32_t missing, bool noisy)
{
    bool frozen = (health->same | health->out | missing) == BT_ALL_ELECTRODES && bt_usable_without(missing);
    uint32_t unchanged = health->unchanged & health->same;
    if (unchanged == 0) {
        if (health->unchanged != BT_ALL_ELECTRODES && health->unchanged_windows > health->longest) {
            health->longest = health->unchanged_windows;
        }
        unchanged = health->same;
        health->unchanged_windows = 0;
        health->travel_q4 = 0;
    }
    health->unchanged = unchanged;
    health->unchanged_windows = unchanged == 0 ? 0 : bt_count_up(health->unchanged_windows, UINT8_MAX);
    bool alive = health->alive_windows == ALIVE_WINDOWS, dead = health->alive_windows == 0;
    if (!frozen && health->windows > CLEAN_WINDOWS) {
        health->alive_windows = bt_count_up(health->alive_windows, ALIVE_WINDOWS);
        if (health->sensor_fault == BT_SENSOR_FAULT_FROZEN) {
            health->sensor_fault = BT_SENSOR_FAULT_NONE;
        }
    } else if (frozen && (alive || (dead && health->unchanged_windows >= DEAD_WINDOWS))) {
        health->sensor_fault = BT_SENSOR_FAULT_FROZEN;
    }
    // Many quiet electrodes may repeat words until the first seconds have shown for how long. A worn sensor's
    // electrode hardly ever repeats a word four times; a quiet one did so 64 times.
    uint32_t travel_q4 = health->unchanged_windows < ALIVE_WINDOWS ? TRAVEL_Q4 : TRAVEL_Q4 / 2;
    bool few = bt_usable_without(unchanged) || health->windows == UINT8_MAX;
    if (frozen || !few || health->travel_q4 < travel_q4 / 4 || health->unchanged_windows <= health->longest) {
        return;
    }
    health->alone |= noisy ? unchanged : 0;
    if (health->unchanged_windows >= STUCK_WINDOWS && health->unchanged_windows > 2 * health->longest
        && health->travel_q4 >= travel_q4) {
        condemn(health, unchanged, BT_SENSOR_FAULT_STUCK);
        health->unchanged = BT_ALL_ELECTRODES; // electrodes that began to repeat a window later come next
        health->unchanged_windows = 0;
    }
}

// ---- words that move -----------------------------------------------------------------------------

// An electrode's move is the difference of two means of noise, with the deviation `sd`. 18 moves add up to
// 14.4 +- 2.6 sd: below NOISE_SDS, 4 sd of real moves may hide. ALONE_SDS is five times that.
#define NOISE_SDS 17
#define ALONE_SDS 20

static uint32_t less(uint32_t a, uint32_t b)
{
    return a > b ? a - b : 0;
}

// Returns the electrodes that moved alone in this window and the one before.
static uint32_t judge_moves(bt_health *health)
{
    const bt_moves *moves = &health->moves;
    const uint32_t blind = health->pressure_alive ? 1 : BLIND, noise_q4 = NOISE_SDS * (uint32_t)health->sd_q4;
    const bool read = !(health->unknown >> BT_LANE_PDC & 1);
    uint32_t pressure_q4 =
        read ? bt_abs32(health->mean.lane[BT_LANE_PDC] - health->anchor.lane[BT_LANE_PDC]) : 0;
    uint32_t limit_q4 = ALONE_SDS * (uint32_t)health->sd_q4;
    limit_q4 = blind * (limit_q4 < ALONE_Q4 ? ALONE_Q4 : limit_q4);
    uint32_t loud = 0, least = UINT32_MAX, others = moves->total;
    for (unsigned i = 0; moves->top > limit_q4 && i < BT_ELECTRODES; i++) {
        uint32_t size = bt_abs32(health->mean.lane[i] - health->anchor.lane[i]);
        if (size > limit_q4) {
            loud |= 1u << i;
            others -= size;
            least = size < least ? size : least;
        }
    }
    others -= loud == 0 ? moves->top : 0;
    bool still = others <= MOVED_Q4 + noise_q4 && pressure_q4 <= PRESSURE_Q4;
    uint32_t moved = less(others, noise_q4) + less(pressure_q4, PRESSURE_Q4);
    uint32_t most = limit_q4 + blind * ALONE_TIMES * moved;
    bool few = loud != 0 && bt_usable_without(loud);
    health->alone |= few && least > most ? loud : 0;
    uint32_t now = few && least > SURE * most ? loud : 0, sure = now & health->suspect;
    health->suspect = now;
    health->pressure_alive = health->pressure_alive || pressure_q4 > PRESSED_Q4;
    for (unsigned i = 0; still && i < BT_ELECTRODES;
         i++) { // 1.6 counts/s, for drift and the anchor's own noise
        uint16_t *anchor = &health->anchor.lane[i], mean = health->mean.lane[i];
        *anchor = (uint16_t)(*anchor + (mean > *anchor) - (mean < *anchor));
    }
    if (now != 0 || still) {
        return sure;
    }
    uint32_t travel = health->travel_q4 + moves->total;
    health->travel_q4 = (uint16_t)(travel < UINT16_MAX ? travel : UINT16_MAX);
    uint16_t pressure = health->anchor.lane[BT_LANE_PDC];
    health->anchor = health->mean;
    if (!health->pressure_alive) { // a slow press counts in full
        health->anchor.lane[BT_LANE_PDC] = pressure;
    }
    return 0;
}

// ---- condemned electrodes --------------------------------------------------------------------------

// Reinstate only if quiet and near rest: when static pressure has failed, a lone press may go on.
static void watch_condemned(bt_health *health, const bt_round *round, const bt_lanes *rest)
{
    bool calm = true, repeats = false, few = bt_usable_without(health->out);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        if (!(health->out >> i & 1)) {
            continue;
        }
        uint16_t count = round->electrode[i];
        bool usable = bt_count_usable(count);
        uint16_t count_q4 = (uint16_t)((usable ? count : 1) << 4);
        uint32_t away_q4 = bt_abs32(count_q4 - health->anchor.lane[i]);
        repeats = repeats || away_q4 == 0;
        calm = calm && usable && away_q4 <= CALM_Q4 + 32u * health->sd_q4;
        if (!calm || health->calm_windows == 0) {
            health->anchor.lane[i] = count_q4;
        }
        calm = calm && !(few && bt_abs32(count - rest->lane[i]) > BT_TRIGGER_FAR);
    }
    if (!calm) {
        health->calm_windows = 0;
    } else if (!repeats && health->calm_windows < CALM_WINDOWS) {
        health->calm_windows++;
    }
}

void bt_health_back(bt_health *health)
{
    if (health->calm_windows < CALM_WINDOWS) {
        return;
    }
    health->out = 0;
    health->electrode_fault = BT_SENSOR_FAULT_NONE;
    health->sensor_fault = BT_SENSOR_FAULT_NONE;
    health->windows = 0;
    memset(health->flips, 0, sizeof health->flips);
}

// ---- a round ---------------------------------------------------------------------------------------

static void anchor_all(bt_health *health, const bt_lanes *sum)
{
    for (unsigned k = 0; k < BT_LANES / 2; k++) { // the mask drops bits that an unread lane would carry over
        health->mean.pair[k] = (sum->pair[k] & 0x3FFF3FFF) << 2;
    }
    health->anchor = health->mean;
    health->suspect = 0;
}

// Treat excluded electrodes as unmoved.
static void leave_out(bt_health *health, uint32_t without)
{
    for (unsigned i = 0; without >> i != 0; i++) {
        if (without >> i & 1) {
            health->mean.lane[i] = health->anchor.lane[i];
        }
    }
}

static BT_NOINLINE uint32_t judge(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                                  const bt_noise *noise)
{
    uint32_t lone = 0;
    if (trigger->unknown != health->unknown) {
        health->unknown = trigger->unknown;
        health->windows = 0;
    }
    uint32_t sigma_q4 = noise->count2 == 0 ? 5 * 16 : noise->sigma_q4;
    health->sd_q4 = (uint16_t)((sigma_q4 * 68 + (1 << 7)) >> 8); // sqrt(2 / 28) sigma
    if (health->windows > CLEAN_WINDOWS) {
        lone = judge_moves(health);
    } else if (health->windows == CLEAN_WINDOWS) {
        anchor_all(health, &health->sum[!health->filling]);
    }
    health->windows = bt_count_up(health->windows, UINT8_MAX);
    if (health->out != 0) {
        watch_condemned(health, round, &trigger->rest);
    }
    if (++health->judged % FLIP_WINDOWS == 0) {
        memset(health->flips, 0, sizeof health->flips);
    }
    return lone;
}

void bt_health_round(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                     const bt_noise *noise, bool touched)
{
    const bt_lanes *smooth = &trigger->smooth;
    bt_lanes *sum = &health->sum[health->filling];
    bt_lanes *before = &health->sum[!health->filling];
    const uint32_t without = (trigger->unknown | health->out) & BT_ALL_ELECTRODES;
    uint32_t lone = 0;
    uint8_t leap = bt_leap_round(&health->leap, round, trigger);
    health->exchanged = health->exchanged || leap == BT_SENSOR_FAULT_EXCHANGED;
    if (leap == BT_SENSOR_FAULT_TOGETHER) {
        health->sensor_fault = leap;
    }
    uint32_t flips = (trigger->up & health->down) | (trigger->down & health->up);
    health->up = trigger->up;
    health->down = trigger->down;
    health->still_rounds = trigger->far >> BT_LANE_PDC & 1 ? 0 : bt_count_up(health->still_rounds, UINT8_MAX);
    if (flips != 0) {
        judge_flips(health, flips, health->still_rounds <= SHAKEN_ROUNDS);
    }
    switch (++health->rounds) {
    case 1:
        // An electrode at a rail repeats one word and is not stuck.
        health->same = bt_window_begin(sum, before, smooth) & ~(without | (trigger->odd & ~trigger->without));
        judge_repeats(health, trigger->without & ~health->out, noise->count2 >= NOISY);
        bt_mean_add(&health->mean, before, 0);
        break;
    case 2:
        bt_lanes_add(sum, smooth);
        bt_mean_add(&health->mean, before, BT_LANES / 2);
        break;
    case 3:
        bt_lanes_add(sum, smooth);
        leave_out(health, without);
        health->moves = bt_moves_between(&health->mean, &health->anchor);
        break;
    default:
        bt_lanes_add(sum, smooth);
        lone = judge(health, round, trigger, noise);
        health->filling = !health->filling;
        health->rounds = 0;
    }
    if (touched) { // noise of pressure counts as well, and is no touch
        health->calm_rounds =
            health->calm_rounds < CALM_LOST ? 0 : (uint8_t)(health->calm_rounds - CALM_LOST);
        health->was_touched = health->was_touched || health->calm_rounds == 0;
    } else if (health->calm_rounds < CALM_ROUNDS && ++health->calm_rounds == CALM_ROUNDS
               && health->was_touched) {
        health->was_touched = false;
        anchor_all(health, before); // the press of a tip no wider than an electrode is over
    }
    if (lone != 0 && health->calm_rounds == CALM_ROUNDS) {
        condemn(health, lone, BT_SENSOR_FAULT_ALONE);
    }
}
