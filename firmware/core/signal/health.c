#include "signal/health.h"

#include "fixed_point.h"

#include <string.h>

#define ALL_ELECTRODES ((1u << BT_ELECTRODES) - 1)

#define FROZEN_ROUNDS 10
#define ALIVE_ROUNDS  64
#define LONGEST       100

// Windows: four rounds for what jumps, eight windows for what creeps away, whose noise is a third.
#define WINDOW_ROUNDS 4
#define HALF_WINDOW                                                                                          \
    2 // to be sure of what moved alone: a blow reaches the last electrodes a round before the first
#define SLOW_WINDOWS 8
#define FAST_BITS    2 // of a count in a window's unit
#define SLOW_BITS    4

#define ALONE_TIMES       8
#define ALONE_TIMES_BLIND 16  // while static pressure has not shown that it works
#define ALONE             20u // counts
#define MOVED    16u // counts: sum of what the others move by before a window is compared with the next one
#define PRESSURE 4u  // counts: static pressure that moves less is quiet

#define TRAVEL_Q2    (100 * 4) // sum of what the others move by while an electrode is stuck
#define CALM_WINDOWS 50        // two seconds
#define CALM_Q2      (5 * 4)

#define TOGETHER        5u  // counts
#define TOGETHER_BLIND  25u // while static pressure has not shown that it works
#define WARMED          3   // counts of TDC
#define PRESSED         12u // counts: static pressure that has moved so far works
#define TOGETHER_ROUNDS 36  // 14 counts/s: a hot cup does up to 10

#define FLIP       32 // of a jump back and forth
#define FLIPPED    96 // more than three of them within a few rounds
#define FLIPS_MOST 160
#define FLIP_DECAY 4 // a window

_Static_assert(WINDOW_ROUNDS *BT_TRIGGER_UNREAD <= UINT16_MAX, "a window's sum must fit its half of a pair");
_Static_assert(FLIPS_MOST + FLIP <= UINT8_MAX, "flips must fit their type");

void bt_health_reset(bt_health *health)
{
    memset(health, 0, sizeof *health);
    health->unchanged = ALL_ELECTRODES;
    health->noise_count2 = UINT32_MAX; // limits are not made yet
}

static void condemn(bt_health *health, uint32_t electrodes, uint8_t fault)
{
    health->out |= electrodes;
    health->electrode_fault = fault;
    health->calm_windows = 0;
    health->suspect = 0;
    health->alone_fast = 0;
    health->alone_slow = 0;
    health->alone &= ~electrodes;
}

// ---- words that repeat -------------------------------------------------------------------------

static void start_unchanged(bt_health *health)
{
    health->unchanged = ALL_ELECTRODES & ~health->out;
    health->unchanged_rounds = 0;
    health->travel_q2 = 0;
}

static void judge_repeats(bt_health *health, uint32_t without)
{
    uint32_t unchanged = health->unchanged & health->same & ~without;
    if (unchanged == 0) {
        if (health->unchanged_rounds > health->longest_rounds) {
            health->longest_rounds =
                (uint8_t)(health->unchanged_rounds < LONGEST ? health->unchanged_rounds : LONGEST);
        }
        start_unchanged(health);
        return;
    }
    health->unchanged = unchanged;
    health->unchanged_rounds = (uint16_t)(health->unchanged_rounds + (health->unchanged_rounds < UINT16_MAX));
    // A worn sensor's electrode hardly ever repeats its word four times, a quiet one's did so 64 times.
    bool lasts =
        health->unchanged_rounds > FROZEN_ROUNDS && health->unchanged_rounds > 3 * health->longest_rounds;
    if (health->travel_q2 >= TRAVEL_Q2 && lasts) {
        if (bt_usable_without(unchanged)) {
            condemn(health, unchanged, BT_SENSOR_FAULT_STUCK);
        }
        start_unchanged(health);
    }
}

