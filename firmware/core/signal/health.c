#include "signal/health.h"

#include "fixed_point.h"

#include <string.h>

#define HALF (BT_LANES / 2) // electrodes whose means have their turn at once

#define SUM_BITS      2 // of a count in a window's unit
#define MEAN_BITS     4
#define CLEAN_WINDOWS 2  // after an electrode's first word, until a whole window is its
#define MEAN_WINDOWS  10 // until a running mean is one

#define ALONE_TIMES 8
#define BLIND       2   // times that, and the limit, while static pressure has not shown that it works
#define ALONE       20u // counts
#define MOVED       16u // counts: sum of what the others move by before windows are compared with a later one
#define PRESSURE    4u  // counts: static pressure that moves less is quiet

#define ALIVE_WINDOWS 16
#define DEAD_WINDOWS  250 // of a sensor that has never changed its words: ten seconds
#define STUCK_WINDOWS 3   // with the one before: a live electrode hardly ever repeats its word sixteen times
#define NOISY         32  // count^2 of all electrodes' noise: one in 1000 windows repeats by chance
#define HALTED_Q4     (28 * 16) // by which a running mean is behind an electrode that moved lately
#define TRAVEL_Q2     (100 * 4) // sum of what the others move by while an electrode is stuck
#define CALM_WINDOWS  50        // two seconds
#define CALM_Q2       (5 * 4)
#define CALM_ROUNDS   12 // since a touch
#define CALM_LOST     4  // of them, by a round of one

#define TOGETHER         5u  // counts
#define TOGETHER_BLIND   25u // while static pressure has not shown that it works
#define WARMED           3   // counts of TDC
#define PRESSED          12u // counts: static pressure that has moved so far works
#define TOGETHER_WINDOWS 9   // 14 counts/s: a hot cup does up to 10

#define SHAKEN_ROUNDS 8
#define FLIP_WINDOWS  8 // in which no live electrode jumps back and forth three times

void bt_health_reset(bt_health *health)
{
    memset(health, 0, sizeof *health);
    health->noise_count2 = UINT32_MAX; // limits are not made yet
}

static void condemn(bt_health *health, uint32_t electrodes, uint8_t fault)
{
    health->out |= electrodes;
    health->electrode_fault = fault;
    health->calm_windows = 0;
    health->suspect = health->mean_suspect = 0;
    health->alone &= ~electrodes;
}

static uint8_t counted(uint8_t count)
{
    return (uint8_t)(count + (count < UINT8_MAX));
}

// ---- words that jump back and forth --------------------------------------------------------------

// Shaken skin does so, too, with pressure: then it is only suspected.
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

// A suspicion, before it lasts: electrodes that moved lately, and now say one count while the skin moves on.
static BT_NOINLINE uint32_t halted(const bt_health *health, const bt_lanes *sum)
{
    const bt_lanes *now = &health->sum[health->filling]; // of three rounds
    uint32_t halted = 0;
    for (unsigned i = 0; health->same >> i != 0; i++) {
        uint32_t lag_q4 = bt_abs32(health->mean.lane[i] - 4 * sum->lane[i]);
        bool still = 4 * now->lane[i] == 3 * sum->lane[i];
        halted |= still && lag_q4 > HALTED_Q4 ? health->same & 1u << i : 0;
    }
    return bt_usable_without(halted) ? halted : 0;
}

static void judge_repeats(bt_health *health, uint32_t missing)
{
    bool frozen = (health->same | health->out) == BT_ALL_ELECTRODES && missing == 0;
    uint32_t unchanged = health->unchanged & health->same;
    if (unchanged == 0) {
        if (bt_usable_without(health->unchanged) && health->unchanged_windows > health->longest) {
            health->longest = health->unchanged_windows;
        }
        unchanged = health->same;
        health->unchanged_windows = 0;
        health->travel_q2 = 0;
    }
    health->unchanged = unchanged;
    health->unchanged_windows = unchanged == 0 ? 0 : counted(health->unchanged_windows);
    bool alive = health->alive_windows == ALIVE_WINDOWS, dead = health->alive_windows == 0;
    if (!frozen && health->windows > CLEAN_WINDOWS) {
        health->alive_windows = (uint8_t)(health->alive_windows + !alive);
        if (health->sensor_fault == BT_SENSOR_FAULT_FROZEN) {
            health->sensor_fault = BT_SENSOR_FAULT_NONE;
        }
    } else if (frozen && (alive || (dead && health->unchanged_windows >= DEAD_WINDOWS))) {
        health->sensor_fault = BT_SENSOR_FAULT_FROZEN;
    }
    // A worn sensor's electrode hardly ever repeats its word four times, a quiet one's did so 64 times.
    bool lasts =
        health->unchanged_windows >= STUCK_WINDOWS && health->unchanged_windows > 2 * health->longest;
    uint32_t travel_q2 = health->unchanged_windows < ALIVE_WINDOWS ? TRAVEL_Q2 : TRAVEL_Q2 / 2;
    if (lasts && health->travel_q2 >= travel_q2 && bt_usable_without(unchanged)) {
        condemn(health, unchanged, BT_SENSOR_FAULT_STUCK);
    }
}

