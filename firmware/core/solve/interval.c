#include "solve/interval.h"

#include "fixed_point.h"
#include "map/population.h"
#include "wire/sensor_gen.h"

#define UNKNOWN BT_INVALID_COUNT
#define TOP     (UNKNOWN - 1u)

// What each cause adds. Fitted by `biotac-lab interval`, which prints how often left-out frames are within.
#define LIN_HIDDEN_MN       4000u // of the normal
#define LIN_SHEAR_Q8        102u  // of what is hidden
#define AWAY_NORMAL_Q8      179u  // of the strength, away from the population map's training
#define AWAY_SHEAR_Q8       77u
#define LIGHT_MN            1500u
#define TIP_UM              2048u // from there on the press at the tip is as little known as anywhere
#define TIP_Q8              51u   // of the normal
#define PRESSURE_Q3         13u   // where a newton makes least pressure, in eighths of what is usual
#define PRESSURE_MN         200u  // by as much pressure at rest may have drifted
#define LACKS_MN            500u
#define OUT_Q8              16u   // of the force, for each electrode that is out
#define NOISE_MN_PER_COUNT  16u   // two standard deviations of the force by any source, for one of the counts
#define UNCONFIRMED_TARE_MN 2000u // half a firm hold

const bt_margin bt_lin_margin = {.base_mn = {0, 0}, .share_q8 = {0, 64}};

// ---- the two parts -------------------------------------------------------------------------------------

#define UNIT_BITS    14 // of a normal
#define PER_UM_BITS  15
#define UNITS_PER_UM ((1 << (UNIT_BITS + PER_UM_BITS)) / BT_CORE_RADIUS_UM)
#define UNIT_MAX     ((1ll << UNIT_BITS) + 8) // of a normal of poc_um, which is rounded to 1 um on each axis

_Static_assert((BT_CORE_RADIUS_UM + 2ll) * UNITS_PER_UM + (1 << (PER_UM_BITS - 1)) <= INT32_MAX,
               "a unit must fit");
_Static_assert(3 * (int64_t)BT_GRIP_MAX_MN * BT_GRIP_MAX_MN <= UINT32_MAX / 1001 * 1000, "a square must fit");
// The normal's components add up to at most root 3; 1733 / 1000 is a little more.
_Static_assert(BT_GRIP_MAX_MN * UNIT_MAX * 1733 / 1000 + (1 << (UNIT_BITS - 1)) <= INT32_MAX,
               "a part must fit");
_Static_assert((BT_GRIP_MAX_MN * 1733ll / 1000 + 64) * UNIT_MAX + (1 << (UNIT_BITS - 1)) <= INT32_MAX,
               "a part along an axis must fit");

// A tenth: x * (2^33 / 10) / 2^33.
static uint32_t tenth(uint32_t strength_100un)
{
    return bt_scale(strength_100un, 0x3333, 0x3333, 1);
}

// Not inlined: three of it are long.
static BT_NOINLINE int32_t to_mn(int32_t force_100un)
{
    uint32_t mn = tenth(bt_abs32(force_100un));
    return bt_with_sign(bt_at_most(mn, BT_GRIP_MAX_MN), force_100un);
}

static int32_t rounded(int32_t value, int bits)
{
    return bt_shift_down(value + (1 << (bits - 1)), bits);
}

static uint32_t square_root(uint32_t square)
{
    uint32_t root = bt_root_u32(square);
    return root + (square - root * root > root);
}

// ---- the interval --------------------------------------------------------------------------------------

// guess_mn of a source: the strength of all signals is at most 30.3 N (map/population.c), and what electrodes
// that are out had of a map is at most 12.3 N (results.c).
#define GUESS_MAX_MN   43000u
#define PRESSED_MAX_MN (BT_FULL_SCALE_COUNT * (BT_SETTING_PRESSURE_GAIN_NN_MAX / 1000000ll + 1))
#define SIZE_MAX_MN    (2 * (BT_GRIP_MAX_MN * 1733ll / 1000 + 64))
_Static_assert(SIZE_MAX_MN *(BT_MARGIN_SHARE_MAX_Q8 + OUT_Q8 * BT_ELECTRODES) + 128 <= INT32_MAX,
               "a share must fit");
_Static_assert((65535ll + 16) * NOISE_MN_PER_COUNT + 65535 + GUESS_MAX_MN + UNCONFIRMED_TARE_MN
                       + 3 * SIZE_MAX_MN + PRESSED_MAX_MN * PRESSURE_Q3 / 8
                       + (SIZE_MAX_MN * (BT_MARGIN_SHARE_MAX_Q8 + OUT_Q8 * BT_ELECTRODES) >> 8)
                   <= UINT32_MAX,
               "a sum must fit");

static uint16_t half_mn(const bt_uncertainty *uncertainty, int part, uint32_t size_mn, uint32_t beyond_mn)
{
    const bt_margin *margin = uncertainty->margin;
    if (margin->base_mn[part] == UNKNOWN) {
        return UNKNOWN;
    }
    uint32_t share_q8 = margin->share_q8[part] + OUT_Q8 * uncertainty->out;
    uint32_t half = margin->base_mn[part] + ((share_q8 * size_mn + 128) >> 8) + uncertainty->guess_mn[part]
                    + beyond_mn + ((uncertainty->noise_q4 * NOISE_MN_PER_COUNT) >> 4)
                    + (uncertainty->tare_unconfirmed ? UNCONFIRMED_TARE_MN : 0);
    return (uint16_t)bt_at_most(half, TOP);
}

void bt_lin_guess(uint32_t strength_100un, uint32_t guess_mn[2])
{
    uint32_t strength_mn = tenth(strength_100un);
    guess_mn[0] = bt_at_most(strength_mn, LIN_HIDDEN_MN);
    guess_mn[1] = (guess_mn[0] * LIN_SHEAR_Q8) >> 8;
}

