// A wrench map's blob at the door.
#include "map_words.h"

TEST(a_blob_is_read_where_it_lies)
{
    static blob stored;
    bt_map map;
    one_block(&stored, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_X, 2, -7);
    memcpy(bytes_of(&stored) + 4, "BTEMU00000000042", 16);
    stored.word[5] = 1763731310;
    stored.word[6] = 300 | 24u << 16;
    stored.word[7] = 200 | (uint32_t)BT_MARGIN_SHARE_MAX_Q8 << 16;
    assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
    assert_true(map.axes == 3 && map.block_count == 1 && map.made_s == 1763731310);
    assert_ptr_equal(map.serial, bytes_of(&stored) + 4);
    const bt_margin margin = {{300, 200}, {24, BT_MARGIN_SHARE_MAX_Q8}};
    assert_memory_equal(&map.margin, &margin, sizeof margin);
    assert_ptr_equal(map.coefficients, bytes_of(&stored) + 44);
    assert_false(bt_map_needs_pdc(&map));
}

static void assert_refused(blob *stored, uint8_t error)
{
    bt_map map;
    memset(&map, 0xFF, sizeof map);
    assert_int_equal(opened(stored, &map), error);
    assert_int_equal(map.axes, 0);
}

TEST(every_byte_of_the_head_is_judged)
{
    static const struct {
        int at;
        uint8_t value, error;
    } wrong[] = {
        {0, BT_MAP_VERSION + 1, BT_ERROR_OUT_OF_RANGE},
        {0, 1, BT_ERROR_OUT_OF_RANGE}, // as boards kept them once: the host makes them into today's
        {1, 0, BT_ERROR_OUT_OF_RANGE},
        {1, 4, BT_ERROR_OUT_OF_RANGE},
        {1, 5, BT_ERROR_OUT_OF_RANGE},
        {1, 6, BT_ERROR_OUT_OF_RANGE}, // no such exponents
        {1, 7, BT_ERROR_OUT_OF_RANGE},
        {1, 8, BT_ERROR_OUT_OF_RANGE},
        {2, 0, BT_ERROR_BAD_LENGTH},
        {2, 2, BT_ERROR_OUT_OF_RANGE}, // coefficients for a block: no such kind
        {2, 255, BT_ERROR_BAD_LENGTH},
        {3, 1, BT_ERROR_BAD_LENGTH}, // of the lesson
        {3, 3, BT_ERROR_OUT_OF_RANGE},
        {27, 17, BT_ERROR_OUT_OF_RANGE}, // a share with a product that might not fit
        {31, 255, BT_ERROR_OUT_OF_RANGE},
        {32, BT_MAP_KINDS, BT_ERROR_OUT_OF_RANGE},
        {32, 255, BT_ERROR_OUT_OF_RANGE},
        {32, BT_MAP_KIND_OFFSET, BT_ERROR_BAD_LENGTH},
        {33, BT_MAP_GATES, BT_ERROR_OUT_OF_RANGE},
        {34, BT_MAP_EXPONENT_MAX + 1, BT_ERROR_OUT_OF_RANGE},
        {36, 255, BT_ERROR_OUT_OF_RANGE},
        {35, 0, BT_ERROR_OUT_OF_RANGE},
        {44 + 2 * 3 * 19, 1, BT_ERROR_OUT_OF_RANGE}, // a twentieth column
        {44 + 2 * 3 * 19 + 5, 128, BT_ERROR_OUT_OF_RANGE},
        {37, 1, BT_ERROR_OUT_OF_RANGE}, // of an axis that is not there
        {40, 1, BT_ERROR_OUT_OF_RANGE},
        {43, 1, BT_ERROR_OUT_OF_RANGE}, // and of none that may be
    };
    static blob stored;
    bt_map map;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        one_block(&stored, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, BT_MAP_EXPONENT_MAX, 100);
        assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
        bytes_of(&stored)[wrong[k].at] = wrong[k].value;
        assert_refused(&stored, wrong[k].error);
    }
}