// ---- words that move -----------------------------------------------------------------------------

// A move of one electrode is the difference of two sums of noise, whose deviation here is `sd`. 18 of them
// make 14.4 +- 2.6 of it, so that a sum of real moves may hide up to 4 of it below NOISE_SDS; eight times
// that is ALONE_SDS.
#define NOISE_SDS 17
#define ALONE_SDS 31

static uint32_t less(uint32_t a, uint32_t b)
{
    return a > b ? a - b : 0;
}

typedef struct {
    const bt_moves *moves;
    const bt_lanes *now, *anchor;
    uint32_t pressure, noise, limit;
    unsigned bits; // of a count in the unit
} window;

// The electrodes that moved alone; in *still, whether nothing moved.
static BT_NOINLINE uint32_t alone(const bt_health *health, const window *of, bool *still)
{
    uint32_t loud = 0, least = UINT32_MAX, others = of->moves->total;
    for (unsigned i = 0; of->moves->top > of->limit && i < BT_ELECTRODES; i++) {
        uint32_t size = bt_abs32(of->now->lane[i] - of->anchor->lane[i]);
        if (size > of->limit && !((health->unknown | health->out) >> i & 1)) {
            loud |= 1u << i;
            others -= size;
            least = size < least ? size : least;
        }
    }
    others -= loud == 0 ? of->moves->top : 0;
    *still = loud == 0 && others <= (MOVED << of->bits) + of->noise && of->pressure <= PRESSURE << of->bits;
    uint32_t moved = less(others, of->noise) + less(of->pressure, PRESSURE << of->bits);
    uint32_t times = health->pressure_alive ? ALONE_TIMES : ALONE_TIMES * BLIND;
    return loud != 0 && bt_usable_without(loud) && least > of->limit + times * moved ? loud : 0;
}

static uint32_t pressure_move(const bt_health *health, const bt_lanes *now, const bt_lanes *anchor)
{
    bool read = !(health->unknown >> BT_LANE_PDC & 1);
    return !read ? 0 : bt_abs32(now->lane[BT_LANE_PDC] - anchor->lane[BT_LANE_PDC]);
}

// Judge whether all electrodes move together, by more than pressure explains: a press over no electrode moves
// them by at most a fifth of a count per count of pressure. True if the anchors are to stay, because it is
// too early to tell.
static bool together(bt_health *health, uint32_t noise, uint32_t pressure, int tdc)
{
    const bt_moves *moves = &health->moves;
    uint32_t along = bt_abs32(moves->along);
    uint32_t mean = along / BT_ELECTRODES;
    uint32_t least = (health->pressure_alive ? TOGETHER : TOGETHER_BLIND) << SUM_BITS;
    uint32_t alike = along + along / 8;
    bool warmed = tdc - health->anchor_tdc > WARMED || health->anchor_tdc - tdc > WARMED;
    if (warmed || health->moved_windows > TOGETHER_WINDOWS || moves->total > alike + noise) {
        return false;
    }
    if (mean >= least + pressure / 4 && 2 * moves->top < 3 * mean + noise / 4
        && moves->total < alike + noise / 8) {
        health->sensor_fault = BT_SENSOR_FAULT_TOGETHER;
        return false;
    }
    return pressure <= PRESSURE << SUM_BITS;
}

// What all electrodes have crept by since is no move of one: the anchors follow it, up to 6 counts/s.
static void follow(bt_lanes *anchor, const bt_moves *moves, uint32_t step)
{
    uint16_t pressure = anchor->lane[BT_LANE_PDC];
    if (bt_abs32(moves->along) < moves->top + (BT_ELECTRODES - 1) * step) { // not all of them
        return;
    }
    step |= step << 16;
    for (unsigned k = 0; k < BT_LANES / 2; k++) {
        anchor->pair[k] += moves->along < 0 ? 0 - step : step;
    }
    anchor->lane[BT_LANE_PDC] = pressure;
}

