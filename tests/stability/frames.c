#include "frames.h"

#include <math.h>
#include <string.h>

#define TOP BT_E_MAX_Q4

uint64_t draw(uint64_t *state)
{
    *state ^= *state >> 12;
    *state ^= *state << 25;
    *state ^= *state >> 27;
    return *state * 0x2545F4914F6CDD1Dull;
}

int64_t draw_range(uint64_t *state, int64_t low, int64_t high)
{
    return low + (int64_t)((draw(state) >> 8) % (uint64_t)(high - low + 1));
}

double draw_unit(uint64_t *state)
{
    return (double)(draw(state) >> 11) / 9007199254740992.0;
}

// ---- lists -----------------------------------------------------------------------------------------

#define CORNERS (1 << BT_ELECTRODES)

static void corner(int64_t signs, int32_t low, int32_t high, int32_t e_q4[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = signs >> i & 1 ? high : low;
    }
}

// Every count and every tare at one end of its range: all 2^19 of them.
static bool corners_of_the_box(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    corner(k, -TOP, TOP, e_q4);
    return k < CORNERS;
}

// Every count at one end of its range over a usual tare.
static bool corners_over_a_tare(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    corner(k, -16 * 3000, 16 * 4095 - 16 * 3000, e_q4);
    return k < CORNERS;
}

// Every electrode alone, either way, at every sixteenth up to 256 counts and then at every 2/3 count: odd
// steps, so that all remainders are met.
#define FINE_SIZES (256 * 16)
#define STEP       11
#define ALL_SIZES  (FINE_SIZES + (TOP - FINE_SIZES) / STEP)

static bool single_electrodes(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    int32_t n = (int32_t)(k / 2 % ALL_SIZES) + 1;
    int32_t size = n <= FINE_SIZES ? n : FINE_SIZES + (n - FINE_SIZES) * STEP;
    memset(e_q4, 0, BT_ELECTRODES * sizeof *e_q4);
    if (k / 2 / ALL_SIZES < BT_ELECTRODES) {
        e_q4[k / 2 / ALL_SIZES] = k % 2 ? size : -size;
        return true;
    }
    return false;
}

static bool all_equal(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    corner(0, (int32_t)(k - TOP), 0, e_q4);
    return k <= 2 * TOP;
}

// The tare's least bit and the count's, on each electrode and each pair, all signs.
static bool least_bits(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    static const int32_t value[5] = {0, -1, 1, -16, 16};
    int64_t pair = k / 25;
    memset(e_q4, 0, BT_ELECTRODES * sizeof *e_q4);
    if (pair >= BT_ELECTRODES * BT_ELECTRODES) {
        return false;
    }
    e_q4[pair / BT_ELECTRODES] = value[k % 5];
    e_q4[pair % BT_ELECTRODES] = value[k / 5 % 5];
    return true;
}

// Some electrodes at an end of their range, the others as noise leaves them.
static bool railed(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    uint64_t state = 0x9E3779B97F4A7C15ull * (uint64_t)(k + 1);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t tare = (int32_t)draw_range(&state, 16 * 2700, 16 * 3600);
        int64_t what = draw_range(&state, 0, 3);
        e_q4[i] = what == 0   ? -tare
                  : what == 1 ? 16 * (int32_t)draw_range(&state, 4090, 4095) - tare
                              : (int32_t)draw_range(&state, -80, 80);
    }
    return k < 50000;
}

// The signs that make one sum as large as it gets: of normals, arms and places, each axis, each way.
static bool largest_sums(int64_t k, int32_t e_q4[BT_ELECTRODES])
{
    int64_t d = k / 2 % 3;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t coordinate = k / 6 == 0   ? bt_normal_milli[i][d]
                             : k / 6 == 1 ? bt_arm_nm[i][d]
                                          : bt_electrode_um[i][d];
        e_q4[i] = (coordinate > 0) == (k % 2 == 0) ? TOP : -TOP;
    }
    return k < 18;
}

const frame_list lists[LISTS] = {
    {"corners of the box", corners_of_the_box},
    {"corners over a tare of 3000", corners_over_a_tare},
    {"single electrodes", single_electrodes},
    {"all equal", all_equal},
    {"one LSB on one and two", least_bits},
    {"railed among noise", railed},
    {"largest sums", largest_sums},
};

// ---- classes ---------------------------------------------------------------------------------------

static int32_t within(double e)
{
    return (int32_t)lround(e > TOP ? TOP : e < -TOP ? -TOP : e);
}

// Sizes of all orders alike.
static int32_t any_size(uint64_t *state)
{
    return (int32_t)draw_range(state, 0, TOP >> draw_range(state, 0, 16));
}

static void fill_noise(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    (void)weights;
    int32_t size = (int32_t)draw_range(state, 1, 16 * 15);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = (int32_t)draw_range(state, -size, size);
    }
}

static void fill_box(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    (void)weights;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = (int32_t)draw_range(state, -TOP, TOP);
    }
}