TEST(every_length_but_one_is_refused)
{
    static blob stored; // of zeros, no map at all
    bt_map map;
    assert_int_equal(bt_map_open(&map, bytes_of(&stored), BT_MAP_HEADER_BYTES - 1), BT_ERROR_BAD_LENGTH);
    assert_int_equal(bt_map_open(&map, bytes_of(&stored), BT_MAP_HEADER_BYTES), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(bt_map_open(&map, bytes_of(&stored), BT_MAP_MAX_BYTES), BT_ERROR_OUT_OF_RANGE);
    assert_int_equal(bt_map_open(&map, bytes_of(&stored), BT_MAP_MAX_BYTES + 1), BT_ERROR_BAD_LENGTH);
    for (size_t k = 0; k < SOME_AXES; k++) {
        one_block(&stored, axes_of[k], BT_MAP_KIND_BULGE, BT_MAP_GATE_YY, 1, 5);
        assert_int_equal(4 * stored.words, 32 + 12 + 2 * 20 * axes_of[k]);
        for (size_t bytes = 0; bytes <= sizeof stored.word; bytes++) {
            uint8_t error = bt_map_open(&map, bytes_of(&stored), bytes);
            assert_int_equal(error, bytes == 4 * stored.words ? BT_ERROR_OK : BT_ERROR_BAD_LENGTH);
        }
    }
    memmove(bytes_of(&stored) + 2, bytes_of(&stored), 4 * stored.words);
    assert_int_equal(bt_map_open(&map, bytes_of(&stored) + 2, 4 * stored.words), BT_ERROR_OUT_OF_RANGE);
}

TEST(a_block_comes_once)
{
    static blob stored;
    bt_map map;
    for (uint32_t second = 0; second < BT_MAP_GATES; second++) {
        begin(&stored, 3, 2);
        block(&stored, BT_MAP_KIND_OFFSET, BT_MAP_GATE_XY, 1);
        block(&stored, BT_MAP_KIND_OFFSET, second, 1);
        (void)fill(&stored, BT_MAP_KIND_OFFSET, 9);
        (void)fill(&stored, BT_MAP_KIND_OFFSET, 9);
        assert_int_equal(opened(&stored, &map),
                         second == BT_MAP_GATE_XY ? BT_ERROR_OUT_OF_RANGE : BT_ERROR_OK);
    }
}

// Magnitudes that add up to sum over columns [first, first + 10), signs by turns.
static void spread(blob *stored, uint32_t kind, uint32_t axis, uint32_t first, int32_t sum)
{
    for (uint32_t k = 0; k < 10 && first + k < columns_of[kind]; k++) {
        int32_t part = sum > 32767 ? 32767 : sum;
        sum -= part;
        *half(stored, FIRST, kind, first + k, axis) = (int16_t)(k & 1 ? -part : part);
    }
    assert_int_equal(sum, 0);
}

// The largest factors: 4095 counts in quarters, a conductance of 3 in 2^-13. Sums fit 31 bits, with half a
// unit of the bits cut off them: 15 bits of a block, 17 of a row of pairs.
#define LINE_MAX(factor) ((INT32_MAX - (1 << 15)) / (factor))
#define ROW_MAX(factor)  (INT32_MAX / (factor))
#define SIGNAL           (4095 << 2)
#define CONDUCTANCE      (3 << 13)

TEST(coefficients_are_bounded_sum_by_sum)
{
    static const int32_t most[BT_MAP_KINDS] = {[BT_MAP_KIND_SIGNAL] = LINE_MAX(SIGNAL),
                                               [BT_MAP_KIND_COMPRESSION] = LINE_MAX(SIGNAL),
                                               [BT_MAP_KIND_BULGE] = LINE_MAX(SIGNAL),
                                               [BT_MAP_KIND_SIGNAL_PAIRS] = ROW_MAX(SIGNAL),
                                               [BT_MAP_KIND_CONDUCTANCE] = LINE_MAX(CONDUCTANCE),
                                               [BT_MAP_KIND_CONDUCTANCE_PAIRS] = ROW_MAX(CONDUCTANCE)};
    static blob stored;
    bt_map map;
    for (uint32_t kind = 0; kind < BT_MAP_KINDS; kind++) {
        for (uint32_t axis = 0; axis < 7; axis++) {
            one_block(&stored, 7, kind, BT_MAP_GATE_ONE, 1, 0);
            if (most[kind] == 0) { // of one column: nothing of 16 bits is too large
                *half(&stored, FIRST, kind, 0, axis) = INT16_MIN;
                assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
                continue;
            }
            for (uint32_t first = 0; first < columns_of[kind]; first += 10) {
                spread(&stored, kind, axis, first, most[kind]);
                assert_int_equal(opened(&stored, &map), BT_ERROR_OK);
                spread(&stored, kind, axis, first, most[kind] + 1);
                assert_refused(&stored, BT_ERROR_OUT_OF_RANGE);
                spread(&stored, kind, axis, first, 0);
            }
        }
    }
}

// Every row may be small enough and the sum still too large: 19 of (row >> 16) + 1 times a factor.
TEST(rows_are_bounded_together)
{
    static blob stored;
    bt_map map;
    for (uint32_t axis = 0; axis < 7; axis++) {
        one_block(&stored, 7, BT_MAP_KIND_SIGNAL_PAIRS, BT_MAP_GATE_YY, 1, 0);
        for (int sum = 27606; sum <= 27607;
             sum++) { // 27606 * 16380 >> 16 is 6899, and 19 * 6901 * 16380 > 2^31
            for (uint32_t first = 0; first < 190; first += 10) {
                spread(&stored, BT_MAP_KIND_SIGNAL_PAIRS, axis, first, sum);
            }
            assert_int_equal(opened(&stored, &map), sum == 27606 ? BT_ERROR_OK : BT_ERROR_OUT_OF_RANGE);
        }
    }
}

// Two blocks of 2^30 fit, a third does not.
TEST(blocks_are_bounded_together)
{
    static blob stored;
    for (uint32_t count = 2; count <= 3; count++) {
        bt_map map;
        begin(&stored, 3, count);
        for (uint32_t b = 0; b < count; b++) {
            block(&stored, BT_MAP_KIND_SIGNAL + b, BT_MAP_GATE_ONE, 1);
        }
        for (uint32_t b = 0; b < count; b++) {
            uint32_t first = fill(&stored, BT_MAP_KIND_SIGNAL + b, 0);
            for (uint32_t k = 0; k < 4; k++) {
                *half(&stored, first, BT_MAP_KIND_SIGNAL + b, k, 1) = 32767;
            }
        }
        assert_int_equal(opened(&stored, &map), count == 2 ? BT_ERROR_OK : BT_ERROR_OUT_OF_RANGE);
    }
}
