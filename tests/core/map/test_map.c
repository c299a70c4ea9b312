// A wrench map's blob at the door.
#include "map_words.h"

static void a_blob_is_read_where_it_lies(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_X, 2, WORD(1, -1));
    memcpy(bytes_of(&its) + 4, "BTEMU00000000042", 16);
    its.word[5] = 1763731310;
    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
    assert_true(map.axes == 3 && map.block_count == 1 && map.made_s == 1763731310);
    assert_ptr_equal(map.serial, bytes_of(&its) + 4);
    assert_ptr_equal(map.coefficients, bytes_of(&its) + 36);
    assert_false(bt_map_needs_pdc(&map));
}

static void assert_refused(blob *its, uint8_t error)
{
    bt_map map;
    memset(&map, 0xFF, sizeof map);
    assert_int_equal(opened(its, &map), error);
    assert_int_equal(map.axes, 0);
}

static void every_byte_of_the_head_is_judged(void **state)
{
    (void)state;
    static const struct {
        int at;
        uint8_t value, error;
    } wrong[] = {
        {0, BT_MAP_VERSION + 1, BT_ERROR_OUT_OF_RANGE},
        {1, 0, BT_ERROR_OUT_OF_RANGE},
        {1, 4, BT_ERROR_OUT_OF_RANGE},
        {1, 5, BT_ERROR_OUT_OF_RANGE},
        {1, 6, BT_ERROR_BAD_LENGTH}, // twice the coefficients
        {1, 7, BT_ERROR_BAD_LENGTH},
        {1, 8, BT_ERROR_OUT_OF_RANGE},
        {2, 0, BT_ERROR_BAD_LENGTH},
        {2, 2, BT_ERROR_OUT_OF_RANGE}, // coefficients for a block: no such kind
        {2, 255, BT_ERROR_BAD_LENGTH},
        {3, 1, BT_ERROR_OUT_OF_RANGE},
        {24, BT_MAP_KINDS, BT_ERROR_OUT_OF_RANGE},
        {24, 255, BT_ERROR_OUT_OF_RANGE},
        {24, BT_MAP_KIND_OFFSET, BT_ERROR_BAD_LENGTH},
        {25, BT_MAP_GATES, BT_ERROR_OUT_OF_RANGE},
        {26, BT_MAP_EXPONENT_MAX + 1, BT_ERROR_OUT_OF_RANGE},
        {28, 255, BT_ERROR_OUT_OF_RANGE},
        {29, 1, BT_ERROR_OUT_OF_RANGE}, // of an axis that is not there
        {32, 1, BT_ERROR_OUT_OF_RANGE},
        {35, 1, BT_ERROR_OUT_OF_RANGE}, // and of none that may be
    };
    static blob its;
    bt_map map;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        one_block(&its, 3, BT_MAP_KIND_SIGNAL, BT_MAP_GATE_ONE, BT_MAP_EXPONENT_MAX, WORD(100, 0x77));
        assert_int_equal(opened(&its, &map), BT_ERROR_OK);
        bytes_of(&its)[wrong[k].at] = wrong[k].value;
        assert_refused(&its, wrong[k].error);
    }
}

static void every_length_but_one_is_refused(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    for (size_t k = 0; k < SOME_AXES; k++) {
        one_block(&its, axes_of[k], BT_MAP_KIND_BULGE, BT_MAP_GATE_YY, 1, 5);
        assert_int_equal(4 * its.words, 24 + 12 + 4 * 19 * axes_of[k]);
        for (size_t bytes = 0; bytes <= sizeof its.word; bytes++) {
            uint8_t error = bt_map_open(&map, bytes_of(&its), bytes);
            assert_int_equal(error, bytes == 4 * its.words ? BT_ERROR_OK : BT_ERROR_BAD_LENGTH);
        }
    }
    memmove(bytes_of(&its) + 2, bytes_of(&its), 4 * its.words);
    assert_int_equal(bt_map_open(&map, bytes_of(&its) + 2, 4 * its.words), BT_ERROR_OUT_OF_RANGE);
}

static void a_block_comes_once(void **state)
{
    (void)state;
    static blob its;
    bt_map map;
    for (uint32_t second = 0; second < BT_MAP_GATES; second++) {
        begin(&its, 3, 2);
        block(&its, BT_MAP_KIND_OFFSET, BT_MAP_GATE_XY, 0);
        block(&its, BT_MAP_KIND_OFFSET, second, 0);
        fill(&its, BT_MAP_KIND_OFFSET, 9);
        fill(&its, BT_MAP_KIND_OFFSET, 9);
        assert_int_equal(opened(&its, &map), second == BT_MAP_GATE_XY ? BT_ERROR_OUT_OF_RANGE : BT_ERROR_OK);
    }
}

// Which coefficients stand in one sum: all of a block, or a row of pairs. 2^31 - 2^16 fits, one more does
// not.
static void coefficients_are_bounded_sum_by_sum(void **state)
{
    (void)state;
    static blob its;
    for (uint32_t kind = 0; kind < BT_MAP_KINDS; kind++) {
        uint32_t first = 0, row = BT_ELECTRODES;
        while (first < columns_of[kind]) {
            uint32_t last = columns_of[kind] == BT_MAP_PAIRS ? first + row - 1 : columns_of[kind] - 1;
            for (uint32_t axis = 0; axis < 7; axis++) {
                uint32_t width = axis < 6 ? 3 : 1; // of the group that the axis is in
                one_block(&its, 7, kind, BT_MAP_GATE_ONE, 0, 0);
                uint32_t *group = its.word + its.words - (7 - axis / 3 * 3) * columns_of[kind];
                bt_map map;
                // All but 1, or all but 2^16; the rest of the sum stands in its last word.
                group[width * first + axis % 3] = axis & 1 ? WORD(32766, 0) : WORD(-32767, 1);
                if (last > first) {
                    group[width * last + axis % 3] = axis & 1 ? WORD(-1, 0) : WORD(0, -1);
                    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
                    group[width * last + axis % 3] = axis & 1 ? WORD(-1, -1) : WORD(0, -2);
                } else {
                    group[width * first + axis % 3] = axis & 1 ? WORD(32767, 0) : WORD(-32767, 0);
                    assert_int_equal(opened(&its, &map), BT_ERROR_OK);
                    group[width * first + axis % 3] = axis & 1 ? WORD(32767, 1) : WORD(-32767, -1);
                }
                assert_refused(&its, BT_ERROR_OUT_OF_RANGE);
                group[width * first + axis % 3] = WORD(-32768, -32768); // the largest there is
                assert_refused(&its, BT_ERROR_OUT_OF_RANGE);
            }
            first = last + 1;
            row--;
        }
    }
}

#define T(name) cmocka_unit_test(name)
int main(void)
{
    const struct CMUnitTest tests[] = {
        T(a_blob_is_read_where_it_lies),        T(every_byte_of_the_head_is_judged),
        T(every_length_but_one_is_refused),     T(a_block_comes_once),
        T(coefficients_are_bounded_sum_by_sum),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