static uint32_t judge_sums(bt_health *health, const bt_lanes *sum, uint16_t tdc)
{
    window of = {&health->moves,
                 sum,
                 &health->anchor,
                 pressure_move(health, sum, &health->anchor),
                 NOISE_SDS * (uint32_t)health->sum_sd,
                 health->sum_limit,
                 SUM_BITS};
    bool still;
    uint32_t now = alone(health, &of, &still);
    uint32_t sure = health->pressure_alive ? now : now & health->suspect;
    health->suspect = now;
    health->moved_windows = still ? 0 : counted(health->moved_windows);
    if (still) {
        follow(&health->anchor, &health->moves, 1);
    }
    if (now != 0 || still) {
        return sure;
    }
    uint32_t travel = health->travel_q2 + health->moves.total;
    health->travel_q2 = (uint16_t)(travel < UINT16_MAX ? travel : UINT16_MAX);
    if (!together(health, of.noise, of.pressure, tdc)) {
        health->anchor = *sum;
        health->anchor_tdc = tdc;
    }
    return 0;
}

static uint16_t limit_of(uint32_t sd, unsigned bits, bool blind)
{
    uint32_t limit = ALONE_SDS * sd;
    limit = limit < ALONE << bits ? ALONE << bits : limit;
    limit *= blind ? BLIND : 1;
    return (uint16_t)(limit < UINT16_MAX ? limit : UINT16_MAX);
}

static void make_limits(bt_health *health, uint32_t noise_count2)
{
    uint32_t count2_q8 = (noise_count2 << 8) / BT_ELECTRODES;
    uint32_t sigma_q4 = noise_count2 == 0 ? 5 * 16 : bt_root_u32(count2_q8);
    health->noise_count2 = noise_count2;
    health->sum_sd = (uint16_t)((sigma_q4 * 45 + (1 << 7)) >> 8);  // sqrt(2 * 4) sigma
    health->mean_sd = (uint16_t)((sigma_q4 * 68 + (1 << 7)) >> 8); // sqrt(2 / 28) sigma
    health->sum_limit = limit_of(health->sum_sd, SUM_BITS, !health->pressure_alive);
    health->mean_limit = limit_of(health->mean_sd, MEAN_BITS, !health->pressure_alive);
}

static uint32_t judge_means(bt_health *health)
{
    window of = {&health->mean_moves,
                 &health->mean,
                 &health->mean_anchor,
                 pressure_move(health, &health->mean, &health->mean_anchor),
                 NOISE_SDS * (uint32_t)health->mean_sd,
                 health->mean_limit,
                 MEAN_BITS};
    bool still;
    uint32_t now = alone(health, &of, &still);
    uint32_t sure = now & health->mean_suspect;
    health->mean_suspect = now;
    if (!health->pressure_alive && of.pressure > PRESSED << MEAN_BITS) {
        health->pressure_alive = true;
        make_limits(health, health->noise_count2);
    }
    if ((now == 0 && !still) || health->windows < MEAN_WINDOWS) {
        uint16_t pressure = health->mean_anchor.lane[BT_LANE_PDC];
        health->mean_anchor = health->mean;
        if (!health->pressure_alive && !still) { // of a slow press all of it counts
            health->mean_anchor.lane[BT_LANE_PDC] = pressure;
        }
        sure = 0;
    } else if (still) {
        follow(&health->mean_anchor, &health->mean_moves, 8);
    }
    return sure;
}

// ---- condemned electrodes --------------------------------------------------------------------------