static void judge_frozen(bt_health *health, uint32_t without)
{
    if (health->same != ALL_ELECTRODES || (without & ~health->out)) {
        health->alive_rounds = (uint8_t)(health->alive_rounds + (health->alive_rounds < ALIVE_ROUNDS));
        health->same_rounds = 0;
        if (health->sensor_fault == BT_SENSOR_FAULT_FROZEN) {
            health->sensor_fault = BT_SENSOR_FAULT_NONE;
        }
    } else if (health->alive_rounds == ALIVE_ROUNDS && ++health->same_rounds >= FROZEN_ROUNDS) {
        health->same_rounds = FROZEN_ROUNDS;
        health->sensor_fault = BT_SENSOR_FAULT_FROZEN;
    }
}

// ---- words that jump back and forth --------------------------------------------------------------

static BT_NOINLINE void judge_flips(bt_health *health, uint32_t flips, bool window_ends)
{
    health->flipping = false;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        unsigned count = health->flips[i];
        count -= window_ends ? (count < FLIP_DECAY ? count : FLIP_DECAY) : 0;
        count += flips >> i & 1 && count < FLIPS_MOST ? FLIP : 0;
        health->flips[i] = (uint8_t)count;
        health->flipping = health->flipping || count > 0;
        if (count >= FLIPPED && !(health->out >> i & 1)) {
            condemn(health, 1u << i, BT_SENSOR_FAULT_NOISY);
        }
    }
    if (!bt_usable_without(health->out) && health->electrode_fault == BT_SENSOR_FAULT_NOISY) {
        health->sensor_fault = BT_SENSOR_FAULT_NOISY;
    }
}

// ---- words that move -----------------------------------------------------------------------------

// What the electrodes moved by since the anchors, in the window's unit.
typedef struct {
    uint32_t total;
    uint32_t top;        // the largest move
    uint32_t loud;       // those that may have moved alone: a bit mask,
    uint32_t loud_total; // their sum,
    uint32_t loud_least; // and the least of them
    uint32_t others;     // sum without those, and without the largest
    int32_t along;       // sum with signs
    uint32_t pressure;
    uint32_t times; // of the others, up to which a move is not alone
    uint32_t alone,
        noise; // limits: what noise may hide of a move that is not alone, and what it makes of a sum
} moves;

// A move of one electrode is the difference of two sums of noise, whose deviation here is `sd`. 18 of them
// make 14.4 +- 2.6 of it, so that a sum of real moves may hide up to 4 of it below NOISE_SDS; eight times
// that is ALONE_SDS.
#define NOISE_SDS 17
#define ALONE_SDS 31

static moves moves_of(const bt_health_window *window, unsigned bits, uint32_t sd, uint32_t without,
                      bool pressure)
{
    moves of = {.loud_least = UINT32_MAX, .noise = NOISE_SDS * sd, .alone = ALONE_SDS * sd};
    of.alone = of.alone < ALONE << bits ? ALONE << bits : of.alone;
    of.times = pressure ? ALONE_TIMES : ALONE_TIMES_BLIND;
    of.alone *= of.times / ALONE_TIMES;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        int32_t move = window->sum.lane[i] - window->anchor.lane[i];
        uint32_t size = bt_abs32(move);
        if (without >> i & 1) {
            continue;
        }
        of.total += size;
        of.along += move;
        of.top = size > of.top ? size : of.top;
        if (size > of.alone) {
            of.loud |= 1u << i;
            of.loud_total += size;
            of.loud_least = size < of.loud_least ? size : of.loud_least;
        }
    }
    of.others = of.total - (of.loud == 0 ? of.top : of.loud_total);
    of.pressure = bt_abs32(window->sum.lane[BT_LANE_PDC] - window->anchor.lane[BT_LANE_PDC]);
    return of;
}

static uint32_t less(uint32_t a, uint32_t b)
{
    return a > b ? a - b : 0;
}

// The electrodes that moved alone.
static uint32_t alone(const moves *of, unsigned bits)
{
    uint32_t others = less(of->others, of->noise) + less(of->pressure, PRESSURE << bits);
    bool far = of->loud_least > of->alone + of->times * others;
    return of->loud != 0 && bt_usable_without(of->loud) && far ? of->loud : 0;
}

