// From the sums to the moments, and from the moments to x (solve/poc.c): the bits cut off, and that x is
// rounded correctly.
#include "support.h"

#include "solve/poc.c"

static int64_t moment(const uint32_t weight[BT_ELECTRODES], int axis)
{
    int64_t sum = 0;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        sum += (int64_t)weight[i] * bt_electrode_um[i][axis];
    }
    return sum;
}

static void draw_signals(uint64_t *seed, int k, int32_t e_q4[BT_ELECTRODES])
{
    const int32_t most = BT_E_MAX_Q4 >> k % 16;
    for (int i = 0; i < BT_ELECTRODES; i++) {
        e_q4[i] = k % 5 ? (int32_t)random_range(seed, -most, most) : random_u64(seed) & 1 ? most : -most;
        e_q4[i] = k % 3 || random_u64(seed) & 1 ? e_q4[i] : 0;
    }
}

// Each part that is cut loses less than one unit, and x behind the seam is cut twice.
TEST(moments_of_squares_lose_only_what_is_cut)
{
    static const int64_t lost[3] = {3, 2, 2};
    uint64_t seed = 41;
    for (int k = 0; k < 200000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        uint32_t weight[BT_ELECTRODES];
        moments m = {0};
        draw_signals(&seed, k, e_q4);
        square_moments(e_q4, BT_POC_WEIGHTS_ABS_N2, &m);
        int down = bt_bit_length(squares_of(e_q4, weight)) - BT_SUMS_WEIGHT_BITS;
        int64_t total = 0;
        for (int i = 0; i < BT_ELECTRODES; i++) {
            weight[i] = down < 0 ? weight[i] << -down : weight[i] >> down;
            total += weight[i];
        }
        assert_int_equal(m.total, total);
        for (int d = 0; d < 3 && total > 0; d++) {
            const int64_t whole = moment(weight, d);
            assert_true(llabs((m.n[d] * ((int64_t)1 << m.bits)) - whole) <= lost[d] << m.bits);
        }
        assert_true(total == 0 || m.x_backward == (uint32_t)-moment(weight, 0));
    }
}

TEST(linear_moments_are_exact_or_cut_once)
{
    uint64_t seed = 42;
    int halves[2] = {0};
    for (int k = 0; k < 200000; k++) {
        int32_t e_q4[BT_ELECTRODES];
        uint32_t weight[BT_ELECTRODES];
        moments m;
        bt_linear_sums sums;
        draw_signals(&seed, k, e_q4);
        bt_sums_linear(e_q4, &sums);
        linear_moments(&sums, &m);
        for (int i = 0; i < BT_ELECTRODES; i++) {
            weight[i] = e_q4[i] < 0 ? (uint32_t)-e_q4[i] : 0;
        }
        halves[m.bits > 0]++;
        for (int d = 0; d < 3; d++) {
            const int64_t off = llabs(m.n[d] * ((int64_t)1 << m.bits) - moment(weight, d));
            assert_true(m.bits == 0 ? off == 0 : off < 1 << m.bits);
        }
        assert_true(m.x_backward == (uint32_t)-moment(weight, 0));
    }
    assert_true(halves[0] > 10000 && halves[1] > 10000);
}

// x of one total and one exact moment, with n cut as far as possible in either direction.
static void check_ratio(int64_t backward, uint32_t total, int bits, int64_t off)
{
    for (int64_t by = -off; by <= off; by++) {
        moments m = {.bits = bits, .x_backward = (uint32_t)backward, .total = total};
        m.n[0] = (int32_t)(-(backward >> bits) + by);
        if (m.n[0] <= 0) {
            assert_int_equal(-ratio_um(&m), bt_div_round(backward, total));
        }
    }
}

// Both sides of every value at which x rounds the other way.
TEST(x_on_the_cylinder_is_correctly_rounded)
{
    static const struct {
        int bits;
        int64_t off, first, last; // totals
        int count;
    } ranges[] = {{0, 0, 1, 300, 300},
                  {0, 0, 301, WHOLE_TOTAL, 120},
                  {LINEAR_BITS, 1, WHOLE_TOTAL + 1, (int64_t)BT_E_MAX_Q4 * BT_ELECTRODES, 120},
                  {SPLIT_BITS, 3, 1 << (BT_SUMS_WEIGHT_BITS - 1), WEIGHT_MAX * BT_ELECTRODES, 60}};
    for (size_t r = 0; r < sizeof ranges / sizeof *ranges; r++) {
        for (int k = 0; k < ranges[r].count; k++) { // the ends among them
            const int64_t span = ranges[r].last - ranges[r].first;
            const int64_t total = ranges[r].first + span * k / (ranges[r].count - 1);
            for (int64_t um = 0; um < BT_ELECTRODE_MAX_UM; um++) {
                const int64_t middle = um * total + total / 2; // and half
                for (int64_t backward = middle - 1; backward <= middle + 2; backward++) {
                    if (backward >= 0) {
                        check_ratio(backward, (uint32_t)total, ranges[r].bits, ranges[r].off);
                    }
                }
            }
        }
    }
}
