// Words that leap as no living sensor's do, and blows that are none.
#include "emulated_finger.h"

#include "signal/leap.h"

#define PAC_REST 2040
#define QUIET    16

enum { NONE, TOGETHER = BT_SENSOR_FAULT_TOGETHER, EXCHANGED = BT_SENSOR_FAULT_EXCHANGED };

static bt_leap leap;
static bt_trigger trigger;
static bt_round now;

static uint8_t end_round(int pac_swing)
{
    bt_trigger_begin(&trigger, BT_TRIGGER_NEVER);
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        bt_trigger_follow(&trigger, i, now.electrode[i]);
    }
    for (unsigned k = 0; k < BT_PAC_PER_FRAME; k++) {
        now.pac[k] = (uint16_t)(PAC_REST + (k % 2 ? pac_swing : 0));
    }
    (void)bt_trigger_pressure(&trigger, now.pdc, INT32_MAX);
    return bt_leap_round(&leap, &now, &trigger);
}

static int begin(void **state)
{
    (void)state;
    memset(&leap, 0, sizeof leap);
    bt_trigger_reset(&trigger);
    now.pdc = 1500;
    now.tdc = 1000;
    for (unsigned i = 0; i < BT_ELECTRODES; i++) {
        now.electrode[i] = (uint16_t)(2500 + 20 * i);
    }
    for (int k = 0; k < 4; k++) {
        assert_int_equal(end_round(QUIET), NONE);
    }
    return 0;
}

// The first `electrodes` move by `counts`, to and fro in turn or all `one_way`, the last of them by `more`.
typedef struct {
    const char *what;
    unsigned electrodes;
    int counts, more;
    bool one_way;
    int pdc, tdc;
    int pac[3]; // its swing in the round before, in which they move, and after
    uint8_t fault;
} leap_case;

static void move(const leap_case *by, int sign)
{
    for (unsigned i = 0; i < by->electrodes; i++) {
        int size = by->counts + (i + 1 == by->electrodes ? by->more : 0);
        now.electrode[i] = (uint16_t)(now.electrode[i] + sign * (by->one_way || i % 2 ? size : -size));
    }
    now.pdc = (uint16_t)(now.pdc + sign * by->pdc);
    now.tdc = (uint16_t)(now.tdc + sign * by->tdc);
}

#define ALL    BT_ELECTRODES
#define HEARD  75
#define LOUD   76
#define RAILED (BT_RAIL_COUNT - PAC_REST)
#define UNREAD (BT_INVALID_COUNT - PAC_REST)

static const leap_case cases[] = {
    {"electrodes leap while PAC is quiet", ALL, 64, 0, false, 0, 0, {HEARD, HEARD, HEARD}, EXCHANGED},
    {"not far enough", ALL, 63, 0, false, 0, 0, {QUIET, QUIET, QUIET}, NONE},
    {"a blow heard before", ALL, 64, 0, false, 0, 0, {LOUD, QUIET, QUIET}, NONE},
    {"a blow heard at once", ALL, 64, 0, false, 0, 0, {QUIET, LOUD, QUIET}, NONE},
    {"a blow heard after", ALL, 64, 0, false, 0, 0, {QUIET, QUIET, LOUD}, NONE},
    {"a blow that rails PAC", ALL, 200, 0, false, 0, 0, {QUIET, RAILED, QUIET}, NONE},
    {"PAC not read", ALL, 200, 0, false, 0, 0, {QUIET, UNREAD, QUIET}, NONE},
    {"PAC has died", ALL, 200, 0, false, 0, 0, {0, 0, 0}, NONE},
    {"pressure leaps, too", ALL, 40, 0, false, -114, 0, {QUIET, QUIET, QUIET}, EXCHANGED},
    {"pressure, not far enough", ALL, 40, 0, false, -113, 0, {QUIET, QUIET, QUIET}, NONE},
    {"two electrodes are no sensor", 2, 1000, 0, false, 0, 0, {QUIET, QUIET, QUIET}, NONE},
    {"all move alike, however loud", ALL, -50, 0, true, 24, 0, {LOUD, LOUD, LOUD}, TOGETHER},
    {"alike, not far enough", ALL, -31, 0, true, 24, 0, {LOUD, LOUD, LOUD}, NONE},
    {"alike, and pressed", ALL, -50, 0, true, 25, 0, {LOUD, LOUD, LOUD}, NONE},
    {"one moves twice as far", ALL, -50, -60, true, 24, 0, {LOUD, LOUD, LOUD}, NONE},
    {"TDC leaps", 0, 0, 0, false, 0, -65, {LOUD, LOUD, LOUD}, EXCHANGED},
    {"TDC leaps up", 0, 0, 0, false, 0, 65, {LOUD, LOUD, LOUD}, EXCHANGED},
    {"TDC, not far enough", 0, 0, 0, false, 0, 64, {LOUD, LOUD, LOUD}, NONE},
};

TEST(a_leap_is_told_once_when_the_next_round_confirms_it)
{
    for (unsigned k = 0; k < sizeof cases / sizeof *cases; k++) {
        const leap_case *by = &cases[k];
        for (int glitch = 0; glitch < 2; glitch++) {
            begin(NULL);
            assert_int_equal(end_round(by->pac[0]), NONE);
            move(by, 1);
            assert_int_equal(end_round(by->pac[1]), NONE);
            move(by, glitch ? -1 : 0);
            if (end_round(by->pac[2]) != (glitch ? NONE : by->fault)) {
                fail_msg("%s%s", by->what, glitch ? ", for one round" : "");
            }
            assert_int_equal(end_round(QUIET), NONE);
        }
    }
}

TEST(what_moved_while_nothing_was_read_did_not_leap)
{
    bt_round before = now;
    memset(now.electrode, 0xFF, sizeof now.electrode);
    now.pdc = now.tdc = BT_INVALID_COUNT;
    (void)end_round(QUIET);
    now = before;
    move(&(leap_case){.electrodes = ALL, .counts = 300, .tdc = 300}, 1);
    assert_int_equal(end_round(QUIET), NONE);
    assert_int_equal(end_round(QUIET), NONE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_leap_is_told_once_when_the_next_round_confirms_it, begin),
        cmocka_unit_test_setup(what_moved_while_nothing_was_read_did_not_leap, begin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