static bool still(const moves *of, unsigned bits)
{
    return of->loud == 0 && of->others <= (MOVED << bits) + of->noise && of->pressure <= PRESSURE << bits;
}

// Judge whether all electrodes move together, by more than pressure explains: a press over no electrode moves
// them by at most a fifth of a count per count of pressure. True if the anchors are to stay, because it is
// too early to tell.
static bool together(bt_health *health, const moves *of, int tdc)
{
    uint32_t along = bt_abs32(of->along);
    uint32_t mean = along / BT_ELECTRODES;
    uint32_t least = (health->pressure_alive ? TOGETHER : TOGETHER_BLIND) << FAST_BITS;
    uint32_t alike = along + along / 8;
    bool warmed = tdc - health->anchor_tdc > WARMED || health->anchor_tdc - tdc > WARMED;
    if (warmed || health->anchor_rounds > TOGETHER_ROUNDS || of->total > alike + of->noise) {
        return false;
    }
    if (mean >= least + of->pressure / 4 && of->top < 2 * mean + of->noise / 8
        && of->total < alike + of->noise / 8) {
        health->sensor_fault = BT_SENSOR_FAULT_TOGETHER;
        return false;
    }
    return of->pressure <= PRESSURE << FAST_BITS;
}

static void judge_fast(bt_health *health, uint32_t without, uint16_t tdc)
{
    uint32_t sd = health->fast_sd;
    sd += health->rounds < WINDOW_ROUNDS ? sd / 2 : 0;
    moves of = moves_of(&health->fast, FAST_BITS, sd, without, health->pressure_alive);
    uint32_t lone = alone(&of, FAST_BITS);
    health->alone_fast = lone & (health->suspect | health->alone_fast);
    health->suspect = lone & ~health->alone_fast;
    if (lone != 0 || still(&of, FAST_BITS)) {
        return;
    }
    uint32_t travel = health->travel_q2 + of.total;
    health->travel_q2 = (uint16_t)(travel < UINT16_MAX ? travel : UINT16_MAX);
    if (!together(health, &of, tdc)) {
        health->fast.anchor = health->fast.sum;
        health->anchor_tdc = tdc;
        health->anchor_rounds = 0;
    }
}

static void judge_slow(bt_health *health, uint32_t without)
{
    moves of = moves_of(&health->slow, SLOW_BITS, health->slow_sd, without, health->pressure_alive);
    uint32_t lone = alone(&of, SLOW_BITS);
    health->pressure_alive = health->pressure_alive || of.pressure > PRESSED << SLOW_BITS;
    health->alone_slow = lone;
    if (lone == 0 && !still(&of, SLOW_BITS)) {
        health->slow.anchor = health->slow.sum;
    }
}

static BT_NOINLINE void make_limits(bt_health *health, uint32_t noise_count2)
{
    uint32_t count2_q8 = (noise_count2 << 8) / BT_ELECTRODES;
    uint32_t sigma_q4 = noise_count2 == 0 ? 5 * 16 : bt_root_u32(count2_q8);
    health->noise_count2 = noise_count2;
    health->fast_sd = (uint16_t)((sigma_q4 * 45 + (1 << 7)) >> 8); // sqrt(2 * 4) sigma
    health->slow_sd = (uint16_t)((sigma_q4 + 2) >> 2);             // sqrt(2 * 32) / 2 sigma
}

// ---- condemned electrodes --------------------------------------------------------------------------