static void fill_sparse(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    (void)weights;
    memset(e_q4, 0, BT_ELECTRODES * sizeof *e_q4);
    for (int64_t n = draw_range(state, 1, 4); n > 0; n--) {
        int32_t size = any_size(state);
        e_q4[draw_range(state, 0, BT_ELECTRODES - 1)] = draw(state) >> 62 ? -size : size;
    }
}

static void fill_all_orders(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    (void)weights;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        int32_t size = any_size(state);
        e_q4[i] = draw(state) >> 62 ? -size : size;
    }
}

void on_core(double x_mm, double angle, double at_mm[3])
{
    double radius = BT_CORE_RADIUS_UM / 1000.0;
    double around = x_mm > 0 ? sqrt(fmax(radius * radius - x_mm * x_mm, 0)) : radius;
    at_mm[0] = x_mm;
    at_mm[1] = around * sin(angle);
    at_mm[2] = -around * cos(angle);
}

void press(const double at_mm[3], double width_mm, double top_count, double e[BT_ELECTRODES])
{
    for (int i = 0; i < BT_ELECTRODES; i++) {
        double square = 0;
        for (int d = 0; d < 3; d++) {
            double away = bt_electrode_um[i][d] / 1000.0 - at_mm[d];
            square += away * away;
        }
        e[i] = -top_count * exp(-square / (2 * width_mm * width_mm));
    }
}

static void fill_pressed_at(uint64_t *state, double x_mm, int32_t e_q4[BT_ELECTRODES])
{
    double at_mm[3], e[BT_ELECTRODES];
    on_core(x_mm, (draw_unit(state) - 0.5) * 2.8, at_mm);
    press(at_mm, 0.8 + 5 * draw_unit(state), ldexp(1 + draw_unit(state), (int)draw_range(state, 1, 11)), e);
    double bulge = 200 * draw_unit(state) * draw_unit(state);
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = within(16 * (e[i] + bulge * (draw_unit(state) - 0.3)));
    }
}

static void fill_pressed(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    (void)weights;
    fill_pressed_at(state, -14 + 19 * draw_unit(state), e_q4);
}

static double weight(int32_t e, int weights)
{
    double size = weights != BT_POC_WEIGHTS_ABS_N2 && e > 0 ? 0 : fabs((double)e);
    return weights == BT_POC_WEIGHTS_COMPRESS_N1 ? size : size * size;
}

static double moment_x(const int32_t e_q4[BT_ELECTRODES], int weights)
{
    double sum = 0; // whole numbers below 2^53
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += weight(e_q4[i], weights) * bt_electrode_um[i][0];
    }
    return sum;
}

double centre_x_um(const int32_t e_q4[BT_ELECTRODES], int weights)
{
    double total = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        total += weight(e_q4[i], weights);
    }
    return moment_x(e_q4, weights) / total;
}

// A press whose centre is brought to x = 0, or next to it: weights are solved for one electrode after the
// other, on the side that lacks some, from those far off to those whose least bit moves x least.
static void fill_seam(uint64_t *state, int weights, int32_t e_q4[BT_ELECTRODES])
{
    static const int ahead[] = {6, 7, 8, 9, 0, 10};   // E7 E8 E9 E10 E1 E11
    static const int behind[] = {18, 4, 3, 2, 16, 1}; // E19 E5 E4 E3 E17 E2
    fill_pressed_at(state, draw_unit(state) - 0.5, e_q4);
    for (int step = 0; step < 6; step++) {
        double sum = moment_x(e_q4, weights);
        int i = sum < 0 ? ahead[step] : behind[step];
        double lacking = fabs(sum / bt_electrode_um[i][0]) + weight(e_q4[i], weights);
        double size = weights == BT_POC_WEIGHTS_COMPRESS_N1 ? lacking : sqrt(lacking);
        // Cut off, or one too many: both sides of the seam are reached.
        e_q4[i] = -(int32_t)(size > TOP - 1 ? TOP : floor(size) + (double)draw_range(state, 0, 1));
    }
}

const frame_class classes[CLASSES] = {
    {"noise up to 15 counts", fill_noise},   {"the whole box", fill_box},
    {"one to four electrodes", fill_sparse}, {"all orders of size", fill_all_orders},
    {"presses with bulge", fill_pressed},    {"within a um of x = 0", fill_seam},
};

// ---- climbing --------------------------------------------------------------------------------------

void change_frame(uint64_t *state, int32_t e_q4[BT_ELECTRODES])
{
    int32_t *e = &e_q4[draw_range(state, 0, BT_ELECTRODES - 1)];
    double factor;
    switch (draw_range(state, 0, 5)) {
    case 0:
        *e = draw(state) >> 62 ? -any_size(state) : any_size(state);
        break;
    case 1:
        *e = within((double)*e + (double)draw_range(state, -1, 1));
        break;
    case 2:
        *e = within((double)*e + (double)draw_range(state, -256, 256));
        break;
    case 3:
        *e = draw(state) >> 63 ? -*e : 0;
        break;
    case 4:
        *e = draw(state) >> 63 ? -TOP : TOP;
        break;
    default:
        factor = 0.9 + 0.2 * draw_unit(state);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            e_q4[i] = within(e_q4[i] * factor);
        }
    }
}