void bt_population_guess(uint32_t share, bool outside, uint32_t strength_100un, uint32_t guess_mn[2])
{
    uint32_t strength_mn = tenth(strength_100un), away_q8 = 256 - share;
    guess_mn[0] = outside ? strength_mn : (strength_mn * (away_q8 * AWAY_NORMAL_Q8)) >> 16;
    guess_mn[1] = outside ? strength_mn : (strength_mn * (away_q8 * AWAY_SHEAR_Q8)) >> 16;
}
_Static_assert(GUESS_MAX_MN * 256ull * AWAY_NORMAL_Q8 <= UINT32_MAX, "a guess must fit");

// What pressure allows beyond a guess and what else is known: more, up to what the source lacks, and less.
static BT_NOINLINE uint32_t by_pressure(const bt_uncertainty *uncertainty, uint32_t normal, uint32_t known,
                                        uint32_t lacks)
{
    const uint32_t usual = (uint32_t)uncertainty->pressed_mn, most = usual * PRESSURE_Q3 >> 3;
    return bt_at_most(lacks, bt_excess(most, normal + known + uncertainty->guess_mn[0]))
           + bt_excess(2 * normal, 4 * usual);
}

// What the population map does not feel, or feels too much of: much of a pull, which at the tip reads as a
// press instead; a press at the tip; and much of a light touch. Where pressure is known, it says which touch
// is light; and that a narrow tip or an edge presses, which move few electrodes and the fluid as a plate
// does.
static void add_unfelt(const bt_uncertainty *uncertainty, int16_t x_um, uint32_t normal, uint32_t shear,
                       uint32_t beyond_mn[2])
{
    const uint32_t pull = bt_excess(5 * shear, normal) >> 3, ahead_um = x_um > 0 ? (uint32_t)x_um : 0;
    const uint32_t ahead = pull * ahead_um >> 12, tip_um = bt_at_most(ahead_um, TIP_UM);
    const uint32_t tip = (normal * tip_um >> 11) * TIP_Q8 >> 8;
    uint32_t unfelt = bt_excess(LIGHT_MN, normal + shear) >> 1;
    if (uncertainty->pressed_mn >= 0) {
        const uint32_t usual = (uint32_t)uncertainty->pressed_mn;
        const uint32_t odd = (uncertainty->off_100un * (TIP_UM - tip_um) >> 11) * 13 >> 7; // mN
        const uint32_t lacks = bt_excess(2 * usual, 7 * normal / 2 + LACKS_MN) + odd;
        unfelt = bt_at_most(unfelt, usual / 2 + PRESSURE_MN);
        unfelt += by_pressure(uncertainty, normal, ahead + tip + unfelt, lacks);
    }
    beyond_mn[0] += ahead + tip + unfelt;
    beyond_mn[1] += ahead + pull;
}
_Static_assert(5 * SIZE_MAX_MN / 8 * (BT_CORE_RADIUS_UM + 8) <= UINT32_MAX, "a pull at the tip must fit");
_Static_assert(1ull * SIZE_MAX_MN * TIP_UM <= UINT32_MAX, "a press at the tip must fit");
_Static_assert(GUESS_MAX_MN * 10ull * TIP_UM <= UINT32_MAX, "a distance from the normals must fit");

void bt_grip_unknown(bt_msg_frame *msg)
{
    msg->normal_mn = msg->normal_half_mn = msg->shear_mn = msg->shear_half_mn = UNKNOWN;
}

void bt_grip(const bt_uncertainty *uncertainty, bt_msg_frame *msg)
{
    if (msg->poc_um[0] == BT_INVALID_I16 || msg->force_100un[0] == BT_INVALID_I32) {
        bt_grip_unknown(msg);
        return;
    }
    int32_t force_mn[3], n[3], against = 0; // the force along n
    uint32_t square = 0;
    for (int d = 0; d < 3; d++) {
        bool counts = d > 0 || msg->poc_um[0] > 0;
        n[d] = counts ? rounded(msg->poc_um[d] * UNITS_PER_UM, PER_UM_BITS) : 0;
        force_mn[d] = to_mn(msg->force_100un[d]);
        against += force_mn[d] * n[d];
    }
    against = rounded(against, UNIT_BITS);
    for (int d = 0; d < 3; d++) {
        int32_t across = force_mn[d] - rounded(against * n[d], UNIT_BITS);
        square += (uint32_t)across * (uint32_t)across; // int32_t is too narrow for the square of 47 N
    }
    uint32_t normal = against < 0 ? (uint32_t)-against : 0;
    uint32_t shear = square_root(square);
    msg->normal_mn = (uint16_t)normal;
    msg->shear_mn = (uint16_t)shear;
    const uint32_t most = uncertainty->shear_max_mn;
    const uint32_t beyond = most != 0 ? 2 * bt_excess(shear, most) : 0;
    // Of such a shear a map may feel half: nobody is to act on a force with it.
    uint32_t beyond_mn[2] = {beyond != 0 && beyond < normal / 4 ? normal / 4 : beyond, beyond};
    if (uncertainty->margin == &bt_population.margin) {
        add_unfelt(uncertainty, msg->poc_um[0], normal, shear, beyond_mn);
    } else if (uncertainty->margin == &bt_lin_margin && uncertainty->pressed_mn >= 0) {
        beyond_mn[0] += by_pressure(uncertainty, normal, 0, UINT32_MAX);
    }
    msg->normal_half_mn = half_mn(uncertainty, 0, normal + shear, beyond_mn[0]);
    msg->shear_half_mn = half_mn(uncertainty, 1, normal + shear, beyond_mn[1]);
}