static BT_NOINLINE void watch_condemned(bt_health *health, const bt_round *round, bool window_ends)
{
    bool calm = true;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        if (!(health->out >> i & 1)) {
            continue;
        }
        uint16_t count = round->electrode[i];
        calm = calm && bt_count_usable(count);
        health->fast.sum.lane[i] =
            (uint16_t)(4 * (bt_count_usable(count) ? count : 0)); // of this round alone
        if (window_ends) {
            int32_t move_q2 = health->fast.sum.lane[i] - health->fast.anchor.lane[i];
            if (bt_abs32(move_q2) > CALM_Q2 + 12u * health->fast_sd) {
                health->fast.anchor.lane[i] = health->fast.sum.lane[i];
                calm = false;
            }
        }
    }
    if (!calm || (health->same & health->out)) {
        health->calm_windows = calm ? health->calm_windows : 0;
    } else if (window_ends && health->calm_windows < CALM_WINDOWS) {
        health->calm_windows++;
    }
}

uint32_t bt_health_back(bt_health *health)
{
    if (health->out == 0 || health->calm_windows < CALM_WINDOWS) {
        return 0;
    }
    uint32_t back = health->out;
    health->out = 0;
    health->electrode_fault = BT_SENSOR_FAULT_NONE;
    health->sensor_fault = BT_SENSOR_FAULT_NONE;
    memset(health->flips, 0, sizeof health->flips);
    return back;
}

static BT_NOINLINE void end_window(bt_health *health, uint32_t without, uint16_t tdc)
{
    if (!health->anchored) {
        health->fast.anchor = health->fast.sum;
        health->anchor_tdc = tdc;
    } else {
        judge_fast(health, without, tdc);
    }
    // Halves, so that the sum of eight windows fits; the one bit that an unread lane may carry is 1/16 count.
    for (unsigned k = 0; k < BT_LANES / 2; k++) {
        health->slow.sum.pair[k] += health->fast.sum.pair[k] >> 1 & 0x7FFF7FFF;
        health->fast.sum.pair[k] = 0;
    }
    health->rounds = 0;
    if (++health->windows < SLOW_WINDOWS) {
        return;
    }
    if (!health->anchored) {
        health->anchored = true;
        health->slow.anchor = health->slow.sum;
    } else {
        judge_slow(health, without);
    }
    memset(&health->slow.sum, 0, sizeof health->slow.sum);
    health->windows = 0;
}

void bt_health_round(bt_health *health, const bt_round *round, bt_trigger *trigger, const bt_noise *noise,
                     bool touched)
{
    judge_frozen(health, trigger->without);
    judge_repeats(health, trigger->without);
    if (health->sensor_fault == BT_SENSOR_FAULT_FROZEN) {
        trigger->without = ALL_ELECTRODES;
        return;
    }
    if (noise->count2 != health->noise_count2) {
        make_limits(health, noise->count2);
    }
    BT_UNROLL
    for (unsigned k = 0; k < BT_LANES / 2; k++) {
        health->fast.sum.pair[k] += trigger->smooth.pair[k];
    }
    health->rounds++;
    health->anchor_rounds = (uint8_t)(health->anchor_rounds + (health->anchor_rounds < UINT8_MAX));
    bool window_ends = health->rounds == WINDOW_ROUNDS || (health->suspect && health->rounds == HALF_WINDOW);
    uint32_t flips = (trigger->up & health->down) | (trigger->down & health->up);
    health->up = trigger->up;
    health->down = trigger->down;
    if (flips != 0 || health->flipping) {
        judge_flips(health, flips, window_ends);
    }
    for (unsigned k = 0; window_ends && health->rounds < WINDOW_ROUNDS && k < BT_LANES / 2; k++) {
        health->fast.sum.pair[k] *= WINDOW_ROUNDS / HALF_WINDOW;
    }
    if (health->out != 0) {
        watch_condemned(health, round, window_ends);
    }
    if (window_ends) {
        end_window(health, (trigger->unknown & ALL_ELECTRODES) | health->out, round->tdc);
        // A tip no wider than an electrode that slides over it moves it alone, too; where nothing touches,
        // nothing slides.
        uint32_t lone = health->alone_fast | health->alone_slow;
        health->alone |= lone;
        if (!touched && lone != 0) {
            condemn(health, lone, BT_SENSOR_FAULT_ALONE);
        }
    }
}