// Calm, and where it rests: what pressed an electrode alone may still press it, if static pressure has
// failed.
static void watch_condemned(bt_health *health, const bt_round *round, const bt_lanes *rest)
{
    bool calm = true, repeats = false, few = bt_usable_without(health->out);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        if (!(health->out >> i & 1)) {
            continue;
        }
        uint16_t count = round->electrode[i];
        bool usable = bt_count_usable(count);
        uint16_t count_q2 = (uint16_t)((usable ? count : 1) << SUM_BITS);
        if (!usable || bt_abs32(count_q2 - health->anchor.lane[i]) > CALM_Q2 + 12u * health->sum_sd) {
            health->anchor.lane[i] = count_q2;
            calm = false;
        }
        calm = calm && !(few && bt_abs32(count - rest->lane[i]) > BT_TRIGGER_FAR);
        repeats = repeats || count_q2 == health->mean_anchor.lane[i];
        health->mean_anchor.lane[i] = count_q2;
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

static void anchor_all(bt_health *health, const bt_lanes *sum, uint16_t tdc)
{
    health->anchor = *sum;
    for (unsigned k = 0; k < BT_LANES / 2; k++) { // without the bits that an unread lane's would carry
        health->mean.pair[k] = (sum->pair[k] & 0x3FFF3FFF) << (MEAN_BITS - SUM_BITS);
    }
    health->mean_anchor = health->mean;
    health->anchor_tdc = tdc;
    health->suspect = health->mean_suspect = 0;
}

static BT_NOINLINE uint32_t judge(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                                  const bt_noise *noise, const bt_lanes *sum)
{
    uint32_t lone = 0;
    if (trigger->unknown != health->unknown) {
        health->unknown = trigger->unknown;
        health->windows = 0;
    }
    if (noise->count2 != health->noise_count2) {
        make_limits(health, noise->count2);
    }
    if (health->windows > CLEAN_WINDOWS) {
        lone = judge_sums(health, sum, round->tdc);
    } else if (health->windows == CLEAN_WINDOWS) {
        anchor_all(health, sum, round->tdc);
    }
    health->windows = counted(health->windows);
    judge_repeats(health, trigger->without & ~health->out);
    if (health->same != 0 && health->moved_windows != 0 && health->noise_count2 >= NOISY) {
        health->alone |= halted(health, sum);
    }
    if (health->out != 0) {
        watch_condemned(health, round, &trigger->rest);
    }
    if (++health->judged % FLIP_WINDOWS == 0) {
        memset(health->flips, 0, sizeof health->flips);
    }
    return lone;
}

// What is not used has not moved.
static void leave_out(bt_lanes *now, const bt_lanes *anchor, uint32_t without)
{
    for (unsigned i = 0; without >> i != 0; i++) {
        if (without >> i & 1) {
            now->lane[i] = anchor->lane[i];
        }
    }
}

static uint32_t turn_of_means(bt_health *health, uint32_t without)
{
    if (health->judged & 1) {
        leave_out(&health->mean, &health->mean_anchor, without);
        bt_moves_add(&health->mean_moves, &health->mean, &health->mean_anchor, 0, HALF);
        return 0;
    }
    bt_moves_add(&health->mean_moves, &health->mean, &health->mean_anchor, HALF, BT_ELECTRODES);
    return health->windows > CLEAN_WINDOWS ? judge_means(health) : 0;
}

void bt_health_round(bt_health *health, const bt_round *round, const bt_trigger *trigger,
                     const bt_noise *noise, bool touched)
{
    const bt_lanes *smooth = &trigger->smooth;
    bt_lanes *sum = &health->sum[health->filling];
    bt_lanes *before = &health->sum[!health->filling];
    uint32_t without = (trigger->unknown | health->out) & BT_ALL_ELECTRODES;
    uint32_t lone = 0;
    uint8_t leap = bt_leap_round(&health->leap, round, trigger);
    health->exchanged = health->exchanged || leap == BT_SENSOR_FAULT_EXCHANGED;
    if (leap == BT_SENSOR_FAULT_TOGETHER) {
        health->sensor_fault = leap;
    }
    uint32_t flips = (trigger->up & health->down) | (trigger->down & health->up);
    health->up = trigger->up;
    health->down = trigger->down;
    health->still_rounds = trigger->far >> BT_LANE_PDC & 1 ? 0 : counted(health->still_rounds);
    if (flips != 0) {
        judge_flips(health, flips, health->still_rounds <= SHAKEN_ROUNDS);
    }
    switch (++health->rounds) {
    case 1:
        health->same = bt_window_begin(sum, before, smooth) & ~without;
        bt_mean_add(&health->mean, before, health->judged & 1 ? HALF : 0);
        break;
    case 2:
        bt_window_add(sum, smooth);
        leave_out(before, &health->anchor, without);
        bt_moves_add(&health->moves, before, &health->anchor, 0, BT_ELECTRODES);
        break;
    case 3:
        bt_window_add(sum, smooth);
        lone = judge(health, round, trigger, noise, before);
        break;
    default:
        bt_window_add(sum, smooth);
        lone = turn_of_means(health, without);
        health->filling = !health->filling;
        health->rounds = 0;
    }
    health->alone |= lone;
    if (touched) { // by noise of pressure, too, which is no touch
        health->calm_rounds =
            health->calm_rounds < CALM_LOST ? 0 : (uint8_t)(health->calm_rounds - CALM_LOST);
        health->was_touched = health->was_touched || health->calm_rounds == 0;
    } else if (health->calm_rounds < CALM_ROUNDS && ++health->calm_rounds == CALM_ROUNDS
               && health->was_touched) {
        health->was_touched = false;
        anchor_all(health, before, round->tdc); // where a tip no wider than an electrode moved it is over
    }
    if (lone != 0 && health->calm_rounds == CALM_ROUNDS) {
        condemn(health, lone, BT_SENSOR_FAULT_ALONE);
    }
}
